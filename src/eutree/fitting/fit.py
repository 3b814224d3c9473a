"""Fit a tree that can be trusted: chosen by playing, set beside its demonstrator, explained.

To choose and to repair are contests (:mod:`eutree.contests`) that promise nothing: who judges the
tree that they hand on plays fresh episodes.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any, Literal

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.c45 import C45Settings
from eutree.contests import Halving
from eutree.data import Demonstrations, Episode
from eutree.data import derive as with_derived
from eutree.data.demonstrations import lesson_masks, lessons
from eutree.data.episode import allowed_in
from eutree.errors import EutreeError, InvalidArgumentError
from eutree.fitting.combining import confirm, propose
from eutree.fitting.diagnosis import about_demonstrations, about_result, about_size, harms, in_words
from eutree.fitting.playing import Played, Player, Progress, most_guilty, repairs
from eutree.fitting.playing import practise as learn_on
from eutree.fitting.report import FitReport, Person
from eutree.inspection import keep_monotone, monotone_rules
from eutree.interaction import describe
from eutree.interaction.deriving import acting_as
from eutree.interaction.making import Environment, make, opened
from eutree.learners.starts import (
    RELEASE_8,
    SETTINGS,
    FittedTree,
    best_left_out,
    falling_back,
    fitted_trees,
    promising,
    shown_in,
)
from eutree.policies import TreePolicy
from eutree.policies.reach import ever_allowed
from eutree.validation import check_integer, check_kind, check_listed, check_seed

RACING, REPAIRING, CONFIRMING, JUDGING, COMPARING = 0, 100, 200, 300, 301  # first blocks
MOST_REPAIRS = 3  # one after the other
BLAMED_LEAVES = 3  # that are tried for each of them
# At two actions: each leaf has three repairs; the tree itself, and twice two longer plays.
MOST_REPAIR_PLAYS = MOST_REPAIRS * (3 * BLAMED_LEAVES + 1 + 4)
MOST_RACING = 8  # trees
RACE_SHARE, REPAIR_SHARE = 3.0, 0.3  # of the episodes that judge the tree


def race(found: list[FittedTree], player: Player, budget: int) -> tuple[FittedTree, Played]:
    """Return the winner and its episodes: the worse half drops out after each round.

    All play the same episodes, in each round as many more as they have played, ``budget`` of all
    of them together. The first wins ties.
    """
    rule = Halving.within(budget, len(found))
    winner, played = player.contest(rule, [entry.policy for entry in found], RACING)
    return found[winner], played


def mend(
    fitted: FittedTree,
    played: Played,
    demonstrations: Demonstrations,
    player: Player,
    budget: int,
    kept: Callable[[FittedTree], FittedTree] = lambda fitted: fitted,
) -> tuple[FittedTree, Played]:
    """Return the tree, repaired leaf by leaf as long as it falls short of the person.

    Each repair plays the same new block of ``budget`` episodes as the tree that it is made of; the
    best one is taken if it does better there and again on another block, twice as long. ``kept``
    makes a repaired tree keep the rules that were asked for.
    """
    person = Person.of(demonstrations)
    for number in range(MOST_REPAIRS):
        if not person.is_above(played.evaluation):
            break
        tried = [fitted, *map(kept, _repaired(fitted, played, demonstrations, person))]
        for block, episodes in ((REPAIRING, budget), (CONFIRMING, 2 * budget)):
            rule = Halving(first=episodes, most=episodes)
            winner, again = player.contest(rule, [entry.policy for entry in tried], block + number)
            if winner == 0:
                return fitted, played
            tried = [fitted, tried[winner]]
        fitted, played = tried[1], again
    return fitted, played


def _repaired(
    fitted: FittedTree, played: Played, demonstrations: Demonstrations, person: Person
) -> Iterable[FittedTree]:
    """Yield the repairs of the leaves that have most to do with failing."""
    known = demonstrations.with_history(fitted.policy.history)
    for leaf in most_guilty(played, person.mean_return, BLAMED_LEAVES):
        for policy, words in repairs(fitted.policy, demonstrations, leaf):
            if policy.masked:
                policy = falling_back(policy, *lessons(known))
            yield replace(fitted, policy=policy, repairs=(*fitted.repairs, words))


def fit(
    demonstrations: Demonstrations,
    env: Environment | None = None,
    *,
    episodes: int = 200,
    practise: int = 0,
    settings: C45Settings | None = None,
    history: int | None = None,
    monotone: Sequence[str] = (),
    derive: Sequence[str] | Literal["auto"] = (),
    seed: int = 0,
    on_progress: Progress | None = None,
) -> FitReport:
    """Return the best tree that C4.5 makes of demonstrations, and how good it is beside them.

    C4.5 of release 8 and a few variants (``eutree.learners.starts``) are compared by
    episodes left out, the best eight by playing. While the winner falls short of the demonstrator,
    the leaf that has most to do with failing is repaired by other actions shown there, where
    playing confirms that. At last it plays fresh episodes; ``warnings`` name its faults.

    Args:
        demonstrations: The episodes to imitate; at least one step.
        env: Where to play: an environment, its id, or how to make it. None makes the environment
            that the demonstrations name; where that fails, the tree is not played, and the
            warnings say so.
        episodes: Fresh episodes that judge the tree, 100 to 300 for most purposes. Choosing takes
            three times as many, a repair about as many again. 0 plays nothing: the choice is made
            by episodes left out alone.
        practise: Episodes of ``eutree.learn`` to go on with, from the tree, the demonstrations and
            its episodes. The better of both by fresh episodes is returned.
        settings: The choices of C4.5. None chooses.
        history: Number of previous observations as features. None chooses between 0 and 1.
        monotone: Rules such as ``"stop in distance"`` that every tree keeps: a leaf changes to an
            action shown there less often, for as few steps as it takes.
        derive: Derived features to declare, ``"gap = left - right"``; ``"auto"`` proposes a few
            (``eutree.fitting.combining``) and takes those that playing confirms.
        seed: The same seed gives the same report.
        on_progress: Called after each episode with its purpose and how many there were.

    Raises:
        InvalidArgumentError: There is nothing to fit, the environment is another one than that of
            the demonstrations, or ``practise`` has no environment.
        EnvironmentFault: The environment broke its contract.
    """
    check_kind("demonstrations", demonstrations, Demonstrations)
    check_integer("episodes", episodes, low=0)
    check_integer("practise", practise, low=0)
    check_seed(seed)
    if history is not None:
        check_integer("history", history, low=0)
    if practise and not episodes:
        raise InvalidArgumentError(
            f"episodes must be at least 1 to practise, which has to be judged, got {episodes}"
        )
    if derive != "auto":
        demonstrations = with_derived(demonstrations, derive)
    chosen = check_kind("settings", settings or RELEASE_8, C45Settings)
    with ExitStack() as stack:
        world, missing = _world(demonstrations, env, stack) if episodes else (None, "")
        if world is None and practise:
            raise InvalidArgumentError(f"practise must be 0 without an environment: {missing}")
        proposals, spent = propose(demonstrations, chosen), 0
        if derive == "auto" and proposals:
            proposals, spent = confirm(
                proposals, demonstrations, world, chosen,
                episodes=max(2, episodes // 2), seed=seed, on_progress=on_progress,
            )  # fmt: skip
            taken = [one.declaration for one in proposals if one.taken]
            demonstrations = with_derived(demonstrations, taken)
            world = None if world is None else acting_as(world, demonstrations)
        found = fitted_trees(
            demonstrations,
            settings=SETTINGS if settings is None else (settings,),
            histories=(0, 1) if history is None and settings is None else (history or 0,),
        )
        keeps = _Keeping(demonstrations, check_listed("monotone", monotone))
        found = [keeps.kept(one) for one in found]
        if world is None:
            report = _report(best_left_out(found), None, demonstrations, found)
            if missing:
                report = _noted(report, f"The tree was not played: {missing}")
        else:
            player = Player(world, seed, on_progress)
            fitting = _Fitting(demonstrations, player, keeps, episodes, seed)
            report = fitting.report(found, practise, repair=settings is None)
    return replace(report, proposals=proposals, episodes_played=report.episodes_played + spent)


@dataclass(frozen=True)
class _Keeping:
    """Monotone rules that trees of some demonstrations keep."""

    demonstrations: Demonstrations
    monotone: tuple[str, ...]

    def kept(self, fitted: FittedTree) -> FittedTree:
        """Return a fitted tree that keeps the rules, by the actions shown in its leaves."""
        if not self.monotone:
            return fitted
        shown_there = shown_in(fitted.policy, self.demonstrations).astype(np.float64)
        return replace(fitted, policy=self.keeping(fitted.policy, shown_there))

    def keeping(self, policy: TreePolicy, weights: Floats | None = None) -> TreePolicy:
        """Return a policy that keeps the rules, by the worth of each action in each leaf."""
        if not self.monotone:
            return policy
        masks, known = allowed_in(self.demonstrations), self.demonstrations
        observations = known.with_history(policy.history).observations
        allowed = None if masks is None else ever_allowed(policy, observations, masks)
        rules = monotone_rules(self.monotone, policy.schema)
        return keep_monotone(policy, rules, weights, allowed=allowed)


@dataclass(frozen=True, eq=False)
class _Fitting:
    """The steps of a fit in an environment, for which ``player`` plays and counts the episodes."""

    demonstrations: Demonstrations
    player: Player
    keeps: _Keeping
    episodes: int
    seed: int

    def report(self, found: list[FittedTree], practise: int, *, repair: bool) -> FitReport:
        """Return the report of the best tree, after so many episodes of practice."""
        chosen, known = self.choose(found, repair=repair)
        self.player.begin("judging", self.episodes)
        judged = self.player.play(chosen.policy, self.episodes, JUDGING)  # fresh ones
        report = _report(chosen, judged, self.demonstrations, found)
        count, plays = self.player.episodes, known + judged.episodes
        report = replace(report, plays=plays, episodes_played=count)
        if not practise:
            return report
        better = self.practise(chosen, plays, practise)
        count = self.player.episodes + practise
        if better is None:
            after = _noted(report, f"{practise} episodes of practice made nothing better of it.")
        else:
            after = _report(*better, self.demonstrations, found)
            after = replace(after, plays=better[1].episodes)
        return replace(after, before_practice=report, episodes_played=count)

    def choose(
        self, found: list[FittedTree], *, repair: bool
    ) -> tuple[FittedTree, tuple[Episode, ...]]:
        """Return the tree to judge and its episodes so far."""
        entrants = promising(found, MOST_RACING)
        if not repair and len(entrants) == 1:
            return entrants[0], ()
        budget = max(1, int(RACE_SHARE * self.episodes))
        self.player.begin("choosing", budget)
        chosen, played = race(entrants, self.player, budget)
        if repair:
            budget = max(1, int(REPAIR_SHARE * self.episodes))
            self.player.begin("repairing", MOST_REPAIR_PLAYS * budget)
            kept = self.keeps.kept
            chosen, played = mend(chosen, played, self.demonstrations, self.player, budget, kept)
        return chosen, played.episodes

    def practise(
        self, chosen: FittedTree, known: tuple[Episode, ...], episodes: int
    ) -> tuple[FittedTree, Played] | None:
        """Return the tree learned from this tree and its play; None if it is no better."""

        def tell(run: Any) -> None:
            if self.player.on_progress is not None:
                self.player.on_progress("practising", run.episode, episodes)

        challengers = learn_on(
            chosen.policy, self.demonstrations, known, self.player.world,
            episodes=episodes, seed=self.seed, on_progress=tell,
        )  # fmt: skip
        self.player.begin("comparing", (1 + len(challengers)) * self.episodes)
        challengers = tuple(map(self.keeps.keeping, challengers))
        rule = Halving(first=self.episodes, most=self.episodes)
        winner, best = self.player.contest(rule, [chosen.policy, *challengers], COMPARING)
        if winner == 0:
            return None
        words = f"{episodes} episodes of practice"
        return replace(chosen, policy=best.policy, repairs=(*chosen.repairs, words)), best


def _world(
    demonstrations: Demonstrations, env: Environment | None, stack: ExitStack
) -> tuple[gymnasium.Env[Any, Any] | None, str]:
    """Return the environment to play in, or None and why there is none."""
    if env is not None:
        world = stack.enter_context(opened(env))
    elif demonstrations.environment is None:
        return None, "the demonstrations name no environment."
    else:
        try:
            world = make(demonstrations.environment)
        except EutreeError as error:
            return None, str(error)
        stack.callback(world.close)
    world = acting_as(world, demonstrations)
    describe(world).check_same(demonstrations.schema, "demonstrations", of="the environment")
    return world, ""


def _report(
    chosen: FittedTree,
    judged: Played | None,
    demonstrations: Demonstrations,
    found: list[FittedTree],
) -> FitReport:
    policy, person = chosen.policy, Person.of(demonstrations)
    warnings = [*about_demonstrations(demonstrations), *about_size(policy, demonstrations)]
    if judged is not None:
        found_harms = harms(judged, demonstrations)
        # Where hardly an episode ends badly, a doubt helps nobody.
        worse = about_result(person, judged.evaluation, doubts=bool(found_harms))
        warnings += worse
        warnings += [
            in_words(harm, policy, demonstrations.n_transitions)
            for harm in found_harms
            if worse or harm.holds_on
        ]
    known = demonstrations.with_history(policy.history)
    observations, actions = lessons(known)
    decided = policy.decide(observations, lesson_masks(known))
    return FitReport(
        policy=policy,
        person=person,
        played=None if judged is None else judged.evaluation,
        choice=str(chosen),
        warnings=tuple(warnings),
        n_transitions=demonstrations.n_transitions,
        training_accuracy=float((decided == actions).mean()),
        n_candidates=len(found),
        episodes_played=0,
    )


def _noted(report: FitReport, note: str) -> FitReport:
    return replace(report, warnings=(*report.warnings, note))
