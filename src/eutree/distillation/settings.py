"""How a teacher is distilled."""

from dataclasses import dataclass

from eutree.distillation.fitting import LEARNERS
from eutree.validation import check_choice, check_integer

METHODS = ("dagger", "viper", "cloning")


@dataclass(frozen=True, kw_only=True)
class DistillationSettings:
    """How a teacher is distilled.

    Attributes:
        method: ``"cloning"`` fits one tree to the teacher's own episodes; ``"dagger"`` and
            ``"viper"`` go on to fit trees to what the trees themselves come to.
        learner: ``"c4.5"``, or ``"cart"`` (extra ``sklearn``).
        max_leaves: Most leaves of the tree; None for what the learner makes.
        iterations: Trees that are fitted, the first to the teacher's episodes alone.
        episodes: Episodes gathered before each tree.
        validation_episodes: Episodes of the validation of each tree.

    Raises:
        InvalidArgumentError: One of them is not as described.
    """

    method: str = "dagger"
    learner: str = "c4.5"
    max_leaves: int | None = 32
    iterations: int = 10
    episodes: int = 10
    validation_episodes: int = 50

    def __post_init__(self) -> None:
        check_choice("method", self.method, METHODS)
        check_choice("learner", self.learner, LEARNERS)
        check_integer("iterations", self.iterations, low=1)
        check_integer("episodes", self.episodes, low=1)
        check_integer("validation_episodes", self.validation_episodes, low=2)
        if self.max_leaves is not None:
            check_integer("max_leaves", self.max_leaves, low=1)

    @property
    def rounds(self) -> int:
        """Trees that are fitted."""
        return 1 if self.method == "cloning" else self.iterations
