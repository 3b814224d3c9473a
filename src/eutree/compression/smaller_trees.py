"""The smaller trees that a compression chooses among."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.c45 import C45Settings
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.policies import TreePolicy
from eutree.policies.reach import with_actions, with_pieces, within_kinds
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.trees.boxes import node_boxes, possible_nodes
from eutree.trees.edit import INNER, graft, holding, merge, reachable, rebuild
from eutree.validation import check_number

WEIGHTS = ("visits", "q-gap")


@dataclass(frozen=True, eq=False)
class Costs:
    """Cost of each action on each recorded observation."""

    rows: Floats  # [N, d]; the recorded observations
    of_action: Floats  # [N, A]; cost of each action on each of them; 0 for the policy's own
    worst: float  # cost of the most expensive decisions, of which costs are a share

    @classmethod
    def of(cls, policy: TreePolicy, rows: Floats, weights: str) -> "Costs":
        """Return the costs of other decisions than the policy's.

        ``"visits"``: 1 for every other action, so that a share of the worst is a share of the
        recorded observations. ``"q-gap"``: Q(s, own action) - Q(s, a), never below 0, with the Q
        of the policy's leaves; an action that was never tried counts as the worst of its leaf,
        and a leaf without any other values like the mean leaf.
        """
        leaves = policy.tree.leaf_index(rows)
        others = np.not_equal.outer(policy.actions, np.arange(policy.schema.n_actions))
        per_leaf = others.astype(np.float64) if weights == "visits" else _gaps(policy)
        of_action = per_leaf[leaves]
        return cls(rows, of_action, float(of_action.max(axis=1, initial=0.0).sum()))

    def of_leaves(self, tree: DecisionTree) -> Floats:
        """Return the cost of each action at each leaf of a tree, shape [L, A]."""
        total = np.zeros((tree.n_leaves, self.of_action.shape[1]))
        np.add.at(total, tree.leaf_index(self.rows), self.of_action)
        return total

    def share(self, tree: DecisionTree, actions: Integers) -> float:
        """Return the cost of deciding by a tree, as a share of the worst; 0 if nothing costs."""
        if self.worst <= 0.0:
            return 0.0
        leaves = tree.leaf_index(self.rows)
        return float(self.of_action[np.arange(leaves.size), actions[leaves]].sum()) / self.worst


def _gaps(policy: TreePolicy) -> Floats:
    """Return Q(s, own action) - Q(s, a) of each leaf, with unknown values filled in."""
    if policy.leaves is None or not policy.leaves.compares_actions:
        raise InvalidArgumentError(
            'weights must be "visits" for a policy without values of two actions in a leaf, '
            'got "q-gap"'
        )
    values, own = policy.leaves.values, np.arange(policy.n_leaves)
    gap = np.maximum(values[own, policy.actions][:, np.newaxis] - values, 0.0)  # [L, A]
    gap[own, policy.actions] = np.nan
    known = ~np.isnan(gap)
    mean = float(gap[known].mean()) if known.any() else 1.0
    worst = np.where(known, gap, -np.inf).max(axis=1, initial=-np.inf)
    worst = np.where(known.any(axis=1), worst, mean)
    filled = np.where(known, gap, worst[:, np.newaxis])
    filled[own, policy.actions] = 0.0
    return filled


# A pruning turns some inner nodes into leaves. The cost of the leaves of a subtree does not depend
# on the rest of the tree, so the best pruning of every size follows bottom-up from those of the
# two subtrees (the knapsack on trees): exact, in time proportional to the square of the leaves.


class Prunings:
    """All best prunings of one policy.

    Their ``costs`` are the least with 1, 2, ... leaves, in that order, and never rise.
    """

    def __init__(self, policy: TreePolicy, costs: Costs) -> None:
        tree = policy.tree
        self.policy = policy
        self._total = tree.totals(costs.of_leaves(tree))  # [M, A]
        self._best: list[Floats] = [np.empty(0)] * tree.n_nodes
        for node in range(tree.n_nodes - 1, -1, -1):  # children have larger numbers
            alone = np.array([self._total[node].min()])
            if tree.feature[node] != tree.NO_FEATURE:
                split = _combined(self._best[tree.left[node]], self._best[tree.right[node]])
                alone = np.minimum.accumulate(np.concatenate([alone, split]))
            self._best[node] = alone
        self.costs = self._best[0]

    def of_size(self, n_leaves: int) -> TreePolicy:
        """Return the cheapest pruning with at most so many leaves."""
        return with_tree(self.policy, *self._pruned(n_leaves))

    def _pruned(self, n_leaves: int) -> tuple[DecisionTree, Integers]:
        """Return its tree, and which column of the costs each leaf has, [L]."""
        tree = self.policy.tree
        label = np.full(tree.n_nodes, INNER, dtype=np.int64)
        work = [(0, n_leaves)]
        while work:
            node, size = work.pop()
            left, right = int(tree.left[node]), int(tree.right[node])
            cost = self._best[node][size - 1]
            size = int((self._best[node] <= cost).argmax()) + 1  # no leaf for nothing
            if self._total[node].min() <= cost:
                label[node] = self._total[node].argmin()
                continue
            ones, others = self._best[left], self._best[right]
            lefts = np.arange(max(1, size - others.size), min(ones.size, size - 1) + 1)
            sums = ones[lefts - 1] + others[size - lefts - 1]
            chosen = int(lefts[sums.argmin()])
            work += [(left, chosen), (right, size - chosen)]
        return rebuild(tree, np.arange(tree.n_nodes), label)


class _OrderPrunings(Prunings):
    """Those of a policy under masks: each leaf prefers all actions as one of its leaves does."""

    def __init__(self, policy: TreePolicy, costs: Costs) -> None:
        self._orders, own = np.unique(policy.orders, axis=0, return_inverse=True)
        others = np.not_equal.outer(own.reshape(-1), np.arange(len(self._orders)))
        of_order = others[policy.tree.leaf_index(costs.rows)] * costs.of_action.max(axis=1)[:, None]
        super().__init__(policy, replace(costs, of_action=of_order))

    def of_size(self, n_leaves: int) -> TreePolicy:
        """Return the cheapest pruning with at most so many leaves."""
        tree, labels = self._pruned(n_leaves)
        orders = self._orders[labels]
        ranks = np.argsort(orders, axis=1)
        return replace(with_tree(self.policy, tree, orders[:, 0]), ranks=ranks)


def without_unreached(policy: TreePolicy, rows: Floats) -> TreePolicy:
    """Return the policy without the tests that all recorded observations answer alike."""
    counts = np.bincount(policy.tree.leaf_index(rows), minlength=policy.n_leaves)
    tree, leaves = reachable(policy.tree, policy.tree.totals(counts) > 0)
    return with_tree(policy, tree, policy.actions[leaves])


def _combined(left: Floats, right: Floats) -> Floats:
    """Return the least cost of both subtrees together with 2, 3, ... leaves."""
    if left.size > right.size:
        left, right = right, left
    best = np.full(left.size + right.size - 1, np.inf)
    for size, cost in enumerate(left.tolist()):
        part = best[size : size + right.size]
        np.minimum(part, cost + right, out=part)
    return best


def with_tree(policy: TreePolicy, tree: DecisionTree, actions: Integers) -> TreePolicy:
    """Return the policy with another tree, of which nothing is counted or locked yet."""
    return replace(policy, tree=tree, actions=actions, leaves=None, ranks=None, locked=())


# Where some decisions may change: release 8 pruned ever more, in case less is enough.
_CONFIDENCES = (0.25, 0.05, 0.005)


def merged(policy: TreePolicy) -> TreePolicy:
    """Return the policy with equal siblings joined: the same decision on all that can be.

    Under masks leaves are equal that prefer all actions in the same order.
    """
    if policy.masked:
        return policy if policy.locked else _joined(policy)
    policy = within_kinds(with_tree(policy, policy.tree, policy.actions))
    tree, actions = merge(policy.tree, policy.actions)
    return replace(policy, tree=tree, actions=actions)


def _joined(policy: TreePolicy) -> TreePolicy:
    """Return the policy with siblings of one order joined, if all leaves keep theirs then."""
    orders, one, labels = np.unique(policy.orders, axis=0, return_index=True, return_inverse=True)
    tree, kept = merge(policy.tree, labels.reshape(-1))
    found = with_pieces(policy, tree, one[kept])
    return found if (found.orders == orders[kept]).all() else policy


def with_locks(changed: TreePolicy, policy: TreePolicy) -> TreePolicy:
    """Return ``changed`` with the locked leaves of ``policy`` in it: their boxes and actions."""
    if not policy.locked or changed.locked:
        return changed
    n_actions = policy.schema.n_actions
    marks = {leaf: n_actions + leaf for leaf in policy.locked}  # one label each: never joined
    tree, labels, stay = graft(policy.tree, marks, changed.tree, changed.actions)
    tree, leaves = reachable(tree, holding(tree, stay) | possible_nodes(tree, policy.schema))
    tree, labels = merge(tree, labels[leaves])
    actions = np.concatenate([np.arange(n_actions), policy.actions])[labels]
    kept = with_actions(policy, policy.actions)  # under masks, too
    found = with_pieces(kept, tree, np.maximum(labels - n_actions, -1))
    return replace(found, actions=actions, leaves=None)


def by_c45(policy: TreePolicy, rows: Floats, settings: C45Settings) -> TreePolicy:
    """Return the tree of C4.5 on the recorded observations, labelled by the policy."""
    from eutree.c45 import grow

    labels = policy.actions[policy.tree.leaf_index(rows)]
    grown = grow(rows, labels, n_classes=policy.schema.n_actions, settings=settings)
    return merged(with_tree(policy, *grown.to_decision_tree()))


def lossless(policy: TreePolicy, rows: Floats) -> dict[str, TreePolicy]:
    """Return the ways that keep the decision on every recorded observation."""
    return {
        "merge": merged(policy),
        "drop": merged(without_unreached(merged(policy), rows)),
        "lossless": by_c45(policy, rows, C45Settings.lossless()),
    }


class Ladder:
    """For each number of leaves the cheapest tree among the prunings of several trees."""

    def __init__(self, policy: TreePolicy, costs: Costs) -> None:
        trees = [
            *lossless(policy, costs.rows).values(),
            by_c45(policy, costs.rows, C45Settings.unpruned()),
            *(by_c45(policy, costs.rows, C45Settings(confidence=cf)) for cf in _CONFIDENCES),
        ]
        self._prunings = [Prunings(tree, costs) for tree in trees]
        self._worst = costs.worst

    def within(self, share: float) -> TreePolicy:
        """Return the smallest tree that costs at most ``share`` of the worst."""
        limit = share * self._worst * (1 + 1e-12)
        sizes = [
            (int((prunings.costs <= limit).argmax()) + 1, float(prunings.costs.min()), number)
            for number, prunings in enumerate(self._prunings)
            if prunings.costs.min() <= limit
        ]
        size, _, number = min(sizes)
        return self._prunings[number].of_size(size)

    def of_size(self, n_leaves: int) -> TreePolicy:
        """Return the cheapest tree of at most so many leaves."""
        prunings = self._cheapest(n_leaves)[1]
        return prunings.of_size(min(n_leaves, prunings.costs.size))

    def rungs(self) -> list[TreePolicy]:
        """Return the cheapest tree of every size that is worth it, the smallest first."""
        rungs: list[TreePolicy] = []
        least = float("inf")
        for size in range(1, max(p.costs.size for p in self._prunings) + 1):
            cost = self._cheapest(size)[0]
            if cost < least:
                rungs.append(self.of_size(size))
                least = cost
            if cost <= 0.0:
                break
        return rungs

    def _cheapest(self, n_leaves: int) -> tuple[float, Prunings]:
        """Return the least cost with at most so many leaves, and whose it is."""
        costs = [float(p.costs[min(n_leaves, p.costs.size) - 1]) for p in self._prunings]
        return min(costs), self._prunings[costs.index(min(costs))]


class OrderLadder(Ladder):
    """That of a policy whose actions may be masked, which orders them all in each leaf.

    What is masked where is not known, so another order than the leaf's costs the observation's
    worst. Trees of C4.5 have no such orders: the policy's own alone is pruned.
    """

    def __init__(self, policy: TreePolicy, costs: Costs) -> None:
        self._prunings = [_OrderPrunings(merged(policy), costs)]
        self._worst = costs.worst


# Between the recorded values on both sides of a test, any threshold decides them alike. Of all
# numbers there with the fewest significant digits the one nearest to the old threshold is taken.
# A threshold also stays between those of the tests above it, so that no leaf becomes empty, and
# one that bounds a locked leaf stays as it is.
#
# Where a feature has a step (0.1 of a degree), its thresholds become multiples of it: ``<=`` or
# ``<`` the nearest one that decides every recorded observation alike, or else the nearest at all.
# Tests that then decide nothing are dropped.


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
    """Return the policy with short thresholds; each recorded observation [N, d] keeps its leaf.

    The thresholds of features with ``steps`` become multiples of these, and others stay; recorded
    observations between the old and the new threshold then change their leaf. Without any, all
    thresholds become as short as they may.
    """
    steps = steps or {}
    tree = policy.tree
    threshold = np.array(tree.threshold)
    held = holding(tree, policy.locked)
    members: dict[int, Integers] = {0: np.arange(len(rows))}
    for node in np.flatnonzero(tree.feature != tree.NO_FEATURE).tolist():  # parents first
        feature, cut = int(tree.feature[node]), float(tree.threshold[node])
        mine = members.pop(node)
        values = rows[mine, feature]
        members[int(tree.left[node])] = mine[values <= cut]
        members[int(tree.right[node])] = mine[values > cut]
        if held[node] or (steps and feature not in steps):
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
    for side in (ends, [float(np.nextafter(end, -np.inf)) for end in ends]):
        for number in side:
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
