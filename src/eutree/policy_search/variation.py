"""Random changes of a policy tree, at places that its episodes visit."""

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.compiled import compiled
from eutree.features import threshold_between
from eutree.world_model import ActionTree, leaf_node
from eutree.world_model.action_trees import n_leaves, nested, packed, with_box, with_child

SHIFTS = (0.015, 0.05, 0.15, 0.45)  # of the visited observations that change sides, at most
MORE = 0.4  # chance of one more change
GRAFTED = 0.1  # chance that a branch of a mate is taken over
BOX_ROWS = 300  # looked at for the other edges of a box


class Variation:
    """Makes variants of a policy tree."""

    def __init__(self, n_actions: int, max_leaves: int, generator: np.random.Generator) -> None:
        self._n_actions = n_actions
        self._max_leaves = max_leaves
        self._generator = generator
        self._ways = (
            self._perturb_thresholds,
            self._flip_label,
            self._insert_boxes,
            self._replace_subtrees,
        )

    def of(
        self, tree: ActionTree, visited: Floats, mate: ActionTree | None = None
    ) -> ActionTree | None:
        """Return a variant; None if it came out too large or too small.

        Args:
            tree: The policy.
            visited: Observations of its episodes, shape [K, d].
            mate: Another policy, of which a branch may be taken over.
        """
        changed = mate is not None and self._generator.random() < GRAFTED
        if mate is not None and changed:
            node, source = (self._generator.integers(one.feature.size) for one in (tree, mate))
            tree = packed(nested(tree, instead={int(node): nested(mate, int(source))}))
        while not changed or self._generator.random() < MORE:
            way = self._generator.choice(4, p=(0.4, 0.1, 0.3, 0.2))
            tree, changed = packed(nested(self._ways[way](tree, visited))), True
        return tree if 2 <= n_leaves(tree) <= self._max_leaves else None

    def _perturb_thresholds(self, tree: ActionTree, visited: Floats) -> ActionTree:
        inner = np.flatnonzero(tree.feature >= 0)
        if not inner.size:
            return tree
        node = self._generator.choice(inner)
        values = visited[:, tree.feature[node]]
        at = int(np.count_nonzero(values < tree.threshold[node]))
        reach = values.size * self._generator.choice(SHIFTS) * self._generator.random()
        at += int(self._generator.choice((-1, 1)) * max(1.0, reach))
        at = int(np.clip(at, 1, values.size - 1))
        thresholds = tree.threshold.copy()
        values = np.partition(values, (at - 1, at))  # sorted there: all that is read
        thresholds[node] = threshold_between(*values[at - 1 : at + 1].tolist())
        return tree._replace(threshold=thresholds)

    def _flip_label(self, tree: ActionTree, visited: Floats) -> ActionTree:
        leaf = self._generator.choice(np.flatnonzero(tree.feature < 0))
        actions = tree.action.copy()
        actions[leaf] = self._other(actions[leaf])
        return tree._replace(action=actions)

    def _insert_boxes(self, tree: ActionTree, visited: Floats) -> ActionTree:
        x = visited[self._generator.integers(len(visited))]
        leaf = leaf_node(tree, 0, x)
        some = visited[self._generator.integers(len(visited), size=BOX_ROWS)]
        near = inside if len(inside := some[_in_leaf(tree, leaf, some)]) else x[None]
        box = np.full((x.size, 2), (-np.inf, np.inf))
        n_features = min(int(self._generator.choice((1, 1, 2))), x.size)
        for feature in self._generator.choice(x.size, n_features, replace=False):
            edge = near[self._generator.integers(len(near))][feature]
            if edge != x[feature]:
                box[feature, int(edge > x[feature])] = edge
        taken = int(tree.action[leaf])
        return packed(nested(tree, instead={int(leaf): with_box(box, self._other(taken), taken)}))

    def _replace_subtrees(self, tree: ActionTree, visited: Floats) -> ActionTree:
        inner = np.flatnonzero(tree.feature >= 0)
        if not inner.size:
            return tree
        node = int(self._generator.choice(inner))
        return with_child(tree, node, goes_left=bool(self._generator.random() < 0.5))[0]

    def _other(self, action: int) -> int:
        others = [a for a in range(self._n_actions) if a != action]
        return int(self._generator.choice(others))


@compiled
def _in_leaf(tree: ActionTree, leaf: int, observations: Floats) -> Booleans:
    """Return which of the observations [K, d] fall into the leaf, shape [K]."""
    inside = np.zeros(len(observations), dtype=np.bool_)
    for row in range(len(observations)):  # inside[:row] is decided
        inside[row] = leaf_node(tree, 0, observations[row]) == leaf
    return inside
