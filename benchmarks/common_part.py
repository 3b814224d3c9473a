"""The part of a run that does not depend on its size: learned once, and gone on from by each size.

Until a race begins, a planner gathers and plans without a limit of leaves; until DAgger begins,
``distilled-dqn`` trains its teacher. So runs of one seed that differ in ``max_leaves`` do the same
up to there. Here the first of them leaves a checkpoint there, and each goes on from it, to the same
bytes as a run of its own (``tests/training/test_common_part.py``). DAgger gathers the same for all
sizes, too, so that the first world model after it is fitted once: its bytes are a function of what
it is fitted to. The CPU seconds of both are counted in each row.
"""

import hashlib
import pickle
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

import numpy as np

from eutree.learners.distilled_dqn import races
from eutree.learners.distilled_dqn.learner import DistilledDQN, DistilledDQNLearner
from eutree.learners.distilled_dqn.state import Stage
from eutree.learners.distilled_dqn.teaching import LAST_OF_TEACHER
from eutree.training.checkpoint import restore_checkpoint, write_checkpoint
from eutree.training.listeners import Listener
from eutree.training.phases import Phase
from eutree.training.run import Run
from eutree.world_model import Transitions
from eutree.world_model.ensemble import Ensemble, EnsembleSettings


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
        begun = run.learner
        restore_checkpoint(self._path, run)
        if isinstance(begun, DistilledDQNLearner) and isinstance(run.learner, DistilledDQNLearner):
            run.learner.races.trees = begun.races.trees


@contextmanager
def fitted_once(folder: Path) -> Iterator[list[float]]:
    """Let a world model that was fitted before be read from a folder; yield the seconds spared.

    A fit is known by all that it depends on: the transitions, the settings, the state of the
    generator, which is left as the fit left it.
    """
    spared: list[float] = []
    fit = races.fit_ensemble

    def known_fit(
        data: Transitions, settings: EnsembleSettings, generator: np.random.Generator
    ) -> Ensemble:
        given = pickle.dumps((data, settings, generator.bit_generator.state))
        path = folder / f"{hashlib.sha256(given).hexdigest()}.model"
        if path.exists():
            ensemble, state, seconds = pickle.loads(path.read_bytes())
            generator.bit_generator.state = state
            spared.append(seconds)
            return ensemble
        begin = time.process_time()
        ensemble = fit(data, settings, generator)
        seconds = time.process_time() - begin
        path.write_bytes(pickle.dumps((ensemble, generator.bit_generator.state, seconds)))
        return ensemble

    with mock.patch.object(races, "fit_ensemble", known_fit):
        yield spared
