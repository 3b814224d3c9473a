"""Which digits of a tree's numbers are shown: as few as tell the thresholds of a feature apart."""

from collections.abc import Iterable

import numpy as np

from eutree.display import SAME, told_apart, usual_width
from eutree.schema import Schema
from eutree.trees.tree import DecisionTree


class Digits:
    """The digits of the numbers of each feature.

    Args:
        schema: The features, with their bounds.
        trees: Whose thresholds are shown.
        others: Further values that are shown, by the number of their feature.
    """

    def __init__(
        self, schema: Schema, *trees: DecisionTree, others: Iterable[tuple[int, float]] = ()
    ) -> None:
        shown: list[set[float]] = [set() for _ in schema.features]
        for tree in trees:
            inner = np.flatnonzero(tree.feature != tree.NO_FEATURE)
            pairs = zip(tree.feature[inner].tolist(), tree.threshold[inner].tolist(), strict=True)
            for feature, threshold in pairs:
                shown[feature].add(threshold)
        for feature, value in others:
            shown[feature].add(value)
        self.widths = [
            usual_width(feature.low, feature.high, values)
            for feature, values in zip(schema.features, shown, strict=True)
        ]
        self._texts = [
            told_apart(values, width, down=True)
            for values, width in zip(shown, self.widths, strict=True)
        ]

    def text(self, feature: int, value: float) -> str:
        """Return a value of a feature."""
        known, width = self._texts[feature].get(value), self.widths[feature]
        return told_apart([value], width, down=True)[value] if known is None else known

    def at_most(self, feature: int, threshold: float) -> str:
        """Return a test: ``"<= 8.25"``, or ``"< 24"`` for a threshold hardly below 24.

        So the number that is shown is itself decided as it says.
        """
        text = self.text(feature, threshold)
        return f"{'<' if float(text) > threshold else '<='} {text}"

    def above(self, feature: int, threshold: float) -> str:
        """Return the opposite test."""
        text = self.text(feature, threshold)
        return f"{'>=' if float(text) > threshold else '>'} {text}"

    def are_one(self, feature: int, one: float, other: float) -> bool:
        """Return whether two values are nearer than a millionth of the feature's range."""
        return one == other or abs(one - other) <= SAME * self.widths[feature]
