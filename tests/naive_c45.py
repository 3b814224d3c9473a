"""C4.5 release 8 as slow, obvious recursion, straight from its rules: the twin of eutree.c45.

A training set is a list of ``(row, label, weight)``; unknown values are NaN. A tree is a ``Node``.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise

from eutree.c45 import C45Settings

Case = tuple[tuple[float, ...], int, float]


@dataclass
class Node:
    """A leaf (no children) or a test: by threshold, or with a branch for each nominal value."""

    classes: list[float]
    feature: int = -1
    threshold: float = math.nan
    n_values: int = 0  # of a nominal attribute
    children: list["Node"] = field(default_factory=list)

    def branch(self, row: tuple[float, ...]) -> int | None:
        """Return the branch that a row takes, None if its value is unknown."""
        value = row[self.feature]
        if math.isnan(value):
            return None
        if self.n_values:
            return int(value)
        return 0 if value <= self.threshold else 1


class Naive:
    """The learner; ``n_values`` is 0 for a continuous attribute."""

    def __init__(
        self, cases: list[Case], n_values: list[int], n_classes: int, settings: C45Settings
    ) -> None:
        self.cases, self.n_values, self.n_classes = cases, n_values, n_classes
        self.settings = settings
        total = sum(weight for _, _, weight in cases)
        few = [n < 0.3 * total for n in n_values]
        self.counted = few if any(few) else [True] * len(few)

    def tree(self) -> Node:
        """Return the grown, collapsed and pruned tree."""
        root = self.grow(self.cases, None)
        return self.prune(root, self.cases) if self.settings.prune else root

    def classes(self, cases: list[Case]) -> list[float]:
        """Return the weight of each class."""
        return [sum(w for _, c, w in cases if c == label) for label in range(self.n_classes)]

    def grow(self, cases: list[Case], parent: Node | None) -> Node:
        """Return the subtree of some cases."""
        settings, tolerance = self.settings, self.settings.tolerance
        node = Node(self.classes(cases))
        total = sum(node.classes)
        if total - max(node.classes) <= tolerance or total < 2 * settings.min_objects - tolerance:
            return node
        test = self.best_test(cases)
        if test is None:
            return node
        node.feature, node.threshold, node.n_values = test
        node.children = [self.grow(part, node) for part in divide(node, cases)]
        own, below = total - max(node.classes), sum(map(training_errors, node.children))
        if settings.collapse and below >= own - 1e-3:
            return Node(node.classes)
        return node

    def best_test(self, cases: list[Case]) -> tuple[int, float, int] | None:
        """Return attribute, threshold and number of values of the test with the best gain ratio."""
        candidates = []
        for j, n in enumerate(self.n_values):
            found = self.nominal(cases, j, n) if n else self.continuous(cases, j)
            if found is not None:
                candidates.append((j, *found))
        gains = [gain for j, gain, _, _ in candidates if self.counted[j]]
        average = sum(gains) / len(gains) if gains else math.inf
        if not self.settings.use_average_filter:
            average = -math.inf
        needs_gain, normal = self.settings.require_gain, self.settings.z == "normal"
        best, least, chosen = -1e-3, 1e-3, None
        if normal:
            best, least = 0.0, 1e-6
        if not needs_gain:
            best = least = -math.inf
        for j, gain, split, threshold in candidates:
            allowed = gain >= average - 1e-3 and split > least
            if allowed and gain / split > best + self.settings.tolerance:
                best, chosen = gain / split, (j, threshold, self.n_values[j])
        return chosen

    def continuous(self, cases: list[Case], j: int) -> tuple[float, float, float] | None:
        """Return penalised gain, split information and threshold of the best cut of a number."""
        settings, tolerance = self.settings, self.settings.tolerance
        total = sum(w for _, _, w in cases)
        known = [case for case in cases if not math.isnan(case[0][j])]
        known_weight = sum(w for _, _, w in known)
        minimum = settings.min_objects
        if settings.use_min_split and 0.1 * known_weight / self.n_classes > minimum:
            minimum = min(25.0, 0.1 * known_weight / self.n_classes)
        values = sorted({row[j] for row, _, _ in known})
        best, chosen, tries = (0.0 if settings.require_gain else -math.inf), None, 0
        for low, high in pairwise(values):
            if not low < high - settings.gap:
                continue
            left = [case for case in known if case[0][j] <= low]
            right = [case for case in known if case[0][j] > low]
            sizes = [sum(w for _, _, w in part) for part in (left, right)]
            if min(sizes) < minimum - tolerance:
                continue
            tries += 1
            gain = (
                bits(self.classes(known)) - bits(self.classes(left)) - bits(self.classes(right))
            ) / total
            large = settings.z == "normal" or min(sizes) >= settings.min_objects - tolerance
            if gain > best + tolerance and large:
                best, chosen = gain, (low, high, sizes)
        if chosen is None:
            return None
        if settings.use_penalty:
            best -= math.log2(tries) / total
        if settings.require_gain and best <= tolerance:
            return None
        low, high, sizes = chosen
        split = bits([*sizes, total - known_weight]) / total
        return best, split, self.threshold(j, low, high)

    def threshold(self, j: int, low: float, high: float) -> float:
        """Return the greatest value of the whole training set up to the midpoint."""
        middle = low / 2 + high / 2
        if not low <= middle < high:
            return low
        if self.settings.z == "normal" and middle + 1e-6 < high:
            middle += 1e-6
        return max(row[j] for row, _, _ in self.cases if row[j] <= middle)

    def nominal(self, cases: list[Case], j: int, n: int) -> tuple[float, float, float] | None:
        """Return gain and split information of the test of a nominal attribute; no threshold."""
        known = [case for case in cases if not math.isnan(case[0][j])]
        if not known:
            return None
        total = sum(w for _, _, w in cases)
        parts = [[case for case in known if int(case[0][j]) == v] for v in range(n)]
        sizes = [sum(w for _, _, w in part) for part in parts]
        inside = sum(bits(self.classes(part)) for part in parts)
        unknown = total - sum(w for _, _, w in known)
        large = [size >= self.settings.min_objects - 1e-9 and size > 0 for size in sizes]
        gain = (bits(self.classes(known)) - inside) / total
        if sum(large) < 2:
            return None
        return gain, bits([*sizes, unknown]) / total, math.nan

    def prune(self, node: Node, cases: list[Case]) -> Node:
        """Return the pruned subtree; it is counted anew with these cases."""
        classes = self.classes(cases)
        if not node.children:
            return Node(classes)
        parts = divide(node, cases)
        children = [
            self.prune(child, part) for child, part in zip(node.children, parts, strict=True)
        ]
        node = Node(classes, node.feature, node.threshold, node.n_values, children)
        sizes = [sum(child.classes) for child in children]
        largest = max(i for i, size in enumerate(sizes) if size >= max(sizes) - 1e-9)
        leaf, tree = self.errors(classes), sum(map(self.estimate, children))
        branch = math.inf
        if self.settings.subtree_raising:
            branch = self.estimate(self.recount(children[largest], cases))
        if leaf <= branch + 0.1 + 1e-9 and leaf <= tree + 0.1 + 1e-9:
            return Node(classes)
        if branch <= tree + 0.1 + 1e-9:
            return self.prune(children[largest], cases)
        return node

    def recount(self, node: Node, cases: list[Case]) -> Node:
        """Return the same subtree with the classes of these cases."""
        parts = divide(node, cases) if node.children else []
        children = [self.recount(c, part) for c, part in zip(node.children, parts, strict=True)]
        return Node(self.classes(cases), node.feature, node.threshold, node.n_values, children)

    def estimate(self, node: Node) -> float:
        """Return the estimated errors of a subtree."""
        if node.children:
            return sum(map(self.estimate, node.children))
        return self.errors(node.classes)

    def errors(self, classes: list[float]) -> float:
        """Return the estimated errors of a leaf."""
        total = sum(classes)
        wrong = total - max(classes)
        return wrong + self.add_errors(total, wrong) if total > 1e-9 else 0.0

    def add_errors(self, n: float, e: float) -> float:
        """Return the errors to expect beyond the e seen (AddErrs)."""
        cf, z, normal = self.settings.confidence, self.settings.deviate, self.settings.z == "normal"
        e = 0.0 if e < 1e-9 else e
        if normal and cf > 0.5:
            return 0.0
        if e < (1 if normal else 0.9999):
            none = n * (1 - cf ** (1 / n))
            if e == 0 or (not normal and e < 1e-6):
                return none
            return none + e * (self.add_errors(n, 1.0) - none)
        if e + 0.5 >= n:
            return max(0.0, n - e if normal else 0.67 * (n - e))
        f = e + 0.5
        p = (f + z**2 / 2 + math.sqrt(z**2 * (f * (1 - f / n) + z**2 / 4))) / (n + z**2)
        return n * p - e


def divide(node: Node, cases: list[Case]) -> list[list[Case]]:
    """Return the cases of each branch; one with unknown value goes to all, in parts."""
    n = node.n_values or 2
    parts: list[list[Case]] = [[] for _ in range(n)]
    for case in cases:
        if (branch := node.branch(case[0])) is not None:
            parts[branch].append(case)
    sizes = [sum(w for _, _, w in part) for part in parts]
    total = sum(sizes)
    shares = [size / total if total else 1 / n for size in sizes]
    for row, label, weight in cases:
        if node.branch(row) is None:
            for part, share in zip(parts, shares, strict=True):
                if share > 0:
                    part.append((row, label, weight * share))
    return parts


def training_errors(node: Node) -> float:
    """Return the training errors of a subtree."""
    if node.children:
        return sum(map(training_errors, node.children))
    return sum(node.classes) - max(node.classes)


def bits(weights: list[float]) -> float:
    """Return the total weight times the entropy."""
    total = sum(weights)
    return sum(w * math.log2(total / w) for w in weights if w > 1e-9)


def predict(node: Node, row: tuple[float, ...], parent: Node | None = None) -> list[float]:
    """Return the class probabilities of a row."""
    if not node.children:
        source = node if sum(node.classes) > 0 or parent is None else parent
        return [w / sum(source.classes) for w in source.classes]
    branch = node.branch(row)
    if branch is not None:
        return predict(node.children[branch], row, node)
    sizes = [sum(child.classes) for child in node.children]
    shares = [0.0] * len(node.classes)
    for child, size in zip(node.children, sizes, strict=True):
        if size > 0:
            below = predict(child, row, node)
            shares = [s + size / sum(sizes) * p for s, p in zip(shares, below, strict=True)]
    return shares
