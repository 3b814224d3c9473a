"""What a tree makes of demonstrations that come while it learns: distinctions, leaf by leaf.

C4.5 turned the first demonstrations into the expert tree. A leaf in which somebody has since shown
different actions for different observations is refined in the same way: C4.5 is fitted to what was
shown in it, and the leaf becomes that subtree. So a state tree of one leaf becomes the expert tree,
and what reinforcement has learned elsewhere stays.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.learners.history import History
from eutree.trees import DecisionTree


class Lessons:
    """Where somebody has shown what to do since the last update.

    Args:
        n_features: Number of features d.
    """

    def __init__(self, n_features: int) -> None:
        self._observations = np.empty((0, n_features))

    def add(self, observations: Floats) -> None:
        """Remember where something was shown, shape [n, d]."""
        if len(observations):
            self._observations = np.concatenate([self._observations, observations])

    def refine(
        self,
        tree: DecisionTree,
        actions: Integers,
        history: History,
        n_actions: int,
        locked: frozenset[int],
    ) -> tuple[DecisionTree, Integers] | None:
        """Return the tree and its actions with the leaves refined in which something was shown.

        All lessons are forgotten. None if there was nothing to refine.

        Args:
            tree: The tree.
            actions: Action of each of its leaves, shape [L].
            history: The store of transitions: C4.5 sees all that was ever shown in a leaf.
            n_actions: Number of actions A.
            locked: Leaves that are left as they are.
        """
        lately, self._observations = self._observations, self._observations[:0]
        if not len(lately):
            return None
        observations = history.observations[history.demonstrated]
        present = set(tree.leaf_index(lately).tolist()) - locked
        leaves = np.array(
            sorted(present & set(tree.leaf_index(observations).tolist())), dtype=np.int64
        )
        if not leaves.size:
            return None
        shown = history.actions[history.demonstrated].astype(np.int64)
        return refined(tree, actions, observations, shown, n_actions, leaves=leaves)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return what is stored: nothing where nothing was shown."""
        return {"lessons": self._observations} if len(self._observations) else {}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take back a ``state()``."""
        self._observations = np.array(state.get("lessons", self._observations))


def refined(
    tree: DecisionTree,
    actions: Integers,
    observations: Floats,
    shown: Integers,
    n_actions: int,
    *,
    leaves: Integers,
) -> tuple[DecisionTree, Integers]:
    """Return the tree with ``leaves`` refined by what was shown, and the action of each leaf.

    Args:
        tree: The tree.
        actions: Action of each of its leaves, shape [L].
        observations: Observations at which somebody showed what to do, shape [N, d].
        shown: The action shown at each, shape [N].
        n_actions: Number of actions A.
        leaves: Leaves to refine; new leaves get the numbers that follow.
    """
    labels = tree.leaf_index(observations)
    chosen = actions.tolist()
    for leaf in leaves.tolist():
        rows = labels == leaf
        grown = grow(observations[rows], shown[rows], n_classes=n_actions, settings=C45Settings())
        part, part_actions = grown.to_decision_tree()
        places = [(0, leaf)]
        while places:
            node, place = places.pop()
            if part.leaf[node] >= 0:
                chosen[place] = int(part_actions[part.leaf[node]])
                continue
            tree = tree.split(place, int(part.feature[node]), float(part.threshold[node]))
            chosen.append(chosen[place])
            places += [
                (int(part.left[node]), place),
                (int(part.right[node]), tree.n_leaves - 1),
            ]
    return tree, np.array(chosen, dtype=np.int64)
