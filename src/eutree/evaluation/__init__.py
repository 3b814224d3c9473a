"""How good a policy is: frozen evaluations, learning curves, intervals, comparisons."""

from eutree.evaluation.against import Against, against
from eutree.evaluation.bootstrap import (
    bootstrap,
    bootstrap_rows,
    mean,
    median,
    stratified_bootstrap,
)
from eutree.evaluation.comparison import (
    PairedComparison,
    compare_paired,
    spearman,
)
from eutree.evaluation.curves import (
    CurvePoint,
    curve_from_csv,
    curve_to_csv,
)
from eutree.evaluation.evaluate import evaluate
from eutree.evaluation.evaluation import Evaluation
from eutree.evaluation.intervals import Estimate, Interval, mean_interval, wilson_interval
from eutree.evaluation.sb3 import evaluate_policy
from eutree.evaluation.survival import (
    Durations,
    SurvivalCurve,
    kaplan_meier,
    restricted_mean,
    restricted_mean_ratio,
    trials_to_threshold,
)

__all__ = [
    "Against",
    "CurvePoint",
    "Durations",
    "Estimate",
    "Evaluation",
    "Interval",
    "PairedComparison",
    "SurvivalCurve",
    "against",
    "bootstrap",
    "bootstrap_rows",
    "compare_paired",
    "curve_from_csv",
    "curve_to_csv",
    "evaluate",
    "evaluate_policy",
    "kaplan_meier",
    "mean",
    "mean_interval",
    "median",
    "restricted_mean",
    "restricted_mean_ratio",
    "spearman",
    "stratified_bootstrap",
    "trials_to_threshold",
    "wilson_interval",
]
