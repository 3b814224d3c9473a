"""C4.5 from a training set to a tree: grown level by level (release 8's ``FormTree``), pruned.

Each attribute is sorted once; a level costs O(d n) however many nodes it has.
"""

from dataclasses import dataclass, field, replace
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Int16s, Int32s, Integers, read_only
from eutree.c45 import _kernels, _kernels_pruning
from eutree.c45._kernels import Nodes
from eutree.c45.tree import C45Tree
from eutree.errors import InvalidArgumentError, warn
from eutree.features import threshold_between
from eutree.validation import (
    check_actions,
    check_choice,
    check_integer,
    check_number,
    check_numbers,
    check_truth,
    check_vector,
)

Dialect = Literal["table", "normal"]

# One-sided deviates as release 8 tabulates them; in between it interpolates linearly.
_LEVELS = (0.0, 0.001, 0.005, 0.01, 0.05, 0.10, 0.20, 0.40, 1.00)
_DEVIATES = (4.0, 3.09, 2.58, 2.33, 1.65, 1.28, 0.84, 0.25, 0.0)


@dataclass(frozen=True, kw_only=True)
class C45Settings:
    """Every choice of the learner; the defaults are those of C4.5 release 8.

    Attributes:
        min_objects: Least weight m of a branch; a node of less than 2 m is a leaf.
        confidence: CF, the confidence of the pessimistic error estimate; smaller prunes more.
        prune: Whether to prune by estimated errors.
        collapse: Whether a subtree that does not lower the training error becomes a leaf.
        subtree_raising: Whether pruning may replace a node by its largest branch.
        z: ``"table"`` for release 8; ``"normal"`` for Weka's J48 (see docs/c45.md).
        gap: A cut needs neighbours further apart than this; release 8 and J48 have 1e-5.
        use_min_split: Whether each side of a cut needs a tenth of the average class (2 to 25).
        use_penalty: Whether log2(tries) / N is taken off the gain of a continuous attribute.
        use_average_filter: Whether an attribute needs at least the average gain.
        require_gain: Whether a test needs a positive gain and a split information above 0.001.
    """

    min_objects: float = 2
    confidence: float = 0.25
    prune: bool = True
    collapse: bool = True
    subtree_raising: bool = True
    z: Dialect = "table"
    gap: float = 0.0
    use_min_split: bool = True
    use_penalty: bool = True
    use_average_filter: bool = True
    require_gain: bool = True

    def __post_init__(self) -> None:
        check_number("min_objects", self.min_objects, low=0)
        check_number("confidence", self.confidence, low=0, high=1)
        check_number("gap", self.gap, low=0)
        check_choice("z", self.z, ("table", "normal"))
        for name in ("prune", "collapse", "subtree_raising"):
            check_truth(name, getattr(self, name))

    @classmethod
    def lossless(cls) -> "C45Settings":
        """Return the settings under which distinct observations keep their actions exactly."""
        return replace(
            cls.unpruned(), min_objects=0, collapse=False, use_min_split=False, use_penalty=False,
            require_gain=False,
        )  # fmt: skip

    @classmethod
    def unpruned(cls) -> "C45Settings":
        """Return release 8 without pruning (``-u`` of J48); collapse is part of growing."""
        return cls(prune=False)

    @property
    def tolerance(self) -> float:
        """How much better a later candidate must be to win; ties go to the first."""
        return 1e-6 if self.z == "normal" else 1e-10

    @property
    def deviate(self) -> float:
        """The normal deviate z that belongs to ``confidence``."""
        if self.z == "normal":
            return NormalDist().inv_cdf(1 - self.confidence) if 0 < self.confidence < 1 else 0.0
        return float(np.interp(self.confidence, _LEVELS, _DEVIATES))


EPSILON = 1e-3  # release 8's tolerance: average filter, split information, collapse


