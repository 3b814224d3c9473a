"""Thresholds with the fewest significant digits that send every recorded observation the same way.

Between the recorded values on both sides of a test, any threshold decides them alike. Of all
numbers there with the fewest significant digits the one nearest to the old threshold is taken.
A threshold also stays between those of the tests above it, so that no leaf becomes empty, and
one that bounds a locked leaf stays as it is.

Where a feature has a step (0.1 of a degree), its thresholds become multiples of it: ``<=`` or ``<``
the nearest one that decides every recorded observation alike, or else the nearest at all. Tests
that then decide nothing are dropped.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compression.candidates import merged, node_totals, with_locks
from eutree.errors import UnknownNameError
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.trees.boxes import node_boxes
from eutree.validation import check_number

Rounding = bool | float | Mapping[str, float]  # short, multiples of a step, or of one for a feature

_MOST_DIGITS = 17  # tell every double from every other


def steps_of(rounding: Rounding, schema: Schema) -> dict[int, float]:
    """Return the step of each feature that has one, its past values included.

    Raises:
        InvalidArgumentError: A step is not above 0.
        UnknownNameError: No feature has that name.
    """
    if isinstance(rounding, bool):
        return {}
    names = [re.sub(r", \d+ ago$", "", name) for name in schema.feature_names]
    given = rounding if isinstance(rounding, Mapping) else dict.fromkeys(names, rounding)
    for name in given:
        if name not in names:
            raise UnknownNameError("feature", name, names)
    steps = {
        name: check_number(f"the step of {name}", step, low=0, low_open=True)
        for name, step in given.items()
    }
    return {number: steps[name] for number, name in enumerate(names) if name in steps}


def rounded(
    policy: TreePolicy, rows: Floats, steps: Mapping[int, float] | None = None
) -> TreePolicy:
    """Return the policy with short thresholds; each recorded observation keeps its leaf.

    Args:
        policy: The policy.
        rows: Recorded observations, shape [N, d].
        steps: By feature, the step whose multiples its thresholds become. Recorded observations
            between the old and the new threshold then change their leaf.
    """
    steps = steps or {}
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
        room = max(np.nextafter(low, np.inf), least), min(high, below)
        step = steps.get(feature)
        threshold[node] = shortest(cut, *room) if step is None else multiple(cut, *room, step)
    result = replace(policy, tree=replace(tree, threshold=threshold))
    return with_locks(merged(result), policy) if steps else result


def multiple(value: float, least: float, below: float, step: float) -> float:
    """Return the threshold that is a multiple of ``step``: at most it, or less than it.

    It lies in [least, below) if one does; else it is the nearest multiple.

    >>> multiple(20.12699, 20.05, 20.2, 0.1)
    20.1
    >>> multiple(23.98, 23.9500001, 24.0, 0.1)  # less than 24
    23.999999999999996
    >>> multiple(20.12699, 20.12, 20.13, 0.1)
    20.1
    """
    unit = Decimal(repr(step))
    steps = Decimal(value) / unit
    ends = [float(steps.to_integral_value(way) * unit) for way in (ROUND_FLOOR, ROUND_CEILING)]
    ends.sort(key=lambda number: abs(number - value))
    for candidates in (ends, [float(np.nextafter(end, -np.inf)) for end in ends]):
        for number in candidates:
            if least <= number < below:
                return number
    return ends[0]


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
