"""A run: its state between two phases, and the step from one to the next.

All that is random in an episode, an update or a race follows from the run's seed and a number, so
a run can go on from any boundary with nothing but its learner and its position. Events
record the past; they never decide the next step.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from eutree.arrays import Booleans, Floats, plain
from eutree.compression.smaller_trees import merged
from eutree.errors import InvalidArgumentError
from eutree.evaluation import CurvePoint
from eutree.interaction.episode import Stream
from eutree.learners import Decisions, History, Learner, Method, Problem, Start, Update
from eutree.learners.episode_buffer import transitions_of
from eutree.learners.learner import GIVEN, KnowsItsModel, TriesTrees, check_has_all, own_code
from eutree.policies import TreePolicy
from eutree.policies.reach import among_allowed, ever_allowed, within_kinds, within_reach
from eutree.policy_search.model_trust import ModelTrust
from eutree.training.acting import Racing, gather
from eutree.training.evaluations import Arena, Evaluations
from eutree.training.handover import START
from eutree.training.phases import Follower, Phase, Plan, Position, RunState, due, generator_of
from eutree.training.progress import GatheredEpisodes
from eutree.training.proposals import identity
from eutree.training.search import PolicySearch
from eutree.validation import check_kind
from eutree.world_model.transitions import seen_as


@dataclass(frozen=True, eq=False)
class Beginning:
    """The beginning of a run: its method, its problem, and its start.

    Attributes:
        method: How is learned.
        problem: The task.
        start: Where learning begins.
        reason: Why this method, where nobody named one; else "".
    """

    method: Method
    problem: Problem
    start: Start
    reason: str = ""

    def learner(self) -> Learner:
        """Return the learner at its start, which has all that a learner has."""
        with own_code(self.method):
            learner = self.method.start(self.problem, self.start)
        check_has_all(learner, Learner, type(self.method))
        return learner


class Run:
    """A run in progress.

    Args:
        beginning: Its method, its problem, and its start.
        plan: How long it is, and when it does each thing.
        arena: Where it acts; None for recorded episodes alone.
        listeners: Who is told of each step, and may end the run at its last finished episode.

    Attributes:
        beginning: Its method, its problem, and its start.
        arena: Where it acts.
        learner: The learner.
        plan: How long the run is.
        state: Where it stands, its events so far, and who follows it.
        phase: The one under way, or the last.
        gathered: Return, length and success of each episode so far.
        evaluations: The curve, and the result against the start.
        racing: The race at the end.
        first: The policy that it began with.
    """

    def __init__(
        self,
        beginning: Beginning,
        plan: Plan,
        arena: Arena | None,
        *,
        listeners: Sequence[Follower] = (),
    ) -> None:
        self.beginning = beginning
        self.arena = arena
        self.learner = beginning.learner()
        self.plan = plan
        self.state = RunState(listeners)
        self.phase = Phase.GATHER
        self.gathered = GatheredEpisodes()
        self.evaluations = Evaluations(plan, self.state)
        self.racing = Racing(plan, self.state)
        self._clock = time.monotonic()
        # What is handed over is evaluated, compressed and shown where it was to act, start or not:
        # the expert tree may be another environment's.
        expert, environment = beginning.start.expert, beginning.problem.environment
        if expert is not None and environment not in (None, expert.environment):
            expert = replace(expert, environment=environment)
        self.first = self.keeping(expert or self.policy())

    @property
    def at(self) -> Position:
        """Where the run stands between two phases."""
        return self.state.at

    @property
    def episode(self) -> int:
        """Episodes gathered so far."""
        return self.at.episode

    @property
    def curve(self) -> list[CurvePoint]:
        """Evaluations so far."""
        return self.evaluations.curve

    @property
    def challengers(self) -> int:
        """Trees that were put to the test so far, by the learner or in the race."""
        return self.at.challengers + self.racing.challengers

    @property
    def finished(self) -> bool:
        """Whether everything that the plan asks for happened; or the run was stopped."""
        return self.state.stopped or self._due() is None

    def advance(self) -> None:
        """Go through the phase that is due: one episode, one update, one evaluation.

        Raises:
            EnvironmentFault: The environment broke its contract; the learner is as it was before
                the episode.
        """
        if self.state.must_stop():
            return
        phase = self._due()
        if phase is None:
            return
        self.phase, self.state.whole = phase, False
        match phase:
            case Phase.GATHER:
                self._gather()
            case Phase.UPDATE:
                self._update()
            case Phase.EVALUATE:
                self.evaluations.add(self._best(), self._acting())
            case Phase.RACE:
                self.racing.run(self.racing.search or self.new_search(), self._acting().env)
            case Phase.FRONT | Phase.JUDGE:
                self._end()
        self.state.whole = True
        self._take_time()

    def model_trust(self) -> ModelTrust | None:
        """Return how the learner's world model orders trees; None where it has none, or no idea."""
        learner = self.learner
        return learner.model_trust() if isinstance(learner, KnowsItsModel) else None

    def policy(self) -> TreePolicy:
        """Return the policy to hand over: the present one, unless the start is preferred to it."""
        judgement = self.evaluations.judgement
        if self.at.judged and judgement is not None and judgement.handed_over == START:
            return self.first
        return self.challenger() if self.at.judged else self.evaluations.picked or self.learned()

    def challenger(self) -> TreePolicy:
        """Return the tree that meets the start: the pick at the end, else the learned one.

        Where that is the start still, it is the one on trial, if any: the contest is fresh.
        """
        if self.evaluations.picked is not None:
            return self.evaluations.picked
        tree = self.learned()
        return (_on_trial(self) or tree) if identity(tree) == identity(self.first) else tree

    def learned(self) -> TreePolicy:
        """Return the present policy, frozen."""
        if self.racing.search is not None:
            return self.keeping(self.racing.search.incumbent)
        kept = self.evaluations.kept
        return self._best() if kept is None else kept[0]

    def new_search(self) -> PolicySearch:
        """Return the policy search at its start: from the present policy and all that is stored."""
        if self.plan.race is None:
            raise InvalidArgumentError("race_steps must be above 0 to race, got 0")
        policy = self.policy()
        known = transitions_of(self.learner.history, policy.schema.n_actions)
        return PolicySearch(
            policy,
            seen_as(policy.derivation, known),
            replace(self.plan.race, keep_success=self.plan.keep_success),
            seed=self.plan.seed,
            max_episode_steps=self.beginning.problem.max_episode_steps,
        )

    def keeping(self, policy: TreePolicy) -> TreePolicy:
        """Return a policy that keeps the plan's monotone rules, by actions that masks allowed."""
        if not self.plan.monotone:
            return policy
        from eutree.inspection import keep_monotone, monotone_rules

        rules = monotone_rules(self.plan.monotone, policy.schema)  # it may remember more than seen
        known = _masked(policy, self.learner.history)
        allowed = None if known is None else ever_allowed(policy, *known)
        return keep_monotone(policy, rules, allowed=allowed)

    def _best(self, tried: Decisions | None = None) -> TreePolicy:
        """Return the race's result or, before that, the learned policy; else that on trial."""
        if tried is None and self.racing.result is not None:
            return within_kinds(self.keeping(self.racing.result))
        policy = (tried or self.learner.decisions()).policy(self.beginning.problem)
        if (known := _masked(policy, self.learner.history)) is not None:
            policy = merged(among_allowed(policy, *known))
        policy = within_kinds(self.keeping(policy))
        seen = policy.derivation.behind(self.learner.history.observations)
        features = policy.schema.features
        if len(seen) == 0 or seen.shape[1] != len(features):
            return policy
        low = np.minimum([feature.low for feature in features], seen.min(axis=0))
        high = np.maximum([feature.high for feature in features], seen.max(axis=0))
        return within_reach(policy, low, high)

    def _due(self) -> Phase | None:
        return due(
            self.plan,
            self.at,
            gathering_episodes=self.beginning.method.gathering_episodes,
            gathering_steps=getattr(self.beginning.method, "gathering_steps", None),
            max_episode_steps=self.beginning.problem.max_episode_steps,
        )

    def _take_time(self) -> None:
        """Count the seconds of the clock, if they are a budget."""
        now = time.monotonic()
        if self.plan.seconds is not None:
            self.state.move(seconds=self.at.seconds + now - self._clock)
        self._clock = now

    def _acting(self) -> Arena:
        if self.arena is None:
            raise InvalidArgumentError("env must be given to act in, got None")
        return self.arena

    def _gather(self) -> None:
        """Let the learner act for one episode (Table 1, data gathering phase)."""
        self.state.gathering_begins()
        gather(
            self.learner,
            self._acting().env,
            self.state,
            self.gathered,
            seed=self.plan.seed,
            number=self.at.episode,
            room=self.plan.room(self.at),
        )
        if not self.at.judged:
            self.evaluations.begin_again()

    def _update(self) -> None:
        """Let the learner learn from its history, and note the splits that it made."""
        state, at = self.state, self.at
        state.gathering_ends()
        number = at.episode if self.plan.gathers else at.updates
        generator = generator_of(self.plan.seed, Stream.EXPANSION, number)
        update = check_kind("the answer of update", self.learner.update(generator), Update)
        splits = [
            {"leaf": split.leaf, "feature": split.feature, "threshold": split.threshold}
            for split in update.splits
        ]
        figures = plain(dict(update.figures))
        tried = figures.get("challengers")
        state.move(
            updates=at.updates + 1,
            updated_at=at.episode,
            updated_steps=at.steps,
            settled=not splits,
            challengers=at.challengers + (tried if isinstance(tried, int) else 0),
        )
        n_leaves = self.learner.decisions().tree.n_leaves
        state.note("expansion", {"splits": splits, "n_leaves": n_leaves, **figures})

    def _end(self) -> None:
        """Find the best tree of each size, and pick one; or compare the pick with the start."""
        first, arena = self.first, self._acting()
        if self.phase is Phase.FRONT:
            known = self.learned(), first, self.learner, arena
            self.evaluations.make_front(*known, self.keeping, _on_trial(self))
        else:
            given, tree = self.beginning.start.name in GIVEN, self.challenger()
            seen = partial(_own_returns, self.learner.history)
            self.evaluations.judge(
                first, tree, self.challengers, arena, given=given, tried=_on_trial(self), seen=seen
            )