@dataclass
class Training:
    """The training set before the first test."""

    observations: Floats  # [N, d]; numbers, codes of nominal values, NaN where unknown
    actions: Int16s  # [N]; class of each row
    weights: Floats  # [N]; weight of each row
    n_values: Int32s  # [d]; number of values of each nominal attribute; 0 for a continuous one
    n_classes: int
    table: Floats = field(init=False)  # [W + 1] x log2 x of whole weights; [0] if others exist

    def __post_init__(self) -> None:
        whole = np.array_equal(self.weights, np.floor(self.weights))
        total = self.weights.sum()
        small = whole and total <= 4 * len(self.weights) + 1000
        complete = not np.isnan(self.observations).any()
        self.table = _kernels.xlogx_table(int(total) + 2 if small and complete else 0)

    @property
    def counted(self) -> Booleans:
        """Whether the gain of each attribute counts in the average (not if of many values)."""
        few: Booleans = self.n_values < 0.3 * self.weights.sum()
        return few if few.any() else ~few


def best_reductions(observations: Floats, actions: Integers, weights: Floats) -> Floats:
    """Return by how many bits the best test of each attribute tells actions apart, shape [d].

    Args:
        observations: Numbers, shape [N, d].
        actions: Class of each row, shape [N].
        weights: Weight of each row, shape [N].
    """
    n_features = observations.shape[1]
    n_values, n_classes = np.zeros(n_features, dtype=np.int32), int(actions.max(initial=0)) + 1
    training = Training(
        np.ascontiguousarray(observations), actions.astype(np.int16), weights, n_values, n_classes
    )
    grower = _Grower(training, C45Settings())
    _, values, order = grower.lists
    found = np.zeros(n_features)
    for j in range(n_features):
        _, found[j], _, _, _ = _kernels.best_cut(
            values[j], order[j], grower.cases, training.table, np.empty((4, n_classes)),
            float(weights.sum()), grower.rules,
        )  # fmt: skip
    return found


def is_closed(distribution: Floats, settings: C45Settings) -> Booleans:
    """Return which nodes are leaves from the start: pure, or of less than 2 m."""
    total = distribution.sum(axis=1)
    other = total - distribution.max(axis=1)
    few = total < 2 * settings.min_objects - settings.tolerance
    closed: Booleans = few | (other <= settings.tolerance)
    return closed


