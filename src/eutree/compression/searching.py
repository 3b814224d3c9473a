"""The best tree of each size that can be made of one, by common episodes.

From the tree down, size by size: of the trees that are left of a size the best few are kept, their
thresholds moved to where they earn most, and of these the smaller ones are made: a node gives way
to one of its children or to a single action, or the part below it is fitted again, by C4.5, to what
it decided where it was visited, in fewer boxes. Each size has starts of its own, so what was lucky
at one size has to prove itself at the next.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import C45Settings
from eutree.compression.candidates import by_c45, merged
from eutree.compression.costs import Costs
from eutree.compression.playing import CommonEpisodes, Outcome
from eutree.compression.pruning import Prunings
from eutree.policies import TreePolicy
from eutree.thresholds import threshold_between
from eutree.trees import DecisionTree
from eutree.trees.building import TreeBuilder
from eutree.trees.merging import INNER, rebuild

SHIFTS = (0.02, 0.06, 0.15, 0.35, 0.7)  # of the smaller side's rows
FEW = 20  # rows
BEAM = 2  # trees of a size that are tuned, and of which smaller ones are made
POOL = 5  # trees of a size that wait for their turn
SCREENED = 4  # of so many starts one is enough to see that a cut does harm
PASSES = 2  # over the thresholds of a tree
SURE = 0.7  # standard errors
FAILURE = 0.2  # of the range of returns, that a failed episode costs beside its return
REFITTED = 2  # leaves fewer than before, at most, where a part is fitted again

Check = Callable[[TreePolicy], TreePolicy]


class FrontSearch:
    """Finds the best tree of each size.

    Args:
        policy: The tree to begin with.
        common: Where trees run.
        budget: Environment steps; the search ends with the size at which they are used up.
        checked: What a tree becomes before it runs: with the locked leaves in it, or rounded.

    Attributes:
        common: As given.
        found: Trees of each size, the best first.
    """

    def __init__(
        self, policy: TreePolicy, common: CommonEpisodes, budget: int, checked: Check = merged
    ) -> None:
        self.common = common
        self._budget = budget
        self._checked = checked
        start = checked(policy)
        common.redraw(start)
        self._first = common.outcome.mean_return
        self._range = float(np.ptp(common.outcome.returns))
        self._pool: dict[int, list[tuple[float, TreePolicy]]] = {start.n_leaves: [(0.0, start)]}
        self.found: dict[int, list[TreePolicy]] = {}

    def run(self, least: int = 2, *, loses: float = 1.0) -> None:
        """Search from the largest size down to ``least`` leaves.

        Args:
            least: Fewest leaves.
            loses: Share of the range of returns: a size at which more is lost is the last one.
        """
        size, lost = max(self._pool), 0.0
        while size >= least and self.common.ground.steps < self._budget and lost <= loses:
            waiting = [one for _, one in self._pool.pop(size, [])]
            if waiting:
                self.common.redraw(waiting[0])
                for parent in [self._tuned(one) for one in self._best(waiting, BEAM)]:
                    self.found.setdefault(parent.n_leaves, []).append(parent)
                    self._add(self._smaller(parent))
                lost = (self._first - self.common.outcome.mean_return) / max(self._range, 1e-12)
            size -= 1

    def worth(self, outcome: Outcome) -> Floats:
        """Return what each episode is worth: its return, less a price where it failed, [E]."""
        if outcome.successes is None:
            return outcome.returns
        return outcome.returns - FAILURE * self._range * ~outcome.successes

    def _best(self, rivals: Sequence[TreePolicy], n: int) -> list[TreePolicy]:
        """Return the best few, each of which does something else."""
        found: dict[bytes, tuple[float, TreePolicy]] = {}
        for rival, outcome in zip(rivals, self.common.outcomes(rivals), strict=True):
            worth = self.worth(outcome)
            found.setdefault(worth.tobytes(), (float(worth.mean()), rival))
        return [one for _, one in sorted(found.values(), key=lambda one: -one[0])[:n]]

    def _add(self, rivals: Sequence[TreePolicy]) -> None:
        """Let the best of each size wait for their turn; losers leave early."""
        few = self.common.n // SCREENED
        first = [float(self.worth(one).mean()) for one in self.common.outcomes(rivals, few)]
        by_size: dict[int, list[int]] = {}
        for k in np.argsort(-np.array(first), kind="stable").tolist():
            by_size.setdefault(rivals[k].n_leaves, []).append(k)
        left = [k for numbers in by_size.values() for k in numbers[: 2 * POOL]]
        outcomes = self.common.outcomes([rivals[k] for k in left])
        for k, outcome in zip(left, outcomes, strict=True):
            waiting = self._pool.setdefault(rivals[k].n_leaves, [])
            worth = float(self.worth(outcome).mean())
            if all(worth != known for known, _ in waiting):
                waiting.append((worth, rivals[k]))
                waiting.sort(key=lambda one: -one[0])
                del waiting[POOL:]

    def _tuned(self, policy: TreePolicy) -> TreePolicy:
        """Return the tree with thresholds moved to where it earns more.

        Some starts choose a place for each test, all have to confirm it.
        """
        common = self.common
        common.run(policy)
        for _ in range(PASSES):
            moves = [(node, at) for node, places in _places(common) for at in places]
            rivals = [_moved(common.present, node, at) for node, at in moves]
            gains = self._gains(rivals, common.n // SCREENED).mean(axis=1)
            order = [k for k in np.argsort(-gains, kind="stable").tolist() if gains[k] > 0.0]
            first = {moves[k][0]: k for k in reversed(order)}  # the best of each test
            accepted = 0
            for k in sorted(first.values(), key=order.index):
                rival = _moved(common.present, *moves[k])
                gain = self._gains([rival])[0]
                if gain.mean() > SURE * gain.std() / np.sqrt(gain.size):
                    common.run(rival)
                    accepted += 1
            if not accepted:
                break
        return self._checked(common.present)

    def _gains(self, rivals: Sequence[TreePolicy], n: int | None = None) -> Floats:
        """Return what each rival is worth more than the present tree, shape [rivals, n]."""
        own = self.worth(self.common.outcome)[:n]
        found = [self.worth(one) - own for one in self.common.outcomes(rivals, n)]
        return np.array(found).reshape(len(rivals), own.size)

    def _smaller(self, policy: TreePolicy) -> list[TreePolicy]:
        """Return smaller trees made of one."""
        self.common.run(policy)
        rivals = [*_cuts(policy), *_refitted(self.common)]
        return [one for one in map(self._checked, rivals) if one.n_leaves < policy.n_leaves]


def _inner(tree: DecisionTree) -> list[int]:
    nodes: list[int] = np.flatnonzero(tree.feature != tree.NO_FEATURE).tolist()
    return nodes


def _places(common: CommonEpisodes) -> Iterator[tuple[int, list[float]]]:
    """Yield inner nodes with thresholds a share of the smaller side's rows away, on both sides."""
    tree, features = common.present.tree, common.traces.features
    leaves = tree.leaf_index(features)
    for node in _inner(tree):
        values = np.sort(features[_below(tree, node)[leaves], tree.feature[node]])
        if values.size < FEW:
            continue
        at = int(np.searchsorted(values, tree.threshold[node], side="right"))
        reach = min(values.size, 2 * min(at, values.size - at) + FEW)
        places = {at + sign * max(1, int(share * reach)) for share in SHIFTS for sign in (-1, 1)}
        ends = [values[k - 1 : k + 1].tolist() for k in sorted(places) if 1 <= k < values.size]
        yield node, [threshold_between(*two) for two in ends]