def _on_trial(run: Run) -> TreePolicy | None:
    """Return the tree whose evaluation the end of a run has cut short, if it may be handed over.

    A race has its own.
    """
    handover, learner = run.plan.handover, run.learner
    if handover is None or run.racing.search is not None or not isinstance(learner, TriesTrees):
        return None
    tried = learner.on_trial()
    tree = None if tried is None else run._best(tried)
    too_large = tree is not None and tree.n_leaves > (handover.max_leaves or tree.n_leaves)
    return None if too_large else tree


def _own_returns(history: History, *trees: TreePolicy) -> tuple[float, float] | None:
    """Return the lowest and highest return of stored episodes in which one of the trees acts.

    They are its own, whoever played them: each action is the tree's. Those that were shown, in a
    world that may reward otherwise, were cut short, or of which steps are forgotten, are left out;
    None if there are no others.
    """
    if not history.size or history.forgetting is not None:
        return None
    found, known = np.empty(0), transitions_of(history, trees[0].schema.n_actions)
    fit = ~known.stopped & ~history.demonstrated[known.first]
    for one in trees:
        rows = one.derivation.behind(known.observations)
        if rows.shape[1] == one.tree.n_features:
            others = one.decide(rows, known.allowed) != known.actions
            own = np.add.reduceat(others, np.flatnonzero(known.first), dtype=np.int64) == 0
            found = np.append(found, known.episode_returns[own & fit])
    return (float(found.min()), float(found.max())) if found.size else None


def _masked(policy: TreePolicy, history: History) -> tuple[Floats, Booleans] | None:
    """Return where actions were masked and which were allowed; None where none was."""
    allowed = history.columns.get("allowed")
    if allowed is None:
        return None
    seen = policy.derivation.behind(history.observations)
    return (seen, allowed) if seen.shape[1] == policy.tree.n_features else None