class _Grower:
    """One growing tree: its finished levels, and the cases of the present one.

    In ``lists`` the cases of one node stand together, sorted within it.
    """

    def __init__(self, training: Training, settings: C45Settings) -> None:
        self.training, self.settings = training, settings
        nominal = training.n_values > 0
        self.list_of = (np.cumsum(~nominal) - 1).astype(np.int32)
        self.list_of[nominal] = (~nominal).sum()  # all nominal attributes share one list
        self.attributes = _kernels.Attributes(
            training.observations, training.n_values, training.counted, self.list_of
        )
        self.rules = _rules(settings)
        n_rows = len(training.actions)
        unit = bool((training.weights == 1).all())
        self.lists = self._sorted(np.flatnonzero(~nominal))
        self.cases = _kernels.Cases(
            row=np.arange(n_rows, dtype=np.int32),
            label=training.actions,
            weight=np.empty(0) if unit else training.weights.copy(),
        )
        self.sorted_values = self.lists.values.copy()  # [lists, N]

    def _sorted(self, continuous: Integers) -> _kernels.Lists:
        """Return all cases as those of one node."""
        n_rows, n_features = self.training.observations.shape
        n_lists = len(continuous) + (len(continuous) < n_features)
        order = np.empty((n_lists, n_rows), dtype=np.int32)
        values = np.zeros((n_lists, n_rows))
        order[-1] = np.arange(n_rows)
        for at, j in enumerate(continuous):
            column = np.ascontiguousarray(self.training.observations[:, j])
            order[at] = np.argsort(column, kind="stable")
            values[at] = column[order[at]]
        return _kernels.Lists(np.array([0, n_rows], dtype=np.int32), values, order)

    def grow(self) -> Nodes:
        """Grow level by level until every node is a leaf; return all nodes."""
        training = self.training
        root = np.bincount(training.actions, training.weights, minlength=training.n_classes)
        distribution = root[np.newaxis].astype(np.float64)
        levels: list[Nodes] = []
        n_nodes = 0
        while len(distribution):
            n_nodes += len(distribution)
            level, distribution = self._level(distribution, n_nodes)
            levels.append(level)
        return Nodes(*(np.concatenate(columns) for columns in zip(*levels, strict=True)))

    def _level(self, distribution: Floats, n_nodes: int) -> tuple[Nodes, Floats]:
        """Return the nodes of a level, tested where they are open, and their children's classes."""
        level = _leaves(distribution)
        where = np.flatnonzero(~is_closed(distribution, self.settings))
        if not len(where):
            return level, np.empty((0, distribution.shape[1]))
        feature, cut = self._choose(distribution[where])
        split, n_values = feature >= 0, self.training.n_values[feature]
        threshold = np.full(len(where), np.nan)
        for j in np.unique(feature[split & (n_values == 0)]):
            threshold[feature == j] = self._thresholds(j, cut[feature == j])
        forks = np.where(split, np.where(n_values > 0, n_values, 2), 0).astype(np.int32)
        offset = (np.cumsum(forks) - forks).astype(np.int32)
        tests = _kernels.Tests(feature, threshold, offset)
        children = self._divide(tests, forks, distribution[where])
        level.feature[where], level.threshold[where] = feature, threshold
        level.n_children[where] = forks
        level.first_child[where] = np.where(split, n_nodes + offset, -1)
        return level, children

    def _choose(self, distribution: Floats) -> _kernels.Chosen:
        training, n = self.training, len(distribution)
        chosen = _kernels.Chosen(np.empty(n, dtype=np.int32), np.full((n, 2), np.nan))
        _kernels.choose_tests(
            self.lists, distribution.sum(axis=1), self.attributes, self.cases, training.table,
            training.n_classes, self.rules, chosen,
        )  # fmt: skip
        return chosen

    def _thresholds(self, feature: int, cut: Floats) -> Floats:
        """Return the greatest training value up to the midpoint of each cut [n, 2].

        J48 also takes a value that is above the midpoint by less than its tolerance.
        """
        low, high = cut[:, 0], cut[:, 1]
        middle = np.array([threshold_between(*ends) for ends in cut.tolist()])
        if self.settings.z == "normal":
            above = middle + self.settings.tolerance
            middle = np.where((middle > low) & (above < high), above, middle)
        column = self.sorted_values[self.list_of[feature]]
        values: Floats = column[np.searchsorted(column, middle, side="right") - 1]
        return values

    def _divide(self, tests: _kernels.Tests, forks: Int32s, parents: Floats) -> Floats:
        """Make the cases of the next level; return the classes of all children [children, A].

        ``parents`` are those of the nodes that are divided, [n, A].
        """
        old, n_classes = self.lists, self.training.n_classes
        n_children = int(forks.sum())
        branch = np.empty(len(self.cases.row), dtype=np.int32)
        sizes = np.zeros(n_children, dtype=np.int32)
        children = np.zeros((n_children, n_classes))
        unknown_sizes = np.zeros(len(forks), dtype=np.int32)
        unknown = np.zeros((len(forks), n_classes))
        branches = _kernels.Branches(branch, sizes, children, unknown_sizes, unknown)
        _kernels.assign_branches(old, tests, self.attributes, self.cases, branches)
        parent = np.repeat(np.arange(len(forks)), forks)
        share = children.sum(axis=1) / (parents - unknown).sum(axis=1)[parent]
        children += share[:, np.newaxis] * unknown[parent]
        shared = share > 0
        copy = self._copy_unknown(branch, tests, forks, share)
        sizes += np.where(shared, unknown_sizes[parent], 0).astype(np.int32)
        opened = ~is_closed(children, self.settings)
        ends = np.cumsum(np.where(opened, sizes, 0))
        child_starts = (ends - np.where(opened, sizes, 0)).astype(np.int32)
        n_cases = int(ends[-1]) if n_children else 0
        room = len(old.order), n_cases
        new_values, new_order = np.empty(room), np.empty(room, dtype=np.int32)
        into = _kernels.Children(forks, copy, opened, shared, child_starts)
        _kernels.divide(old, tests, branch, into, new_values, new_order)
        starts = np.append(child_starts[opened], n_cases).astype(np.int32)
        self.lists = _kernels.Lists(starts, new_values, new_order)
        return children

    def _copy_unknown(
        self, branch: Int32s, tests: _kernels.Tests, forks: Int32s, share: Floats
    ) -> Int32s:
        """Append one case per branch for each case with unknown value; return the first of each."""
        (starts, _, order), (row, label, weight) = self.lists, self.cases
        copy = np.empty(len(branch), dtype=np.int32)
        n_cases = len(row)
        weight = weight if len(weight) else np.ones(n_cases)
        sources: list[Int32s] = []
        weights: list[Floats] = []
        for k in np.flatnonzero(tests.feature >= 0):
            members = order[self.list_of[tests.feature[k]], starts[k] : starts[k + 1]]
            members = members[branch[members] < 0]
            if len(members):
                copy[members] = n_cases + forks[k] * np.arange(len(members))
                n_cases += int(forks[k]) * len(members)
                sources.append(np.repeat(members, forks[k]))
                parts = share[tests.offset[k] : tests.offset[k] + forks[k]]
                weights.append((weight[members][:, np.newaxis] * parts).ravel())
        if sources:
            source = np.concatenate(sources)
            self.cases = _kernels.Cases(
                np.concatenate([row, row[source]]),
                np.concatenate([label, label[source]]),
                np.concatenate([weight, *weights]),
            )
        return copy