def _below(tree: DecisionTree, node: int) -> Booleans:
    """Return which leaves are below a node, shape [L]."""
    inside = np.zeros(tree.n_nodes, dtype=bool)
    inside[node] = True
    for child in range(node + 1, tree.n_nodes):
        inside[child] = inside[tree.parent[child]]
    below: Booleans = inside[tree.node_of_leaf]
    return below


def _moved(policy: TreePolicy, node: int, at: float) -> TreePolicy:
    """Return the tree with another threshold at a node."""
    threshold = policy.tree.threshold.copy()
    threshold[node] = at
    return _with(policy, replace(policy.tree, threshold=threshold), policy.actions)


def _with(policy: TreePolicy, tree: DecisionTree, actions: Integers) -> TreePolicy:
    return replace(policy, tree=tree, actions=actions, leaves=None, locked=())


def _cuts(policy: TreePolicy) -> Iterator[TreePolicy]:
    """Yield the tree with a node replaced by a child, or by an action."""
    tree = policy.tree
    label = np.full(tree.n_nodes, INNER, dtype=np.int64)
    label[tree.node_of_leaf] = policy.actions
    own = np.arange(tree.n_nodes)
    for node in _inner(tree):
        for child in (tree.left[node], tree.right[node]):
            source = own.copy()
            source[node] = child
            yield _with(policy, *rebuild(tree, source, label))
        for action in np.unique(policy.actions[_below(tree, node)]).tolist():
            instead = label.copy()
            instead[node] = action
            yield _with(policy, *rebuild(tree, own, instead))


def _refitted(common: CommonEpisodes) -> Iterator[TreePolicy]:
    """Yield the tree with a part fitted again to what it decided, in fewer leaves."""
    policy, features = common.present, common.traces.features
    tree = policy.tree
    leaves = tree.leaf_index(features)
    for node in _inner(tree):
        below = _below(tree, node)
        size = int(below.sum())
        rows = features[below[leaves]]
        if size < 4 or len(rows) < FEW:
            continue
        grown = by_c45(policy, rows, C45Settings.unpruned())
        prunings = Prunings(grown, Costs.of(policy, rows, "visits"))
        for smaller in range(1, REFITTED + 1):
            part = prunings.of_size(min(size - smaller, prunings.costs.size))
            yield _with(policy, *_with_part(policy, node, part))


def _with_part(policy: TreePolicy, node: int, part: TreePolicy) -> tuple[DecisionTree, Integers]:
    """Return the tree with another tree in the place of a node."""
    built = TreeBuilder(policy.tree.n_features)
    work = [(policy, 0, -1, 0)]
    while work:
        of, at, parent, side = work.pop()
        if of is policy and at == node:
            of, at = part, 0
        tree = of.tree
        if tree.feature[at] == tree.NO_FEATURE:
            built.leaf(int(of.actions[tree.leaf[at]]), parent=parent, side=side)
            continue
        test = int(tree.feature[at]), float(tree.threshold[at])
        number = built.test(*test, parent=parent, side=side)
        work += [(of, int(tree.right[at]), number, 1), (of, int(tree.left[at]), number, 0)]
    return built.build()
