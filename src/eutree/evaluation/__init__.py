"""How good a policy is: frozen evaluations, learning curves, intervals."""

from typing import TYPE_CHECKING

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
from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.evaluation.curves import CurvePoint, curve_from_csv, curve_to_csv

__all__ = [
    "Against", "CurvePoint", "Estimate", "Evaluation", "Interval", "against", "curve_from_csv",
    "curve_to_csv", "evaluate", "mean_interval", "wilson_interval",
]  # fmt: skip

__getattr__ = lazily(
    __name__, {"eutree.evaluation.curves": "CurvePoint curve_from_csv curve_to_csv"}
)
