"""Which columns a tree's decisions rest on, as a plot: in the style of scikit-learn's displays."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.trees.text import printable


@dataclass(eq=False)
class FeatureImportancesDisplay:
    """Importances of columns, the largest on top.

    Attributes:
        importances: Of each column, shape [d].
        names: Of each column.
        ax_: The axes, once plotted.
        figure_: The figure, once plotted.
    """

    importances: Floats  # [d]
    names: tuple[str, ...]
    ax_: Any = None
    figure_: Any = None

    @classmethod
    def from_estimator(
        cls, estimator: Any, *, max_features: int | None = None, ax: Any = None
    ) -> "FeatureImportancesDisplay":
        """Plot the importances of a fitted estimator, such as ``C45Classifier``.

        Args:
            estimator: Anything with ``feature_importances_``; names come from
                ``feature_names_in_`` where there are any.
            max_features: How many columns are shown at most; by default all.
            ax: Matplotlib axes to draw on; by default those of a new figure.

        Raises:
            InvalidArgumentError: The estimator has no importances.
            MissingExtraError: matplotlib is not installed.
        """
        if not hasattr(estimator, "feature_importances_"):
            raise InvalidArgumentError(
                f"estimator must be fitted and have feature_importances_, got {estimator!r}"
            )
        importances = np.asarray(estimator.feature_importances_, dtype=np.float64)
        names = getattr(estimator, "feature_names_in_", None)
        if names is None:
            names = [f"x{column}" for column in range(importances.size)]
        return cls(importances, tuple(map(str, names))).plot(max_features=max_features, ax=ax)

    def plot(
        self, *, max_features: int | None = None, ax: Any = None
    ) -> "FeatureImportancesDisplay":
        """Draw a bar for each column; arguments as in ``from_estimator``.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        if ax is None:
            ax = _axes(min(max_features or len(self.names), len(self.names)))
        order = np.argsort(-self.importances, kind="stable")[:max_features][::-1]
        ax.barh([printable(self.names[k]) for k in order], self.importances[order])
        ax.set_xlabel("share of the information that tests gain")
        ax.set_xlim(0.0, max(1.05 * float(self.importances.max(initial=0.0)), 0.05))
        self.ax_, self.figure_ = ax, ax.figure
        return self


def _axes(n_bars: int) -> Any:
    try:
        from matplotlib import pyplot
    except ImportError:
        raise MissingExtraError("matplotlib", "plot") from None
    return pyplot.subplots(figsize=(6.0, 1.2 + 0.3 * n_bars), layout="constrained")[1]