def _rules(settings: C45Settings) -> _kernels.Rules:
    """Return the settings as the kernel ``choose_tests`` reads them."""
    normal = settings.z == "normal"
    start = 0.0 if normal else -EPSILON
    epsilon = 1e-6 if normal else EPSILON
    return _kernels.Rules(
        min_objects=float(settings.min_objects),
        gap=float(settings.gap),
        tolerance=float(settings.tolerance),
        epsilon=epsilon if settings.require_gain else -np.inf,
        start_value=start if settings.require_gain else -np.inf,
        use_min_split=float(settings.use_min_split),
        use_penalty=float(settings.use_penalty),
        use_filter=float(settings.use_average_filter),
        greedy=float(not settings.require_gain),
        least=0.0 if normal else float(settings.min_objects),
    )


def _leaves(distribution: Floats) -> Nodes:
    n = len(distribution)
    feature, first_child = (np.full(n, -1, dtype=np.int32) for _ in range(2))
    n_children = np.zeros(n, dtype=np.int32)
    return Nodes(feature, np.full(n, np.nan), first_child, n_children, distribution)


def _collapse(nodes: Nodes) -> None:
    """Make a leaf of each node whose subtree makes no fewer errors on the training set."""
    own = nodes.distribution.sum(axis=1) - nodes.distribution.max(axis=1)
    errors = own.copy()
    for node in np.flatnonzero(nodes.feature >= 0)[::-1]:
        first = nodes.first_child[node]
        below = errors[first : first + nodes.n_children[node]].sum()
        if below >= own[node] - EPSILON:
            nodes.feature[node], nodes.threshold[node] = -1, np.nan
            nodes.n_children[node], nodes.first_child[node] = 0, -1
        else:
            errors[node] = below


