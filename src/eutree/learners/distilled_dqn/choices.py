"""The choices of ``distilled-dqn``."""

from dataclasses import dataclass, field

from eutree.neural import DoubleDQNSettings
from eutree.validation import check_integer, check_number
from eutree.world_model.ensemble import EnsembleSettings


@dataclass(frozen=True, kw_only=True)
class DistilledDQNChoices:
    """The choices of this method.

    Attributes:
        max_leaves: Most leaves of the policy.
        leaf_price: Return that a leaf must earn, as a share of the mean size of a return shown.
        steps: Environment steps to learn in, where the run has no budget of steps itself.
        teacher_share: Share of the steps in which the teacher learns.
        teacher_steps: Most steps in which it learns.
        dagger_share: Share of the steps in which DAgger gathers.
        last_share: Share of the steps that is kept for the last races.
        exploration: Chance of a random action of the teacher at first.
        last_exploration: The same from a fifth of its steps on.
        demonstration_updates: Updates of the teacher before its first step; at most one for each
            transition shown.
        teacher: How the teacher learns.
        world_model: How the world model is fitted.
    """

    max_leaves: int = 34
    leaf_price: float = 0.002
    steps: int = 500_000
    teacher_share: float = 0.5
    teacher_steps: int = 180_000
    dagger_share: float = 0.08
    last_share: float = 0.2
    exploration: float = 0.3
    last_exploration: float = 0.02
    demonstration_updates: int = 2_000
    teacher: DoubleDQNSettings = field(default_factory=DoubleDQNSettings)
    world_model: EnsembleSettings = field(default_factory=EnsembleSettings)

    def __post_init__(self) -> None:
        check_integer("max_leaves", self.max_leaves, low=2)
        check_number("leaf_price", self.leaf_price, low=0.0)
        for name in ("steps", "teacher_steps", "demonstration_updates"):
            check_integer(name, getattr(self, name), low=1)
        for name in ("teacher_share", "dagger_share", "last_share", "exploration"):
            check_number(name, getattr(self, name), low=0.0, high=1.0)
        check_number("last_exploration", self.last_exploration, low=0.0, high=1.0)
