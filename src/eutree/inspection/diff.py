"""The changes between two policies: in behaviour, exactly, and in structure."""

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.display import SAME, Displayed, counted
from eutree.inspection.occurring import Occurring
from eutree.inspection.regions import Region, domain, finite_box, is_box
from eutree.policies import TreePolicy
from eutree.trees.boxes import differing, possible, volumes
from eutree.trees.text import Digits, asked, printable
from eutree.validation import check_kind, check_observations

_MOST_PARTS = 300  # of a box in which an observation is looked for: there are many boxes


@dataclass(frozen=True)
class Disagreement:
    """A box on which two policies decide differently.

    Attributes:
        region: The bounds of the box.
        share: The share of the observation box that it takes.
        first: Action of the first policy.
        second: Action of the second.
        words: All this in words.
        visited: The share of the recorded observations that lie in it; None where none are given.
    """

    region: Region
    share: float
    first: int
    second: int
    words: str
    visited: float | None = None


@dataclass(frozen=True)
class PolicyDiff(Displayed):
    """The changes between two policies.

    Attributes:
        share: Exact share of the observation box on which they disagree.
        boxes: All boxes of disagreement; neighbours are joined. The largest come first or, where
            recorded observations are given, the most visited.
        structure: The changes in the tree, from the root on, in words.
        n_leaves: Leaves of the first and of the second.
        visited: The share of the recorded observations on which they disagree; None where none
            are given.
    """

    share: float
    boxes: tuple[Disagreement, ...]
    structure: tuple[str, ...]
    n_leaves: tuple[int, int]
    visited: float | None = None

    def __str__(self) -> str:
        """Return the difference in words, the first ten boxes of it."""
        before, after = self.n_leaves
        steps = "" if self.visited is None else f" and {self.visited:.1%} of the recorded steps"
        lines = [
            f"{counted(before, 'leaf')}, then {after}; another action on {_percent(self.share)} of "
            f"the box{steps}"
        ]
        lines += [f"  {_share(box)}: {box.words}" for box in self.boxes[:10]]
        if len(self.boxes) > 10:
            lines.append(f"  and {len(self.boxes) - 10} smaller boxes")
        return "\n".join([*lines, *(f"  {change}" for change in self.structure)])


def _share(box: Disagreement) -> str:
    """Return how large a box is, or how many of the recorded steps lie in it."""
    return _percent(box.share) if box.visited is None else f"{box.visited:.1%} of the steps"


def _percent(share: float) -> str:
    """Return a share in percent, which is 0 only of nothing."""
    return f"{share:.4%}" if share == 0.0 or share >= 1e-6 else f"{100 * share:.2g}%"


def diff(
    first: TreePolicy, second: TreePolicy, *, observations: ArrayLike | None = None
) -> PolicyDiff:
    """Return the changes between two policies of the same features and actions.

    The box is that of the schema's bounds; where they are infinite it reaches a tenth beyond the
    outermost thresholds of both trees and of the observations, if these are given. Two thresholds
    that are nearer than a millionth of the range are one, unless observations lie between them.

    Args:
        first: The policy before the change.
        second: The policy after the change.
        observations: Recorded observations, shape [N, d], in the features of the trees: how much of
            them each change concerns is counted, and the changes stand in that order.

    Raises:
        InvalidArgumentError: The two have other features or actions.
    """
    mine = check_kind("the first policy", first, TreePolicy).schema
    check_kind("the second policy", second, TreePolicy)
    mine.check_same(second.schema, "the second policy", of="the first")
    inside = domain(mine)
    low, high, actions = differing(
        first.tree, first.actions, second.tree, second.actions, inside.low, inside.high
    )
    seen = None
    if observations is not None:
        seen = check_observations("observations", observations, names=mine.feature_names)
    box_low, box_high = finite_box(mine, first.tree, second.tree, seen=seen)
    low, high = possible(low, high, mine)
    real = is_box(low, high)
    low, high, actions = _joined(low[real], high[real], actions[real])
    digits = Digits(mine, first.tree, second.tree)
    widths = np.array(digits.widths)  # infinite where nothing is known of one
    wide = (high / 2 - low / 2 > SAME * widths / 2) | (low <= inside.low) | np.isinf(widths)
    visited = np.zeros(len(low)) if seen is None else _visits(low, high, inside, seen)
    kept = wide.all(axis=1) | (visited > 0.0)
    if mine.derived:
        occurring = Occurring(mine, most=_MOST_PARTS)
        for k in np.flatnonzero(kept).tolist():
            kept[k] = occurring.within(Region(low[k], high[k])) is not None
    low, high, actions, visited = low[kept], high[kept], actions[kept], visited[kept]
    shares = volumes(low, high, box_low, box_high, mine)
    boxes = []
    for number in np.lexsort([-shares, -visited]).tolist():
        region = Region(low[number], high[number])
        one, two = actions[number].tolist()
        became = f"{printable(mine.actions[one])} became {printable(mine.actions[two])}"
        words = f"{became} {region.where(mine, inside, digits)}"
        steps = None if seen is None else float(visited[number])
        boxes.append(Disagreement(region, float(shares[number]), one, two, words, steps))
    return PolicyDiff(
        share=float(shares.sum()),
        boxes=tuple(boxes),
        structure=tuple(_structure(first, second, digits)),
        n_leaves=(first.n_leaves, second.n_leaves),
        visited=None if seen is None else sum(visited.tolist()),
    )


