"""Random changes of a policy tree, at places that its episodes visit."""

from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.compiled import compiled
from eutree.features import threshold_between
from eutree.world_model import ActionTree, leaf_node
from eutree.world_model.action_trees import Nested, n_leaves, nested, packed, with_box, with_child

SHIFTS = (0.015, 0.05, 0.15, 0.45)  # of the visited observations that change sides, at most
MORE = 0.4  # chance of one more change
GRAFTED = 0.1  # chance that a branch of a mate is taken over
BOX_ROWS = 300  # looked at for the other edges of a box
WAYS = np.array((0.4, 0.5, 0.8, 1.0))  # chances of thresholds, labels, boxes, subtrees, added up


class Variation:
    """Makes variants of a policy tree.

    Tens of thousands of them are made for one tree that is kept. So the values of a feature are
    sorted once for all trees that are varied with the same array of visited observations.
    """

    def __init__(self, n_actions: int, max_leaves: int, generator: np.random.Generator) -> None:
        self._n_actions = n_actions
        self._max_leaves = max_leaves
        self._generator = generator
        self._visited: Floats | None = None
        self._sorted: dict[int, Floats] = {}
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

        ``visited`` are observations of the policy's episodes, shape [K, d]; they must not change
        while the same array is given. A branch of a ``mate`` may be taken over.
        """
        changed = mate is not None and self._generator.random() < GRAFTED
        if mate is not None and changed:
            node, source = (self._generator.integers(one.feature.size) for one in (tree, mate))
            tree = packed(nested(tree, instead={int(node): nested(mate, int(source))}))
        while not changed or self._generator.random() < MORE:
            way = self._ways[int(WAYS.searchsorted(self._generator.random(), side="right"))]
            tree, changed = packed(way(tree, visited)), True
        return tree if 2 <= n_leaves(tree) <= self._max_leaves else None

    def _perturb_thresholds(self, tree: ActionTree, visited: Floats) -> Nested:
        inner = np.flatnonzero(tree.feature >= 0)
        if not inner.size:
            return nested(tree)
        node = self._one_of(inner)
        values = self._values(visited, int(tree.feature[node]))
        at = int(values.searchsorted(tree.threshold[node]))
        reach = values.size * self._one_of(SHIFTS) * self._generator.random()
        at += int(self._one_of((-1, 1)) * max(1.0, reach))
        at = min(max(at, 1), values.size - 1)
        thresholds = tree.threshold.copy()
        thresholds[node] = threshold_between(*values[at - 1 : at + 1].tolist())
        return nested(tree._replace(threshold=thresholds))

    def _flip_label(self, tree: ActionTree, visited: Floats) -> Nested:
        leaf = self._one_of(np.flatnonzero(tree.feature < 0))
        actions = tree.action.copy()
        actions[leaf] = self._other(actions[leaf])
        return nested(tree._replace(action=actions))

    def _insert_boxes(self, tree: ActionTree, visited: Floats) -> Nested:
        x = visited[self._generator.integers(len(visited))]
        leaf = leaf_node(tree, 0, x)
        some = visited[self._generator.integers(len(visited), size=BOX_ROWS)]
        near = inside if len(inside := some[_in_leaf(tree, leaf, some)]) else x[None]
        box = np.full((x.size, 2), (-np.inf, np.inf))
        n_features = min(self._one_of((1, 1, 2)), x.size)
        for feature in self._generator.choice(x.size, n_features, replace=False):
            edge = near[self._generator.integers(len(near))][feature]
            if edge != x[feature]:
                box[feature, int(edge > x[feature])] = edge
        taken = int(tree.action[leaf])
        return nested(tree, instead={int(leaf): with_box(box, self._other(taken), taken)})

    def _replace_subtrees(self, tree: ActionTree, visited: Floats) -> Nested:
        inner = np.flatnonzero(tree.feature >= 0)
        if not inner.size:
            return nested(tree)
        node = int(self._one_of(inner))
        return nested(with_child(tree, node, goes_left=bool(self._generator.random() < 0.5))[0])

    def _other(self, action: int) -> int:
        others = [a for a in range(self._n_actions) if a != action]
        return int(self._one_of(others or [action]))  # the only one there is

    def _one_of(self, some: Any) -> Any:
        """Return one of a sequence, the one that ``Generator.choice`` returns, in less time."""
        return some[int(self._generator.integers(len(some)))]

    def _values(self, visited: Floats, feature: int) -> Floats:
        """Return the sorted values of a feature."""
        if visited is not self._visited:
            self._visited, self._sorted = visited, {}
        if feature not in self._sorted:
            self._sorted[feature] = np.sort(visited[:, feature])
        return self._sorted[feature]


@compiled
def _in_leaf(tree: ActionTree, leaf: int, observations: Floats) -> Booleans:
    """Return which of the observations [K, d] fall into the leaf, shape [K]."""
    inside = np.zeros(len(observations), dtype=np.bool_)
    for row in range(len(observations)):  # inside[:row] is decided
        inside[row] = leaf_node(tree, 0, observations[row]) == leaf
    return inside
