"""Learning runs: gather, expand, evaluate, and the public ``learn``."""

from eutree.training.asking import Asking
from eutree.training.checkpoint import stored_observations
from eutree.training.learn import learn
from eutree.training.offline import OfflineRun
from eutree.training.polishing import PolishReport, polish
from eutree.training.result import LearningResult
from eutree.training.run import LearningRun, Schedule

__all__ = [
    "Asking",
    "LearningResult",
    "LearningRun",
    "OfflineRun",
    "PolishReport",
    "Schedule",
    "learn",
    "polish",
    "stored_observations",
]
