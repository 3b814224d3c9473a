"""Imagined episodes of many trees: what a search is given in the place of an environment."""

from collections.abc import Sequence

import numpy as np

from eutree.arrays import Floats
from eutree.compression.playing import Move, moved
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import from_decision_tree
from eutree.world_model.common_chance import Gain, Rollouts

ROWS = 2000  # that thresholds are placed by, and parts fitted to


class ImaginedCommonEpisodes:
    """Imagined episodes of a present tree from common starts, and those of rivals beside it.

    Args:
        rollouts: Imagines them; their steps are none of the environment's.

    Attributes:
        present: The tree that ran last.
    """

    present: TreePolicy

    def __init__(self, rollouts: Rollouts) -> None:
        self._rollouts = rollouts
        self._scale: float | None = None
        self._known: dict[bytes, Gain] = {}  # of trees beside the present one

    @property
    def features(self) -> Floats:
        """Features at steps of the present tree's episodes, spread evenly, shape [n, d]."""
        features = self._rollouts.observations
        return features[:: len(features) // ROWS + 1]

    @property
    def mean_return(self) -> float:
        """Mean imagined return of the present tree."""
        return float(self._rollouts.returns.mean())

    @property
    def scale(self) -> float:
        """Width of the range of the first tree's imagined returns."""
        return self._scale or 0.0

    @property
    def steps(self) -> int:
        """Steps imagined so far."""
        return self._rollouts.n_steps_taken

    def redraw(self, tree: TreePolicy) -> None:
        """Let a tree run from other starts, with other chance."""
        self._rollouts.redraw()
        self.run(tree)

    def run(self, tree: TreePolicy) -> None:
        """Let a tree run from the present starts."""
        self.present = tree
        self._known.clear()
        self._rollouts.run(acting(tree))
        if self._scale is None:
            self._scale = float(np.ptp(self._rollouts.returns))

    def gains(
        self, rivals: Sequence[TreePolicy], *, few: bool = False, above: float = -np.inf
    ) -> list[Gain]:
        """Return what rivals are imagined to earn more than the present tree.

        Args:
            rivals: The trees.
            few: Not used: an episode is given up as soon as its tree is hopeless.
            above: Hopeless is what comes to less.
        """
        return [self._gain(one, above) for one in rivals]

    def gains_of_moves(self, moves: Sequence[Move], *, few: bool = False) -> list[Gain]:
        """Return what moved thresholds, each alone, are imagined to earn more."""
        present = acting(self.present)
        if present.feature.size != self.present.tree.n_nodes:  # siblings were joined
            return self.gains([moved(self.present, *one) for one in moves], above=0.0)
        found = []
        for node, at in moves:
            threshold = present.threshold.copy()
            threshold[node] = at
            found.append(self._rollouts.gain(present._replace(threshold=threshold), hopeless=0.0))
        return found

    def _gain(self, rival: TreePolicy, above: float) -> Gain:
        tree = rival.tree
        known = tree.feature.tobytes() + tree.threshold.tobytes() + rival.actions.tobytes()
        if known not in self._known:
            self._known[known] = self._rollouts.gain(acting(rival), hopeless=above)
        return self._known[known]


def acting(policy: TreePolicy) -> ActionTree:
    """Return what a world model runs of a policy."""
    tree = policy.tree
    inner = tree.feature != tree.NO_FEATURE
    if not _in_preorder(tree):
        return from_decision_tree(tree, policy.actions)
    return ActionTree(
        np.where(inner, tree.feature, -1).astype(np.int64),
        np.where(inner, tree.threshold, 0.0),
        np.where(inner, tree.left, 0).astype(np.int64),
        np.where(inner, tree.right, 0).astype(np.int64),
        np.where(inner, 0, policy.actions[tree.leaf]),
    )


def _in_preorder(tree: DecisionTree) -> bool:
    left, right = tree.left.tolist(), tree.right.tolist()
    pending = [0]
    for number in range(tree.n_nodes):
        if pending.pop() != number:
            return False
        if left[number] >= 0:
            pending += [right[number], left[number]]
    return True
