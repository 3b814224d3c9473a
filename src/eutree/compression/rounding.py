"""Thresholds with the fewest significant digits that send every recorded observation the same way.

Between the recorded values on both sides of a test, any threshold decides them alike. Of all
numbers there with the fewest significant digits the one nearest to the old threshold is taken.
A threshold also stays between those of the tests above it, so that no leaf becomes empty, and
one that bounds a locked leaf stays as it is.
"""

from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compression.pruning import node_totals
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.boxes import node_boxes

_MOST_DIGITS = 17  # tell every double from every other


def rounded(policy: TreePolicy, rows: Floats) -> TreePolicy:
    """Return the policy with short thresholds; each recorded observation keeps its leaf."""
    tree = policy.tree
    threshold = np.array(tree.threshold)
    held = (
        node_totals(tree, np.isin(np.arange(tree.n_leaves), policy.locked).astype(np.float64)) > 0
    )
    members: dict[int, Integers] = {0: np.arange(len(rows))}
    for node in np.flatnonzero(tree.feature != tree.NO_FEATURE).tolist():  # parents first
        feature, cut = int(tree.feature[node]), float(tree.threshold[node])
        mine = members.pop(node)
        values = rows[mine, feature]
        members[int(tree.left[node])] = mine[values <= cut]
        members[int(tree.right[node])] = mine[values > cut]
        if held[node]:
            continue
        low, high = _free(tree, threshold, node)
        least = values[values <= cut].max(initial=-np.inf)
        below = values[values > cut].min(initial=np.inf)
        threshold[node] = shortest(cut, max(np.nextafter(low, np.inf), least), min(high, below))
    return replace(policy, tree=replace(tree, threshold=threshold))


def shortest(value: float, least: float, below: float) -> float:
    """Return the number of fewest significant digits in [least, below) nearest to ``value``.

    ``value`` lies in the interval; if not, it is returned as it is.

    >>> shortest(3.1415926, 3.1, 3.2)
    3.1
    >>> shortest(97.3, 90.5, 103.0)
    100.0
    """
    if not least <= value < below or value == 0.0:
        return value
    exact = Decimal(value)
    for digits in range(1, _MOST_DIGITS + 1):
        unit = Decimal(1).scaleb(exact.adjusted() - digits + 1)
        steps = exact / unit
        ends = [steps.to_integral_value(way) * unit for way in (ROUND_FLOOR, ROUND_CEILING)]
        fitting = [float(end) for end in ends if least <= float(end) < below]
        if fitting:
            return min(fitting, key=lambda number: abs(number - value))
    return value


def _free(tree: DecisionTree, threshold: Floats, node: int) -> tuple[float, float]:
    """Return the bounds, both exclusive, that the tests above and below leave to a threshold.

    Tests above have their new thresholds already, those below still the old ones.
    """
    low, high = node_boxes(replace(tree, threshold=threshold))
    feature = tree.feature[node]
    least, most = float(low[node, feature]), float(high[node, feature])
    for side, child in enumerate((int(tree.left[node]), int(tree.right[node]))):
        below = [child]
        while below:
            at = below.pop()
            if tree.feature[at] == tree.NO_FEATURE:
                continue
            if tree.feature[at] == feature and side == 0:
                least = max(least, min(float(threshold[at]), float(threshold[node])))
            elif tree.feature[at] == feature:
                most = min(most, max(float(threshold[at]), float(threshold[node])))
            below += [int(tree.left[at]), int(tree.right[at])]
    return least, most
