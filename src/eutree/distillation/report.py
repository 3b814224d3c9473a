"""What a distillation did, and what it cost."""

from dataclasses import dataclass

from eutree.evaluation import Interval


@dataclass(frozen=True)
class Round:
    """One tree of a distillation.

    Attributes:
        n_transitions: Labelled observations that the tree was fitted to.
        n_leaves: Leaves of the tree.
        agreement: Share of them on which the tree decides as the teacher does.
        mean_return: Mean return of the validation episodes.
    """

    n_transitions: int
    n_leaves: int
    agreement: float
    mean_return: float


@dataclass(frozen=True)
class DistillationReport:
    """What a distillation did.

    Attributes:
        method: ``"cloning"``, ``"dagger"`` or ``"viper"``.
        learner: ``"cart"`` or ``"c4.5"``.
        rounds: Every tree, in the order in which they were fitted.
        best: Number of the round whose tree was returned.
        return_interval: 95 % interval of its mean return. The mean of the best of many is a
            little too high: evaluate the tree on episodes of its own.
        labels: Observations with an action of the teacher.
        environment_steps: All steps: the demonstrations', the trees' and those of validation.
        validation_steps: Those of validation.
        teacher_steps: Those in which the teacher was trained before, none of the above; None where
            it does not say so itself (``num_timesteps``, as models of SB3 do).
        weighted: Whether observations were weighted by the teacher's action values.
    """

    method: str
    learner: str
    rounds: tuple[Round, ...]
    best: int
    return_interval: Interval
    labels: int
    environment_steps: int
    validation_steps: int
    weighted: bool
    teacher_steps: int | None = None

    @property
    def n_leaves(self) -> int:
        """Leaves of the returned tree."""
        return self.rounds[self.best].n_leaves

    @property
    def mean_return(self) -> float:
        """Mean return of the returned tree's validation episodes."""
        return self.rounds[self.best].mean_return
