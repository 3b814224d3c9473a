"""Small, readable decision trees that control things.

Importing the package registers its environments with Gymnasium. The public names below are
imported on first use (PEP 562), so that ``import eutree`` costs little more than
``import gymnasium``.
"""

import os
import signal
import sys

if signal.getsignal(signal.SIGINT) is signal.default_int_handler and (
    sys.orig_argv[1:3] == ["-m", "eutree"] or "eutree" in map(os.path.basename, sys.orig_argv[1:2])
):
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))  # while the command is being imported

import importlib
from typing import TYPE_CHECKING

from eutree import display as _display
from eutree.envs import register as _register
from eutree.lazy import lazily
from eutree.version import __version__ as __version__

if TYPE_CHECKING:
    from eutree import export as export
    from eutree import inspection as inspection
    from eutree import interaction as interaction
    from eutree import learners as learners
    from eutree import mdp as mdp
    from eutree import recording as recording
    from eutree import report as report
    from eutree import splitting as splitting
    from eutree import zoo as zoo
    from eutree.c45 import C45Settings as C45Settings
    from eutree.c45.estimator import C45Classifier as C45Classifier
    from eutree.compression import CompressionReport as CompressionReport
    from eutree.compression.compressing import compress as compress
    from eutree.data import Demonstrations as Demonstrations
    from eutree.data import Episode as Episode
    from eutree.distillation import DistillationReport as DistillationReport
    from eutree.distillation import distill as distill
    from eutree.envs import experts as experts
    from eutree.errors import EnvironmentFault as EnvironmentFault
    from eutree.errors import EutreeError as EutreeError
    from eutree.errors import FileError as FileError
    from eutree.errors import FormatError as FormatError
    from eutree.errors import InvalidArgumentError as InvalidArgumentError
    from eutree.errors import MissingExtraError as MissingExtraError
    from eutree.errors import RunFolderError as RunFolderError
    from eutree.errors import UnknownNameError as UnknownNameError
    from eutree.errors import UnsupportedSpaceError as UnsupportedSpaceError
    from eutree.evaluation import Evaluation as Evaluation
    from eutree.evaluation.evaluate import evaluate as evaluate
    from eutree.fitting import FitReport as FitReport
    from eutree.fitting.fit import fit as fit
    from eutree.inspection.diff import diff as diff
    from eutree.inspection.verify import verify as verify
    from eutree.inspection.why import why as why
    from eutree.learners.starts import fit_expert_tree as fit_expert_tree
    from eutree.policies import LeafStatistics as LeafStatistics
    from eutree.policies import Policy as Policy
    from eutree.policies import TreePolicy as TreePolicy
    from eutree.policies.estimator import TreePolicyClassifier as TreePolicyClassifier
    from eutree.recording import record as record
    from eutree.recording.record import play as play
    from eutree.schema import EnvironmentSpec as EnvironmentSpec
    from eutree.schema import Feature as Feature
    from eutree.schema import Schema as Schema
    from eutree.training import LearningResult as LearningResult
    from eutree.training import Teacher as Teacher
    from eutree.training import listeners as listeners
    from eutree.training.handover import Handover as Handover
    from eutree.training.learn import learn as learn
    from eutree.training.many import LearningRuns as LearningRuns
    from eutree.training.many import learn_runs as learn_runs
    from eutree.training.values import Budget as Budget
    from eutree.training.values import Folder as Folder
    from eutree.training.values import Schedule as Schedule
    from eutree.training.values import ShortForms as ShortForms
    from eutree.trees import DecisionTree as DecisionTree

# Where each public name lives, and the modules that are public names. The imports above say the
# same to type checkers; a contract test compares the two.
_HOMES = {
    "eutree.c45": "C45Settings",
    "eutree.c45.estimator": "C45Classifier",
    "eutree.compression": "CompressionReport",
    "eutree.compression.compressing": "compress",
    "eutree.data": "Demonstrations Episode",
    "eutree.distillation": "DistillationReport distill",
    "eutree.errors": (
        "EnvironmentFault EutreeError FileError FormatError InvalidArgumentError "
        "MissingExtraError RunFolderError UnknownNameError UnsupportedSpaceError"
    ),
    "eutree.evaluation": "Evaluation",
    "eutree.evaluation.evaluate": "evaluate",
    "eutree.fitting": "FitReport",
    "eutree.fitting.fit": "fit",
    "eutree.inspection.diff": "diff",
    "eutree.inspection.verify": "verify",
    "eutree.inspection.why": "why",
    "eutree.learners.starts": "fit_expert_tree",
    "eutree.policies": "LeafStatistics Policy TreePolicy",
    "eutree.policies.estimator": "TreePolicyClassifier",
    "eutree.recording": "record",
    "eutree.recording.record": "play",
    "eutree.schema": "EnvironmentSpec Feature Schema",
    "eutree.training": "LearningResult Teacher",
    "eutree.training.handover": "Handover",
    "eutree.training.learn": "learn",
    "eutree.training.many": "LearningRuns learn_runs",
    "eutree.training.values": "Budget Folder Schedule ShortForms",
    "eutree.trees": "DecisionTree",
}
_MODULES = (
    "eutree.envs.experts",
    "eutree.export",
    "eutree.inspection",
    "eutree.interaction",
    "eutree.learners",
    "eutree.mdp",
    "eutree.recording",
    "eutree.report",
    "eutree.splitting",
    "eutree.training.listeners",
    "eutree.zoo",
)

__all__ = list(" ".join(_HOMES.values()).split())
__all__ += [module.rpartition(".")[2] for module in _MODULES]

__getattr__ = lazily(__name__, _HOMES, _MODULES)


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__


_register()
_display.draw_with(lambda: importlib.import_module("eutree.report.notebook"))
