"""How good a policy is: frozen evaluations, learning curves, intervals."""

from eutree.evaluation.against import Against, against
from eutree.evaluation.curves import CurvePoint, curve_from_csv, curve_to_csv
from eutree.evaluation.evaluate import evaluate
from eutree.evaluation.evaluation import Evaluation
from eutree.evaluation.intervals import Estimate, Interval, mean_interval, wilson_interval
from eutree.evaluation.sb3 import evaluate_policy

__all__ = [
    "Against",
    "CurvePoint",
    "Estimate",
    "Evaluation",
    "Interval",
    "against",
    "curve_from_csv",
    "curve_to_csv",
    "evaluate",
    "evaluate_policy",
    "mean_interval",
    "wilson_interval",
]
