"""The result of a learning run."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from eutree.compression.episodes import FrontEntry
from eutree.display import Displayed, counted
from eutree.evaluation import Against, CurvePoint
from eutree.evaluation.curves import curve_to_pandas
from eutree.learners import History, Method
from eutree.learners.learner import HasTeacher, ValuingPolicy
from eutree.policies import TreePolicy
from eutree.policy_search.model_trust import ModelTrust
from eutree.training.handover import LEARNED, START, Judgement
from eutree.training.proposals import identity
from eutree.training.run import Run
from eutree.training.teaching import Teacher

if TYPE_CHECKING:
    from eutree.evaluation.off_policy import OffPolicyComparison
    from eutree.proof import Certificate


@dataclass(frozen=True)
class StepCounts:
    """Environment steps by their purpose.

    Attributes:
        demonstrations: Recorded before the run.
        teacher: Taken by a teacher in the run: one who was asked, or whom the trees copy, such as
            the network of ``distilled-dqn`` while it learned.
        learning: Taken by the learner's trees.
        racing: Taken by trees that raced.
        front: Taken at the end by the best trees of each size; without a front by one on trial.
        judging: Taken at the end by the start and the learned tree, of which one is handed over,
            but for those that evaluations had taken before.
        declared: Those in which a teacher of your own was trained before, by its word or yours.
            They are no part of ``total``.
        evaluation: Taken by frozen evaluations along the way, and of a method that hands over what
            it learned beside its start: they decide nothing but, where steps are dear, also which
            of the two is handed over. They are no part of ``total``.
    """

    demonstrations: int = 0
    teacher: int = 0
    learning: int = 0
    racing: int = 0
    front: int = 0
    judging: int = 0
    declared: int = 0
    evaluation: int = 0

    @property
    def total(self) -> int:
        """All of the run and of the demonstrations."""
        before = self.demonstrations + self.teacher + self.learning + self.racing
        return before + self.front + self.judging


@dataclass(frozen=True, eq=False)
class LearningResult(Displayed):
    """A finished learning run.

    Attributes:
        policy: The policy that is handed over: the pick of the front, or the learned tree where
            there is no front, or a tree still on trial where this is the start; or the start where
            it was not shown that this one is better, or smaller and no worse.
        learned: The policy that was learned, also where another is handed over.
        first: The policy that it began with.
        expert: The expert tree it started from; None where it started from none.
        curve: Frozen evaluations along the way, the first before any learning.
        history: All stored transitions.
        method: How it learned.
        start: Where it began: "nothing", "tree", "tree+demos", "demos" or "random-tree".
        episodes: Episodes of experience, without those of evaluations.
        steps: Environment steps of experience, without those of evaluations and racing.
        environment_steps: Environment steps by their purpose.
        evaluation_episodes: Episodes that frozen trees played beside those of experience: in
            evaluations along the way, in the front, and in the judgement.
        challengers: Trees that were put to the test.
        against_start: How the learned tree did against the start, which of them is handed over and
            why; None offline, where the run stopped, and where nothing may be judged.
        front: The learned tree, and the best of each size that was made of it, the largest
            first, all in the same episodes, which chose none of them; empty without a front.
        picked: The tree of the front that met the start; without a front the one that was on trial
            at the end, where that met it. None where the learned one did.
        against: The policy's episodes and those of the rival that ``Handover`` names.
        certificate: The proof of the policy, where proven trees are preferred and it is one.
        against_fit: Offline, the learned tree beside that of ``fit`` on held-out episodes; that of
            ``fit`` is the policy unless the learned tree is believed to beat it.
        teacher: Who taught, where the method has a teacher: a policy with ``action_values``, for
            ``distill`` for example.
        model_trust: How the world model orders the trees that were really run, where the method
            compares both.
        reason: Why this method learned, where none was named; else "".
    """

    policy: TreePolicy
    learned: TreePolicy
    first: TreePolicy
    expert: TreePolicy | None
    curve: tuple[CurvePoint, ...]
    history: History
    method: Method
    start: str
    episodes: int
    steps: int
    environment_steps: StepCounts
    evaluation_episodes: int = 0
    challengers: int = 0
    against_start: Judgement | None = None
    front: tuple[FrontEntry, ...] = ()
    picked: TreePolicy | None = None
    against: Against | None = None
    certificate: "Certificate | None" = None
    against_fit: "OffPolicyComparison | None" = None
    teacher: ValuingPolicy | None = None
    model_trust: ModelTrust | None = None
    reason: str = ""

    @property
    def is_start(self) -> bool:
        """Whether ``policy`` is the one that it began with, or decides as that one does."""
        judgement = self.against_start
        return judgement is not None and (judgement.is_start or judgement.handed_over == START)

    @property
    def handed_over(self) -> Literal["learned", "start"]:
        """Which tree ``policy`` is; offline the start is the tree of ``fit``."""
        if self.against_fit is not None and not self.against_fit.believed:
            return START
        return LEARNED if self.against_start is None else self.against_start.handed_over

    def __repr__(self) -> str:
        """Return the result in one line; the stored transitions would be pages."""
        learned = f"learned: {self.curve[-1].describe()}; " if self.curve else ""
        policy = f"handed over: {self.handed_over}, {counted(self.policy.n_leaves, 'leaf')}"
        run = (
            f"{counted(self.episodes, 'episode')}, {counted(self.steps, 'step')}; {learned}{policy}"
        )
        return f"<LearningResult: {self.method.name} from {self.start}, {run}>"

    def to_pandas(self) -> Any:
        """Return the learning curve as a data frame, a row for each frozen evaluation.

        Its index is the episode; columns: steps, success_rate, mean_return, n_leaves.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        return curve_to_pandas(self.curve)


def picked_of(run: Run) -> TreePolicy | None:
    """Return the pick of a run's front, else the tree on trial if that met the start."""
    met = run.challenger() if run.at.judged else run.evaluations.picked
    is_learned = met is None or identity(met) == identity(run.learned())
    return None if run.evaluations.picked is None and is_learned else met


def result_of(run: Run, policy: TreePolicy, teacher: Teacher | None) -> LearningResult:
    """Return the result of a finished run, which hands over a policy; a teacher may be given."""
    learner, at, evaluations, start = run.learner, run.at, run.evaluations, run.beginning.start
    judgement = evaluations.judgement
    return LearningResult(
        policy=policy,
        learned=run.learned(),
        first=run.first,
        expert=start.expert,
        curve=tuple(run.curve),
        history=learner.history,
        method=run.beginning.method,
        start=start.name,
        episodes=run.episode,
        steps=at.steps,
        environment_steps=StepCounts(
            demonstrations=sum(map(len, start.episodes)),
            teacher=at.teacher_steps,
            learning=at.steps - at.teacher_steps,
            racing=at.racing_steps,
            front=at.front_steps,
            judging=sum(  # a run that was made longer was judged before
                event.get("steps_of_judging", 0)
                for event in run.state.events
                if event["event"] == "judgement"
            ),
            declared=0 if teacher is None else teacher.cost,
            evaluation=at.evaluation_steps,
        ),
        evaluation_episodes=at.played_episodes,
        challengers=run.challengers,
        against_start=judgement,
        teacher=learner.teacher if isinstance(learner, HasTeacher) else None,
        front=evaluations.front,
        picked=picked_of(run),
        model_trust=run.model_trust(),
        reason=run.beginning.reason,
    )
