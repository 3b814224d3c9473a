"""The part of a run that does not depend on its size: learned once, and gone on from by each size.

Until a race begins, a planner gathers and plans without a limit of leaves; until DAgger begins,
``distilled-dqn`` trains its teacher. So runs of one seed that differ in ``max_leaves`` do the same
up to there. Here the first of them leaves a checkpoint there, and each goes on from it, to the same
bytes as a run of its own (``tests/training/test_common_part.py``). Its CPU seconds are counted in
each row.
"""

from pathlib import Path

from eutree.learners.distilled_dqn.learner import DistilledDQN, DistilledDQNLearner, Stage
from eutree.learners.distilled_dqn.teaching import LAST_OF_TEACHER
from eutree.training.checkpoint import restore_checkpoint, write_checkpoint
from eutree.training.listeners import Listener
from eutree.training.phases import Phase
from eutree.training.run import Run


def is_over(run: Run) -> bool:
    """Return whether sizes matter from here on."""
    if isinstance(run.learner, DistilledDQNLearner):
        return run.learner.stage is not Stage.TEACHER
    # The last evaluation before the race: the table has no other after the first.
    return run.phase is Phase.EVALUATE and run.episode > 0


def name_of(method: object, steps: int) -> str:
    """Return what runs of one seed must have in common to share the part, as a file's name."""
    if isinstance(method, DistilledDQN):
        budget = method.budget(steps)
        return f"{budget.teacher}-{budget.learning}-{min(budget.dagger, LAST_OF_TEACHER)}"
    return f"{steps}"


class LeavesCheckpoint(Listener):
    """Ends a run where sizes begin to matter, and leaves its checkpoint there."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._is_over = False

    def wants_stop(self) -> bool:
        """Return whether the checkpoint is written."""
        return self._is_over

    def advanced(self, run: Run) -> None:
        """Write it when it is time."""
        if is_over(run):
            write_checkpoint(self._path, run)
            self._is_over = True


class GoesOn(Listener):
    """Lets a run begin where another one left its checkpoint."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def begins(self, run: Run) -> None:
        """Go there. The tree that the first race defends has this run's own size."""
        own = run.learner.races.trees if isinstance(run.learner, DistilledDQNLearner) else None
        restore_checkpoint(self._path, run)
        if own is not None and isinstance(run.learner, DistilledDQNLearner):
            run.learner.races.trees = own
