"""Where a run acts, and its evaluations: the curve, the front, the judgement; what is proven."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from eutree.compression.playing import Ground
from eutree.compression.report import FrontEntry
from eutree.errors import InvalidArgumentError
from eutree.evaluation import CurvePoint, Evaluation
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.seeding import Stream
from eutree.learners import Learner
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from eutree.training.handover import Duel, judge
from eutree.training.judging import Judgement, judged
from eutree.training.phases import Plan, RunState, generator_of
from eutree.training.proposals import key

if TYPE_CHECKING:
    from eutree.compression.front import Front
    from eutree.proof import Certificate

EARLIER = 3  # trees of a run that smaller ones are made of: the last, and those before it
Evaluator = Callable[[TreePolicy, int], Evaluation]  # (policy, seed) -> evaluation
Player = Callable[[TreePolicy, Sequence[int], int], Evaluation]  # (policy, starts, seed)


@dataclass(frozen=True)
class Arena:
    """Where a run acts.

    Attributes:
        env: Where episodes are gathered and raced.
        evaluator: How to evaluate a frozen policy.
        play: How to play a frozen policy from some starts of an evaluation with a seed.
        ground: How to let many frozen policies play beside each other, from starts with a seed.
        return_range: Lowest and highest return of an episode; None where they are not known.
    """

    env: GuardedEnv
    evaluator: Evaluator
    play: Player
    ground: Callable[[int], Ground]
    return_range: tuple[float, float] | None = None


class ProvenFirst:
    """Which of several policies is proven to have a property.

    Args:
        environment: Where they act.
        question: The property (see :mod:`eutree.proof.properties`); the plant's own for ``""``.

    Raises:
        InvalidArgumentError: No plant is known for the environment, or the text is no property.
    """

    def __init__(self, environment: EnvironmentSpec | None, question: str) -> None:
        from eutree.proof import plant_of
        from eutree.proof.properties import parse

        plant = plant_of(environment)
        if plant is None:
            raise InvalidArgumentError(
                f"prefer_proven needs a plant, which says how states move; none is known for "
                f"{environment}"
            )
        self._plant = plant
        self._asked = parse(question or plant.question, plant.schema)

    def certificate(self, policy: TreePolicy) -> "Certificate | None":
        """Return the proof of a policy; None where it is not proven, or cannot be."""
        from eutree.proof import prove

        if not policy.features.is_identity:
            return None
        found = prove(policy, self._plant, self._asked)
        return found if found.proven else None

    def first(self, policies: Iterable[TreePolicy]) -> "tuple[int, Certificate] | None":
        """Return the number of the first policy that is proven, and its proof; None if none is."""
        for number, policy in enumerate(policies):
            found = self.certificate(policy)
            if found is not None:
                return number, found
        return None


class Evaluations:
    """Evaluates the frozen policy of a run, on the same episodes at each point of it.

    Args:
        plan: The run's seed, and whether success must not fall.
        state: Where the run stands; each evaluation is noted there.

    Attributes:
        curve: Evaluations so far.
        kept: With ``keep_success`` the policy that success must not fall from, and its successes.
        earlier: The last trees of the curve that differ, the latest last, where a front follows.
        front: What was learned and the best tree of each size; empty before it is known.
        picked: The tree of the front that meets the start; None without a front.
        judgement: The result against the start; None before it is known.
    """

    def __init__(self, plan: Plan, state: RunState) -> None:
        self._plan = plan
        self._state = state
        self._last: tuple[tuple[bytes, int], Evaluation] | None = None
        self.curve: list[CurvePoint] = []
        self.kept: tuple[TreePolicy, int] | None = None
        self.earlier: list[TreePolicy] = []
        self.front: tuple[FrontEntry, ...] = ()
        self.picked: TreePolicy | None = None
        self.judgement: Judgement | None = None

    def add(self, policy: TreePolicy, evaluator: Evaluator) -> None:
        """Evaluate what was learned: one more point of the curve."""
        state = self._state
        state.whole = True  # evaluating changes nothing of the run
        evaluation = self._evaluated(policy, Stream.EVALUATION, evaluator)
        state.whole = False
        if self._plan.keep_success:
            policy, evaluation = self._keep(policy, evaluation, evaluator)
        point = CurvePoint(
            episode=state.at.episode,
            steps=state.num_timesteps,
            success_rate=evaluation.success_rate,
            mean_return=evaluation.mean_return,
            n_leaves=policy.n_leaves,
        )
        self.curve.append(point)
        self._remember(policy)
        state.move(evaluated_at=state.at.episode)
        state.note("evaluation", vars(point) | {"mean_length": evaluation.mean_length})

    def make_front(
        self,
        learned: TreePolicy,
        first: TreePolicy,
        learner: Learner,
        arena: Arena,
        keeping: Callable[[TreePolicy], TreePolicy],
    ) -> None:
        """Find the best tree of each size, and pick one; neither where steps are too few.

        ``keeping`` makes trees keep the run's rules.
        """
        from eutree.training.front import Extent, front_of_run

        plan, at, state = self._plan, self._state.at, self._state
        state.whole = True
        extent = None
        ground = arena.ground(plan.seed)
        if plan.handover is not None:
            steps = plan.handover.steps_of_front(at.steps, side_by_side=ground.side_by_side)
            extent = Extent.of(steps, at.steps, at.episode)
        if plan.handover is not None and extent is not None:
            found = front_of_run(
                [learned, *reversed(self.earlier)],
                first,
                learner,
                ground,
                extent,
                keeping,
                max_leaves=plan.handover.max_leaves,
                generator=generator_of(plan.seed, Stream.FRONT, 0),
            )
            self.front, self.picked = found.entries, self._preferred(found, arena)
        state.whole = False
        state.move(fronted=True, front_steps=ground.steps)
        if self.front and self.picked is not None:
            entries = [one.facts() for one in self.front]
            state.note("front", {"front": entries, "picked": self.picked.n_leaves})

    def _proven(self, arena: Arena) -> ProvenFirst | None:
        """Return what tells proven trees from others, where they are preferred."""
        handover = self._plan.handover
        question = None if handover is None else handover.prefer_proven
        return None if question is None else ProvenFirst(arena.env.spec, question)

    def _preferred(self, found: "Front", arena: Arena) -> TreePolicy | None:
        """Return the pick or, where proven trees are preferred, the best of those, if any is."""
        proven, picked = self._proven(arena), found.picked
        if proven is None or picked is None or self._plan.handover is None:
            return picked
        others = sorted(found.entries[1:], key=lambda one: -one.mean_return)
        most = self._plan.handover.max_leaves
        fit = [one.policy for one in others if most is None or one.policy.n_leaves <= most]
        trees = [picked, *fit]
        first = proven.first(trees)
        return picked if first is None else trees[first[0]]

    def _remember(self, policy: TreePolicy) -> None:
        """Keep the last few trees that differ: smaller ones are made of them at the end."""
        handover = self._plan.handover
        if handover is None or not handover.has_front:
            return
        if not self.earlier or key(self.earlier[-1]) != key(policy):
            self.earlier = [*self.earlier, policy][-EARLIER:]

    def judge(self, first: TreePolicy, policy: TreePolicy, challengers: int, arena: Arena) -> None:
        """Decide whether the result or the start is handed over, on episodes that chose nothing."""
        self._state.whole = True
        if key(policy) == key(first):
            judgement = Judgement.same(challengers=challengers)
        elif (handover := self._plan.handover) is None:
            pair = (
                self._evaluated(one, Stream.JUDGING, arena.evaluator) for one in (first, policy)
            )
            judgement = judged(*pair, challengers=challengers)
        else:
            at, seed = self._state.at, episode_seed(self._plan.seed, 0, Stream.JUDGING)
            duel = Duel(
                first,
                policy,
                lambda tree, starts: arena.play(tree, starts, seed),
                most=handover.pairs(at.episode),
                steps=handover.steps(at.steps + at.racing_steps),
            )
            sizes = first.n_leaves, policy.n_leaves
            known = arena.return_range
            judgement = judge(handover, duel, sizes, known=known, challengers=challengers)
            proven = self._proven(arena)
            if proven is not None:
                sure = tuple(proven.certificate(one) is not None for one in (first, policy))
                judgement = judgement.of_proven(*sure)
        self._state.whole = False
        self.judgement = judgement
        self._state.move(judged=True)
        self._state.note("judgement", judgement.facts())

    def _keep(
        self, policy: TreePolicy, evaluation: Evaluation, evaluator: Evaluator
    ) -> tuple[TreePolicy, Evaluation]:
        """Return the policy if it succeeds as often as the kept one, in the same episodes."""
        count = None if evaluation.successes is None else int(evaluation.successes.sum())
        if count is None:
            raise InvalidArgumentError(
                "keep_success needs an environment that reports success (info['is_success'])"
            )
        if self.kept is not None and count < self.kept[1]:
            refused = {"successes": self.kept[1], "successes_refused": count}
            self._state.note("kept", refused)
            return self.kept[0], self._evaluated(self.kept[0], Stream.EVALUATION, evaluator)
        self.kept = policy, count
        return policy, evaluation

    def _evaluated(self, policy: TreePolicy, stream: int, evaluator: Evaluator) -> Evaluation:
        """Evaluate a policy; the one that was evaluated last needs no other run of its episodes."""
        asked = key(policy), stream
        if self._last is None or self._last[0] != asked:
            self._last = asked, evaluator(policy, episode_seed(self._plan.seed, 0, stream))
        return self._last[1]
