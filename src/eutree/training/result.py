"""What a learning run gives back."""

from dataclasses import dataclass

from eutree.display import Displayed
from eutree.evaluation import CurvePoint
from eutree.learners import History, Method
from eutree.policies import TreePolicy
from eutree.training.polishing import PolishReport
from eutree.wording import counted


@dataclass(frozen=True, eq=False)
class LearningResult(Displayed):
    """A finished learning run.

    Attributes:
        policy: The final policy.
        expert: The expert tree it started from; None where it started from none.
        curve: Frozen evaluations along the way, the first before any learning.
        history: All stored transitions.
        method: How it learned.
        start: Where it began: "nothing", "tree", "tree+demos", "demos" or "random-tree".
        episodes: Episodes of experience, without those of evaluations.
        steps: Environment steps of experience, without those of evaluations and polishing.
        polishing: What polishing did at the end; None without.
    """

    policy: TreePolicy
    expert: TreePolicy | None
    curve: tuple[CurvePoint, ...]
    history: History
    method: Method
    start: str
    episodes: int
    steps: int
    polishing: PolishReport | None = None

    def __repr__(self) -> str:
        """Return the result in one line; the stored transitions would be pages."""
        last = self.curve[-1].describe() if self.curve else counted(self.policy.n_leaves, "leaf")
        experience = f"{counted(self.episodes, 'episode')}, {counted(self.steps, 'step')}"
        return f"<LearningResult: {self.method.name} from {self.start}, {experience}; {last}>"
