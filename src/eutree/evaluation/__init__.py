"""How good a policy is: frozen evaluations, learning curves, intervals."""

from eutree.evaluation.curves import CurvePoint, curve_from_csv, curve_to_csv
from eutree.evaluation.evaluate import evaluate
from eutree.evaluation.evaluation import (
    Against,
    Estimate,
    Evaluation,
    Interval,
    against,
    mean_interval,
    wilson_interval,
)

__all__ = [
    "Against", "CurvePoint", "Estimate", "Evaluation", "Interval", "against", "curve_from_csv",
    "curve_to_csv", "evaluate", "mean_interval", "wilson_interval",
]  # fmt: skip