def _compact(nodes: Nodes) -> Nodes:
    """Return the nodes that the root still reaches, numbered level by level."""
    kept = [np.array([0], dtype=np.int32)]
    while len(kept[-1]):
        inner = kept[-1][nodes.feature[kept[-1]] >= 0]
        first, forks = nodes.first_child[inner], nodes.n_children[inner]
        inside = np.arange(forks.sum()) - np.repeat(np.cumsum(forks) - forks, forks)
        kept.append((np.repeat(first, forks) + inside).astype(np.int32))
    old = np.concatenate(kept)
    new = np.full(len(nodes.feature), -1, dtype=np.int32)
    new[old] = np.arange(len(old), dtype=np.int32)
    tested = nodes.feature[old] >= 0
    return Nodes(
        feature=nodes.feature[old],
        threshold=np.where(tested, nodes.threshold[old], np.nan),
        first_child=np.where(tested, new[nodes.first_child[old]], -1).astype(np.int32),
        n_children=np.where(tested, nodes.n_children[old], 0).astype(np.int32),
        distribution=nodes.distribution[old],
    )


MOST_CLASSES = 2**15 - 1

_DEFAULT = C45Settings()


def warn_of_light(weights: Floats, least: float) -> None:
    """Warn of rows that weigh too little for a test with two branches, but are enough."""
    if weights.sum() < 2 * least <= len(weights):
        warn(
            f"the weights add up to {weights.sum():g}: no test has two branches of min_objects "
            f"{least:g}, so the tree is one leaf"
        )


def grow(
    observations: ArrayLike,
    actions: ArrayLike,
    *,
    n_classes: int,
    weights: ArrayLike | None = None,
    n_values: ArrayLike | None = None,
    settings: C45Settings = _DEFAULT,
) -> C45Tree:
    """Return the tree that C4.5 makes of a training set.

    Args:
        observations: Numbers, shape [N, d]; NaN where a value is unknown.
        actions: Class of each row, an integer in 0..n_classes - 1, shape [N].
        n_classes: Number of classes; it enters the least size of a branch.
        weights: Weight of each row, none negative; rows of weight 0 are left out. 1 by default.
        n_values: Number of values of each nominal attribute, whose column holds the codes
            0..n_values - 1; 0 for a continuous attribute. All are continuous by default.
        settings: Every choice of the learner; release 8 by default.

    Raises:
        InvalidArgumentError: If an argument is not as described, or no row has weight.
    """
    check_integer("n_classes", n_classes, low=1, high=MOST_CLASSES)
    rows = check_numbers("observations", observations, ndim=2)
    if not rows.shape[1]:
        raise InvalidArgumentError("observations must have at least one column, got none")
    if np.isinf(rows).any():
        place = ", ".join(map(str, np.argwhere(np.isinf(rows))[0]))
        raise InvalidArgumentError(f"observations must not be infinite, got infinity at [{place}]")
    labels = check_actions("actions", actions, size=len(rows))
    if labels.size and labels.max() >= n_classes:
        raise InvalidArgumentError(
            f"actions must be in 0..{n_classes - 1}, got {int(labels.max())}"
        )
    given = np.ones(len(rows)) if weights is None else weights
    weight = check_vector("weights", given, size=len(rows))
    if weight.size and weight.min() < 0:
        raise InvalidArgumentError(f"weights must not be negative, got {weight.min()}")
    used = weight > 0
    if not used.any():
        raise InvalidArgumentError("observations must have at least one row with weight, got none")
    if not used.all():
        rows, labels, weight = rows[used], labels[used], weight[used]
    values = np.zeros(rows.shape[1]) if n_values is None else np.asarray(n_values)
    training = Training(
        observations=read_only(rows),
        actions=labels.astype(np.int16),
        weights=weight.copy(),
        n_values=values.astype(np.int32),
        n_classes=n_classes,
    )
    nodes = _Grower(training, settings).grow()
    if settings.collapse:
        _collapse(nodes)
    if settings.prune:
        cases = _kernels_pruning.TrainingCases(
            training.observations, training.actions, training.weights
        )
        estimate = _kernels_pruning.ErrorEstimate(
            float(settings.confidence), settings.deviate, settings.z == "normal"
        )
        _kernels_pruning.prune(nodes, cases, estimate, settings.subtree_raising)
    return C45Tree(training.n_values, *_compact(nodes))
