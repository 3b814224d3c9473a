"""The evaluations of a run: its curve, the policy that success is kept of, and the judgement."""

from eutree.errors import InvalidArgumentError
from eutree.evaluation import CurvePoint, Evaluation
from eutree.interaction import episode_seed
from eutree.interaction.seeding import Stream
from eutree.policies import TreePolicy
from eutree.training.beginning import Arena, Evaluator
from eutree.training.handover import Duel, judge
from eutree.training.judging import Judgement, judged
from eutree.training.phases import Plan
from eutree.training.proposals import key
from eutree.training.run_state import RunState


class Evaluations:
    """Evaluates the frozen policy of a run, on the same episodes at each point of it.

    Args:
        plan: The run's seed, and whether success must not fall.
        state: Where the run stands; each evaluation is noted there.

    Attributes:
        curve: Evaluations so far.
        kept: With ``keep_success`` the policy that success must not fall from, and its successes.
        judgement: The result against the start; None before it is known.
    """

    def __init__(self, plan: Plan, state: RunState) -> None:
        self._plan = plan
        self._state = state
        self._last: tuple[tuple[bytes, int], Evaluation] | None = None
        self.curve: list[CurvePoint] = []
        self.kept: tuple[TreePolicy, int] | None = None
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
        state.move(evaluated_at=state.at.episode)
        state.note("evaluation", vars(point) | {"mean_length": evaluation.mean_length})

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