def _visits(low: Floats, high: Floats, inside: Region, rows: Floats) -> Floats:
    """Return the share of rows in each box; a box that ends at the bounds has no end there."""
    low = np.where(low == inside.low, -np.inf, low)
    high = np.where(high == inside.high, np.inf, high)
    counts = [
        np.all((rows > a) & (rows <= b), axis=1).sum() for a, b in zip(low, high, strict=True)
    ]
    shares: Floats = np.array(counts, dtype=np.float64) / max(len(rows), 1)
    return shares


def _joined(low: Floats, high: Floats, actions: Integers) -> tuple[Floats, Floats, Integers]:
    """Join boxes of the same actions that touch in one feature and agree in all others."""
    boxes = [
        (tuple(a), tuple(b), tuple(pair))
        for a, b, pair in zip(low.tolist(), high.tolist(), actions.tolist(), strict=True)
    ]
    n_features, before = low.shape[1], -1
    while len(boxes) != before:
        before = len(boxes)
        for j in range(n_features):
            rows = defaultdict(list)
            for a, b, pair in boxes:
                rows[a[:j] + a[j + 1 :], b[:j] + b[j + 1 :], pair].append((a[j], b[j]))
            boxes = [
                ((*a[:j], start, *a[j:]), (*b[:j], end, *b[j:]), pair)
                for (a, b, pair), spans in rows.items()
                for start, end in _runs(sorted(spans))
            ]
    low, high = (np.array([box[k] for box in boxes]).reshape(-1, n_features) for k in (0, 1))
    return low, high, np.array([box[2] for box in boxes], dtype=np.int64).reshape(-1, 2)


def _runs(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Join spans that touch, in order."""
    joined = [spans[0]]
    for start, end in spans[1:]:
        if start == joined[-1][1]:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return joined


def _structure(first: TreePolicy, second: TreePolicy, digits: Digits) -> list[str]:
    """Walk both trees side by side from the root and say where they part."""
    changes, schema = [], first.schema
    pairs = [(0, 0)]
    one, two = first.tree, second.tree
    while pairs:
        node, other = pairs.pop()
        feature, is_same = int(one.feature[node]), one.feature[node] == two.feature[other]
        if is_same and feature == one.NO_FEATURE:
            is_same = first.actions[one.leaf[node]] == second.actions[two.leaf[other]]
        elif is_same:
            cuts = float(one.threshold[node]), float(two.threshold[other])
            is_same = digits.are_one(feature, *cuts)
            pairs += [
                (int(one.right[node]), int(two.right[other])),
                (int(one.left[node]), int(two.left[other])),
            ]
        if not is_same:
            words = [_at(policy, at, digits) for policy, at in ((first, node), (second, other))]
            changes.append(f"node {node}: {words[0]} became {words[1]} (node {other})")
    if replace(schema, actions=second.schema.actions) != second.schema:
        changes.append("units or bounds of the features changed")
    return changes


def _at(policy: TreePolicy, node: int, digits: Digits) -> str:
    """Return a test, or a leaf's action, in words."""
    tree = policy.tree
    if tree.feature[node] == tree.NO_FEATURE:
        return printable(policy.schema.actions[policy.actions[tree.leaf[node]]])
    return f"{asked(policy.schema, tree, node).question(digits)} ?"
