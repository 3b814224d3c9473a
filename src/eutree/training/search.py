"""Policy search with racing: many challengers, none to be trusted, and real episodes that decide.

Several world models, none of which need be right, each propose improved or smaller trees, C4.5
proposes prunings, and the incumbent is changed at random. All of them have to prove themselves in
episodes that start as the incumbent's do; one replaces it only if it earns more by a standard
error, or is smaller and does as well. All steps are counted, and an episode begins only if the
budget allows for the longest. Where there are steps to spare, small changes climb in the models,
trees of the episodes that earned most are begun from, and tests are long.

The search has no environment: ``next_run`` says which tree to run from which start, and ``take``
takes the episode. It goes through stages; between two of them it can be stored, and
episodes since the last are taken up again from the stored ones, so a kill costs one episode.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eutree.compression.smaller_trees import merged, with_locks
from eutree.contests import Ahead, Halving
from eutree.data import Episode
from eutree.interaction.episode import Stream
from eutree.policies import TreePolicy
from eutree.policy_search.improvement import MOST_LEAVES
from eutree.training.proposals import (
    PROMISING,
    Advantages,
    Proposals,
    SearchSettings,
    key,
)
from eutree.training.raced_episodes import Block, RacedEpisodes, Running
from eutree.world_model import Transitions

ROUNDS = 3  # of proposals, at most
ROUND_SHARE = 0.25  # of the steps, for a round
NEWS = 0.05  # share of steps after which they are fitted anew
FIRST_EPISODES = 4  # of the incumbent, in which a variant has to make a difference
MOST_EPISODES = 64  # of a race of many
KNOWING, MOST_KNOWING = 0.1, 16  # share of a race's steps, and episodes, by which models are chosen
OF_ONE_ERRORS, OF_MANY_ERRORS = 1.0, 2.0  # standard errors that win: of one challenger, of many
CLIMBS, MOST_OF_CLIMBED = 2, 256  # rounds in which trees climb, at most; episodes of their race
TELLING = 64  # episodes of the incumbent that tell which model is closest
LONG, LONG_OF_MANY = (128, 256, 512), (4, 8, 16, 128, 256)  # looks of a long test; of one of many
PATIENT = (32, 64)  # looks of a test that nobody loses by the first few pairs
IDLE = 100  # of those tried, without a step: nothing is left to vary
STAGES = ("begin", "cut", "propose", "climb", "race", "prove", "vary", "end")


@dataclass(frozen=True)
class SearchState:
    """Where a search stood between two stages.

    Attributes:
        stage: The stage that comes next.
        incumbent: The best tree so far.
        challengers: Those that are to run next.
        round: Rounds of proposals so far; those in which trees climb begin above ``ROUNDS``.
        block: Number of the present block of starts.
        limit: Steps that may be run until the end of the stage.
        tried: Challengers so far.
        won: How often one replaced the incumbent.
        idle: Variants since a step was last run.
        n_episodes: Episodes run so far.
        own: Numbers of the incumbent's episodes of the present block.
        fitted: Steps run, episodes run and chance when the advantages were fitted last.
        chance: State of the generator.
    """

    stage: str
    incumbent: TreePolicy
    challengers: tuple[TreePolicy, ...] = ()
    round: int = 0
    block: int = 0
    limit: int = 0
    tried: int = 0
    won: int = 0
    idle: int = 0
    n_episodes: int = 0
    own: tuple[int, ...] = ()
    fitted: tuple[int, int, dict[str, Any]] | None = None
    chance: dict[str, Any] | None = None

    @property
    def climbs(self) -> bool:
        """Whether this is a round of climbing."""
        return self.round > ROUNDS

    @property
    def starts(self) -> Block:
        """The present block of starts."""
        return Block(self.block, self.limit)

    def on_new_starts(
        self, stage: str, limit: int, challengers: tuple[TreePolicy, ...] = ()
    ) -> "SearchState":
        """Return the state before a stage on the next block of starts."""
        block = self.block + 1
        return replace(self, stage=stage, challengers=challengers, block=block, limit=limit)


class PolicySearch:
    """One search.

    Args:
        policy: Where it starts. Its locked leaves stay as they are.
        data: The transitions stored in learning, with at least one episode.
        settings: Its length, and its aim.
        seed: Seed of all its chance but the episodes'.
        max_episode_steps: Steps after which the environment truncates; None if it never does.

    Attributes:
        state: Where it stood between the last two stages.
        raced: All episodes run.
        finished: Whether nothing is left to run.
    """

    def __init__(
        self,
        policy: TreePolicy,
        data: Transitions,
        settings: SearchSettings,
        *,
        seed: int,
        max_episode_steps: int | None,
    ) -> None:
        self._settings = settings
        self._start = policy
        longest = data.longest() if max_episode_steps is None else max_episode_steps
        self.raced = RacedEpisodes(longest, grows=max_episode_steps is None)
        self._generator = np.random.default_rng(np.random.SeedSequence((seed, Stream.PROPOSING)))
        self._proposals = Proposals(policy, data, settings, self._generator)
        self._max_leaves = self._proposals.max_leaves
        self._spared = 2 * LONG[-1] * data.mean_length  # steps of a long test to its end
        self._patience = 2 * PATIENT[-1] * data.mean_length  # those of a patient one
        self.state = SearchState("begin", policy)
        self._known: Advantages | None = None
        self._stages = self._go_on()
        self._next: tuple[TreePolicy, int] | None = None
        self._answer: Episode | None = None
        self.finished = settings.steps == 0

    @property
    def incumbent(self) -> TreePolicy:
        """The best tree so far."""
        return self.state.incumbent

    @property
    def result(self) -> TreePolicy:
        """The incumbent; while a too large one was not raced yet, its largest pruning allowed."""
        policy = self.incumbent
        if policy.n_leaves <= self._max_leaves:
            return policy
        smaller = self._proposals.pruned(with_locks(merged(policy), self._start))
        return max(smaller, key=lambda tree: tree.n_leaves, default=policy)

    @property
    def all_episodes(self) -> list[Episode]:
        """All episodes run, the one just taken and those yet to be taken up again included."""
        taken = [] if self._answer is None else [self._answer]
        return [*self.raced.all, *taken, *self.raced.stored]

    def next_run(self) -> tuple[TreePolicy, int] | None:
        """Return the tree to run next, and the number of its start; None at the end."""
        if self.finished or self._next is not None:
            return self._next
        try:
            # A generator that has not begun is sent None.
            answer, self._answer = self._answer, None
            self._next = self._stages.send(answer)  # type: ignore[arg-type]  # as said
        except StopIteration:
            self.finished = True
        return self._next

    def take(self, episode: Episode) -> None:
        """Take the episode that the tree of ``next_run`` ran."""
        self._next, self._answer = None, episode

    def restore(self, state: SearchState, episodes: Sequence[Episode]) -> None:
        """Go on, from the start, where another search of the same arguments stood."""
        self.raced.take_back(episodes, state.n_episodes, state.incumbent, state.own)
        if state.fitted is not None:
            chance = np.random.default_rng()
            chance.bit_generator.state = state.fitted[2]
            self._known = self._proposals.advantages(self.raced.all[: state.fitted[1]], chance)
        if state.chance is not None:
            self._generator.bit_generator.state = state.chance
        self.state = state

    def _go_on(self) -> Running[None]:
        """Go through the stages; ``state`` changes at the end of each."""
        stages: dict[str, Callable[[SearchState], Running[SearchState]]] = {
            "begin": self._begin,
            "cut": self._cut,
            "propose": self._propose,
            "climb": self._climb,
            "race": self._race,
            "prove": self._prove,
            "vary": self._vary,
        }
        while self.state.stage != "end":
            state = yield from stages[self.state.stage](self.state)
            self.state = replace(
                state,
                n_episodes=len(self.raced.all),
                own=self.raced.own(state.incumbent),
                chance=deepcopy(dict(self._generator.bit_generator.state)),
            )

    def _begin(self, state: SearchState) -> Running[SearchState]:
        """Find smaller trees if the policy is too large."""
        policy = with_locks(merged(self._start), self._start)
        here = replace(state, stage="propose", incumbent=policy)
        if policy.n_leaves <= self._max_leaves:
            return here
        challengers = self._proposals.pruned(policy)
        if policy.n_leaves <= MOST_LEAVES:
            challengers = [*self._proposals.planned(policy, self.raced.all), *challengers]
            n = _knowing(int(2 * ROUND_SHARE * self._settings.steps), self.raced.longest)
            here = here.on_new_starts("propose", self._settings.steps)
            own = yield from self.raced.of(policy, range(n), here.starts)
            if own is not None:
                challengers += self._proposals.cut_together(policy, own, self.raced.all)
        return self._with_challengers(here, "cut", challengers, 2 * ROUND_SHARE)

    def _cut(self, state: SearchState) -> Running[SearchState]:
        """Take the winner of the smaller trees, whatever it earns."""
        winner = yield from self._winner(state)
        return replace(state, stage="propose", incumbent=winner, challengers=())

    def _propose(self, state: SearchState) -> Running[SearchState]:
        """Let each model propose, and C4.5 prune."""
        challengers = list(self._proposals.planned(state.incumbent, self.raced.all))
        if state.round == 0:
            challengers += self._proposals.pruned(state.incumbent)
        yield from ()
        proposed = self._with_challengers(state, "race", challengers, ROUND_SHARE)
        return self._after_rounds(state) if proposed is state else proposed

    def _climb(self, state: SearchState) -> Running[SearchState]:
        """Let many small changes be tried in a model, and other trees begun from."""
        policy = state.incumbent
        own = yield from self.raced.of(policy, range(TELLING), state.starts)
        if own is None:
            return self._after_rounds(state, climbs=False)
        challengers = list(self._proposals.climbed(policy, own, self.raced.all))
        climbing = replace(state, round=max(state.round, ROUNDS) + 1)
        proposed = self._with_challengers(climbing, "race", challengers, ROUND_SHARE)
        return self._after_rounds(state, climbs=False) if proposed is climbing else proposed

    def _race(self, state: SearchState) -> Running[SearchState]:
        """Find the best of the proposed."""
        winner = yield from self._winner(state)
        self.raced.leave_block()
        steps, left = self._settings.steps, self._settings.steps - self.raced.steps
        if state.round == 0 and self._patience > ROUND_SHARE * steps and self._spared > left:
            steps -= left // 2  # for what the models propose once it is lost
        return state.on_new_starts("prove", steps, (winner,))

    def _prove(self, state: SearchState) -> Running[SearchState]:
        """Let it replace the incumbent if it earns clearly more on other starts."""
        policy, challenger = state.incumbent, state.challengers[0]
        better = yield from self._better(state, challenger, errors=OF_ONE_ERRORS)
        if better is None:
            better = self._proposals.prefer(policy, challenger, self.raced.all)
        n = state.round if state.climbs else state.round + 1
        if not better:
            if n < ROUNDS and not state.won:  # where it was run the models were wrong
                self.raced.leave_block()
                return replace(state, stage="propose", challengers=(), round=n)
            return self._after_rounds(state, climbs=not state.climbs)
        won = replace(state, incumbent=challenger, won=state.won + 1, round=n)
        if n >= ROUNDS:
            return self._after_rounds(won)
        return replace(won, stage="propose", challengers=())

    def _after_rounds(self, state: SearchState, *, climbs: bool = True) -> SearchState:
        """Climb where there are steps for long tests, else vary."""
        steps = self._settings.steps
        self.raced.leave_block()
        if climbs and self._spared <= steps - self.raced.steps and state.round < ROUNDS + CLIMBS:
            return state.on_new_starts("climb", steps)
        return replace(state, fitted=self._fit_advantages()).on_new_starts("vary", steps)

    def _vary(self, state: SearchState) -> Running[SearchState]:
        """Try one random change of the incumbent, the most promising of several."""
        policy = state.incumbent
        own = None
        if state.idle < IDLE:
            own = yield from self.raced.of(policy, range(FIRST_EPISODES), state.starts)
        if own is None or state.fitted is None or self._known is None:
            return replace(state, stage="end")
        if self.raced.steps > state.fitted[0] + NEWS * self._settings.steps:
            state = replace(state, fitted=self._fit_advantages())
        steps, state = self.raced.steps, replace(state, idle=state.idle + 1)
        challenger = self._proposals.promising(policy, own, self._known)
        if challenger is None:
            return state
        state = replace(state, tried=state.tried + 1)
        better = yield from self._better(state, challenger, errors=OF_MANY_ERRORS)
        idle = 0 if self.raced.steps > steps else state.idle
        if not better:
            self.raced.drop(challenger)
            return replace(state, idle=idle)
        self.raced.leave_block()
        won, block = state.won + 1, state.block + 1
        return replace(state, idle=idle, incumbent=challenger, won=won, block=block)

    def _with_challengers(
        self, state: SearchState, stage: str, challengers: Sequence[TreePolicy], share: float
    ) -> SearchState:
        """Return the state before a race of those that differ, for a share of the steps."""
        distinct = {key(one): one for one in challengers if one.n_leaves <= self._max_leaves}
        distinct.pop(key(state.incumbent), None)
        if not distinct:
            return state
        self.raced.leave_block()
        limit = min(self._settings.steps, self.raced.steps + int(share * self._settings.steps))
        here = state.on_new_starts(stage, limit, tuple(distinct.values()))
        return replace(here, tried=state.tried + len(distinct))

    def _winner(self, state: SearchState) -> Running[TreePolicy]:
        """Return the best of the challengers; only the most promising of them run.

        World models that foretell the incumbent's return say which these are. All run where
        trees climb.
        """
        trees, length = state.challengers, self.raced.longest
        guesses: tuple[float, ...] = ()
        most = MOST_OF_CLIMBED if state.climbs else MOST_EPISODES
        n, own = _knowing(state.limit - self.raced.steps, self.raced.longest), None
        if len(trees) > PROMISING:
            own = yield from self.raced.of(state.incumbent, range(n), state.starts)
        if own is not None:
            length = sum(map(len, own)) // n
            if not state.climbs:  # then there are steps for all of them
                known = self.raced.all
                trees, guesses = self._proposals.guessed(state.incumbent, own, trees, known)
        affordable = (state.limit - self.raced.steps) // (2 * length * len(trees))
        first = int(np.clip(affordable, 1, most // 2))
        prices = self._proposals.prices(trees)
        rule = Halving(first=first, most=most, prices=prices, guesses=guesses)
        verdict = yield from self.raced.hold(rule, state.starts, trees)
        return trees[verdict.winner]

    def _better(
        self, state: SearchState, challenger: TreePolicy, *, errors: float
    ) -> Running[bool | None]:
        """Return whether a challenger is ahead, and succeeds as often if it must.

        None if it is so far, and the budget is too small to be sure.
        """
        trees = (state.incumbent, challenger)
        known = self._proposals.range_seen(self.raced.returns)
        rule = Ahead(errors=errors, final=errors, prices=self._proposals.prices(trees), known=known)
        if state.stage == "prove" and self._spared <= state.limit - self.raced.steps:
            rule = replace(rule, looks=LONG, patient=True, rare_losses=False)
        elif state.stage == "prove" and self._patience <= ROUND_SHARE * self._settings.steps:
            rule = replace(rule, looks=PATIENT, patient=True)
        elif state.climbs:
            rule = replace(rule, looks=LONG_OF_MANY)
        verdict = yield from self.raced.hold(rule, state.starts, trees)
        if not verdict.winner:
            return False
        if self._settings.keep_success and self.raced.succeeds_less(*trees):
            return False
        return True if verdict.shown else None

    def _fit_advantages(self) -> tuple[int, int, dict[str, Any]]:
        """Fit the gains of recorded steps; return all it takes to fit the same again."""
        chance = deepcopy(dict(self._generator.bit_generator.state))
        self._known = self._proposals.advantages(self.raced.all, self._generator)
        return self.raced.steps, len(self.raced.all), chance


def _knowing(steps: int, longest: int) -> int:
    """Return how many episodes of a race of so many steps tell which model to believe."""
    return int(np.clip(KNOWING * steps // longest, 2, MOST_KNOWING))
