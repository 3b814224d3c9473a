"""Trees that copy a teacher: CART on everything the teacher was asked about (DAgger's data)."""

from collections.abc import Callable

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.cart import grow_cart
from eutree.world_model import ActionTree, leaf_node
from eutree.world_model.action_trees import from_decision_tree


class Students:
    """What a teacher says at observations, and trees that say the same.

    Args:
        action_values: The teacher's Q, from observations [N, d] to [N, A].
        n_actions: Number of actions A.
    """

    def __init__(self, action_values: Callable[[Floats], Floats], n_actions: int) -> None:
        self._action_values = action_values
        self._n_actions = n_actions
        self.begin(0)

    def begin(self, first: int) -> None:
        """Forget all labels; observations before row ``first`` of the store are left out."""
        self._first = first
        self._labels: Integers = np.empty(0, dtype=np.int64)
        self._gaps: Floats = np.empty(0)

    def fit(
        self,
        observations: Floats,
        max_leaves: int,
        *,
        weighted: bool = False,
        labels: Int32s | None = None,
    ) -> ActionTree:
        """Return a tree of at most so many leaves.

        Args:
            observations: All that are stored, shape [N, d]: those of before and new ones.
            max_leaves: Most leaves.
            weighted: Whether an observation counts by max_a Q - min_a Q there, as in VIPER
                (Bastani, Pu and Solar-Lezama 2018).
            labels: Actions to copy in place of the teacher's, shape [N].
        """
        rows, classes, weights = observations, labels, None
        if classes is None:
            self._label(observations)
            rows, classes = observations[self._first :], self._labels.astype(np.int32)
            weights = self._gaps if weighted and self._gaps.sum() > 0.0 else None
        tree, actions = grow_cart(
            rows,
            classes.astype(np.int64),
            n_classes=self._n_actions,
            max_leaves=max_leaves,
            weights=weights,
        )
        return from_decision_tree(tree, actions)

    def act(self, tree: ActionTree, observation: Floats) -> int:
        """Return what a tree does at an observation [d]."""
        return int(tree.action[leaf_node(tree, 0, observation)])

    def agree(self, tree: ActionTree, observations: Floats, actions: Int32s) -> bool:
        """Return whether a tree does just this at observations [T, d]."""
        return all(
            self.act(tree, observation) == action
            for observation, action in zip(observations, actions.tolist(), strict=True)
        )

    def _label(self, observations: Floats) -> None:
        """Ask the teacher about the observations that it has not seen yet."""
        values = self._action_values(observations[self._first + self._labels.size :])
        self._labels = np.concatenate([self._labels, values.argmax(axis=1)])
        self._gaps = np.concatenate([self._gaps, np.ptp(values, axis=1)])
