"""The best tree of each size that can be made of one, by common episodes.

From the tree down, size by size: of the trees that are left of a size the best few are kept, their
thresholds moved to where they earn most, and of these the smaller ones are made: a node gives way
to one of its children or to a single action, or the part below it is fitted again, by C4.5, to its
own decisions where it was visited, in fewer boxes. Each size has starts of its own, so a tree lucky
at one size has to prove itself at the next.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from eutree.arrays import Booleans
from eutree.c45 import C45Settings
from eutree.compression.playing import PairedEpisodes, moved
from eutree.compression.smaller_trees import Costs, Prunings, by_c45, merged, with_tree
from eutree.features import threshold_between
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.edit import INNER, graft, rebuild

SHIFTS = (0.02, 0.06, 0.15, 0.35, 0.7)  # of the smaller side's rows
FEW = 20  # rows
BEAM = 2  # trees of a size that are tuned, and of which smaller ones are made
POOL = 5  # trees of a size that wait for their turn
PASSES = 2  # over the thresholds of a tree
SURE = 0.7  # standard errors
REFITTED = 2  # leaves fewer than before, at most, where a part is fitted again

Check = Callable[[TreePolicy], TreePolicy]


class FrontSearch:
    """Finds the best tree of each size."""

    def __init__(
        self,
        policies: Sequence[TreePolicy],  # to begin with; the first shows the range of returns
        episodes: PairedEpisodes,  # in which trees are compared
        budget: int,  # steps; the search ends with the size at which they are used up
        checked: Check = merged,  # before a tree runs: puts the locked leaves in, or rounds it
    ) -> None:
        self.episodes = episodes
        self._budget = budget
        self._checked = checked
        self._pool: dict[int, list[tuple[float, TreePolicy]]] = {}
        for start in map(checked, policies):
            self._pool.setdefault(start.n_leaves, []).append((0.0, start))
        episodes.redraw(checked(policies[0]))
        self._first = episodes.mean_return
        self.found: dict[int, list[TreePolicy]] = {}  # of each size, the best first

    def run(self, least: int = 2, *, loses: float = 1.0) -> None:
        """Search from the largest size down to ``least`` leaves.

        A size at which more than the share ``loses`` of the range of returns is lost is the last.
        """
        size, lost = max(self._pool), 0.0
        scale = max(self.episodes.scale or 0.0, 1e-12)
        while size >= least and self.episodes.steps < self._budget and lost <= loses:
            waiting = [one for _, one in self._pool.pop(size, [])]
            if waiting:
                self.episodes.redraw(waiting[0])
                for parent in [self._tuned(one) for one in self._best(waiting, BEAM)]:
                    self.found.setdefault(parent.n_leaves, []).append(parent)
                    self.episodes.run(parent)
                    made = map(self._checked, [*_cuts(parent), *_refitted(self.episodes)])
                    smaller = [one for one in made if one.n_leaves < parent.n_leaves]
                    self._add(smaller, above=-loses * scale)
                lost = (self._first - self.episodes.mean_return) / scale
            size -= 1

    def waiting(self) -> dict[int, list[TreePolicy]]:
        """Return the trees of each size that have not had their turn, the best first."""
        return {size: [one for _, one in trees] for size, trees in self._pool.items() if trees}

    def _best(self, challengers: Sequence[TreePolicy], n: int) -> list[TreePolicy]:
        """Return the best few, each of which does something else."""
        found: dict[tuple[float, float], TreePolicy] = {}
        for challenger, gain in zip(challengers, self.episodes.gains(challengers), strict=True):
            found.setdefault((gain.mean, gain.error), challenger)
        return [one for _, one in sorted(found.items(), key=lambda one: -one[0][0])[:n]]

    def _add(self, challengers: Sequence[TreePolicy], above: float) -> None:
        """Let the best of each size wait for their turn; losers leave early."""
        first = [one.mean for one in self.episodes.gains(challengers, few=True, above=above)]
        by_size: dict[int, list[int]] = {}
        for k in np.argsort(-np.array(first), kind="stable").tolist():
            by_size.setdefault(challengers[k].n_leaves, []).append(k)
        left = [k for numbers in by_size.values() for k in numbers[: 2 * POOL]]
        gains = self.episodes.gains([challengers[k] for k in left], above=above)
        for k, gain in zip(left, gains, strict=True):
            waiting = self._pool.setdefault(challengers[k].n_leaves, [])
            if all(gain.mean != known for known, _ in waiting):
                waiting.append((gain.mean, challengers[k]))
                waiting.sort(key=lambda one: -one[0])
                del waiting[POOL:]

    def _tuned(self, policy: TreePolicy) -> TreePolicy:
        """Return the tree with thresholds moved to where it earns more.

        Some starts choose a place for each test, all have to confirm it.
        """
        episodes = self.episodes
        episodes.run(policy)
        for _ in range(PASSES):
            moves = [(node, at) for node, places in _places(episodes) for at in places]
            gains = np.array([one.mean for one in episodes.gains_of_moves(moves, few=True)])
            order = [k for k in np.argsort(-gains, kind="stable").tolist() if gains[k] > 0.0]
            first = {moves[k][0]: k for k in reversed(order)}  # the best of each test
            before = episodes.present
            for k in sorted(first.values(), key=order.index):
                (gain,) = episodes.gains_of_moves([moves[k]])
                if gain.mean > SURE * gain.error:
                    episodes.run(moved(episodes.present, *moves[k]))
            if episodes.present is before:
                break
        return self._checked(episodes.present)


def _inner(tree: DecisionTree) -> list[int]:
    nodes: list[int] = np.flatnonzero(tree.feature != tree.NO_FEATURE).tolist()
    return nodes


def _places(episodes: PairedEpisodes) -> Iterator[tuple[int, list[float]]]:
    """Yield inner nodes with thresholds a share of the smaller side's rows away, on both sides."""
    tree, features = episodes.present.tree, episodes.features
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
            yield with_tree(policy, *rebuild(tree, source, label))
        for action in np.unique(policy.actions[_below(tree, node)]).tolist():
            instead = label.copy()
            instead[node] = action
            yield with_tree(policy, *rebuild(tree, own, instead))


def _refitted(episodes: PairedEpisodes) -> Iterator[TreePolicy]:
    """Yield the tree with a part fitted again to its own decisions, in fewer leaves."""
    policy, features = episodes.present, episodes.features
    tree = policy.tree
    leaves = tree.leaf_index(features)
    for node in _inner(tree):
        below = _below(tree, node)
        size = int(below.sum())
        rows = features[below[leaves]]
        if size < 4 or len(rows) < FEW:
            continue
        kept = {leaf: int(policy.actions[leaf]) for leaf in np.flatnonzero(~below).tolist()}
        grown = by_c45(policy, rows, C45Settings.unpruned())
        prunings = Prunings(grown, Costs.of(policy, rows, "visits"))
        for smaller in range(1, REFITTED + 1):
            part = prunings.of_size(min(size - smaller, prunings.costs.size))
            yield with_tree(policy, *graft(tree, kept, part.tree, part.actions)[:2])
