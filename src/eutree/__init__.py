"""Small, readable decision trees that control things.

Importing the package registers its environments with Gymnasium. The public names below are
imported on first use (PEP 562), so that ``import eutree`` costs little more than
``import gymnasium``.
"""

import importlib
from typing import TYPE_CHECKING, Any

from eutree import display as _display
from eutree.envs import register as _register
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
    from eutree.distillation.distill import distill as distill
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

# Where each public name lives, as "module" or "module:attribute". The imports above say the same to
# type checkers; a contract test compares the two.
_PUBLIC = {
    "Budget": "eutree.training.values:Budget",
    "C45Classifier": "eutree.c45.estimator:C45Classifier",
    "C45Settings": "eutree.c45:C45Settings",
    "compress": "eutree.compression.compressing:compress",
    "CompressionReport": "eutree.compression:CompressionReport",
    "diff": "eutree.inspection.diff:diff",
    "distill": "eutree.distillation.distill:distill",
    "DistillationReport": "eutree.distillation:DistillationReport",
    "DecisionTree": "eutree.trees:DecisionTree",
    "Demonstrations": "eutree.data:Demonstrations",
    "EnvironmentFault": "eutree.errors:EnvironmentFault",
    "EnvironmentSpec": "eutree.schema:EnvironmentSpec",
    "Episode": "eutree.data:Episode",
    "EutreeError": "eutree.errors:EutreeError",
    "evaluate": "eutree.evaluation.evaluate:evaluate",
    "Evaluation": "eutree.evaluation:Evaluation",
    "experts": "eutree.envs.experts",
    "export": "eutree.export",
    "Feature": "eutree.schema:Feature",
    "FileError": "eutree.errors:FileError",
    "fit": "eutree.fitting.fit:fit",
    "fit_expert_tree": "eutree.learners.starts:fit_expert_tree",
    "FitReport": "eutree.fitting:FitReport",
    "Folder": "eutree.training.values:Folder",
    "FormatError": "eutree.errors:FormatError",
    "Handover": "eutree.training.handover:Handover",
    "inspection": "eutree.inspection",
    "interaction": "eutree.interaction",
    "InvalidArgumentError": "eutree.errors:InvalidArgumentError",
    "LeafStatistics": "eutree.policies:LeafStatistics",
    "learn": "eutree.training.learn:learn",
    "learn_runs": "eutree.training.many:learn_runs",
    "LearningRuns": "eutree.training.many:LearningRuns",
    "learners": "eutree.learners",
    "listeners": "eutree.training.listeners",
    "LearningResult": "eutree.training:LearningResult",
    "mdp": "eutree.mdp",
    "MissingExtraError": "eutree.errors:MissingExtraError",
    "play": "eutree.recording.record:play",
    "Policy": "eutree.policies:Policy",
    "record": "eutree.recording:record",
    "recording": "eutree.recording",
    "report": "eutree.report",
    "RunFolderError": "eutree.errors:RunFolderError",
    "Schedule": "eutree.training.values:Schedule",
    "Schema": "eutree.schema:Schema",
    "ShortForms": "eutree.training.values:ShortForms",
    "splitting": "eutree.splitting",
    "Teacher": "eutree.training:Teacher",
    "TreePolicy": "eutree.policies:TreePolicy",
    "TreePolicyClassifier": "eutree.policies.estimator:TreePolicyClassifier",
    "UnknownNameError": "eutree.errors:UnknownNameError",
    "UnsupportedSpaceError": "eutree.errors:UnsupportedSpaceError",
    "verify": "eutree.inspection.verify:verify",
    "why": "eutree.inspection.why:why",
    "zoo": "eutree.zoo",
}

__all__ = list(_PUBLIC)


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'eutree' has no attribute {name!r}")
    module, _, attribute = _PUBLIC[name].partition(":")
    value: Any = importlib.import_module(module)
    if attribute:
        value = getattr(value, attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__


_register()
_display.draw_with(lambda: importlib.import_module("eutree.report.notebook"))
