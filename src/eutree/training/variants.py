"""Variants of a policy: a few random changes, the most promising by what was recorded.

Each change shifts a threshold, turns a leaf's action, cuts a box around a visited observation out
of a leaf, or collapses a node. Most of them are for the worse, and episodes to see it in cost more
than making another. So of several the one is taken that recorded transitions speak for: in the
steps at which it decides otherwise, what was gained by those that acted like it against those that
acted like the policy, in units of the difference's standard error. What a step gained is the
generalized advantage (Schulman et al. 2016), lambda = 0.9, with V fitted to the returns to go.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.compiled import compiled
from eutree.thresholds import threshold_between
from eutree.world_model import ActionTree, Transitions, leaf_node
from eutree.world_model.action_trees import n_leaves, nested, packed, with_box, with_child
from eutree.world_model.dynamics import fit_model_tree

SHIFTS = (0.015, 0.05, 0.15, 0.45)  # of the visited observations that change sides, at most
MORE = 0.4  # chance of one more change
BOX_ROWS = 300  # looked at for the other edges of a box
MOST_ROWS = 30_000
ROWS_PER_LEAF = 30
VALUE_LEAVES = 64
LAMBDA = 0.9
FEW = 5  # rows that say nothing


class Variation:
    """Makes variants of a policy tree.

    Args:
        n_actions: Number of actions A.
        max_leaves: Most leaves of a variant.
        generator: Source of all chance.
    """

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

    def of(self, tree: ActionTree, visited: Floats) -> ActionTree | None:
        """Return a variant; None if it came out too large or too small.

        Args:
            tree: The policy.
            visited: Observations of its episodes, shape [K, d].
        """
        while True:
            way = self._generator.choice(4, p=(0.4, 0.1, 0.3, 0.2))
            tree = packed(nested(self._ways[way](tree, visited)))
            if self._generator.random() >= MORE:
                return tree if 2 <= n_leaves(tree) <= self._max_leaves else None

    def _perturb_thresholds(self, tree: ActionTree, visited: Floats) -> ActionTree:
        inner = np.flatnonzero(tree.feature >= 0)
        if not inner.size:
            return tree
        node = self._generator.choice(inner)
        values = np.sort(visited[:, tree.feature[node]])
        at = int(np.searchsorted(values, tree.threshold[node]))
        reach = values.size * self._generator.choice(SHIFTS) * self._generator.random()
        at += int(self._generator.choice((-1, 1)) * max(1.0, reach))
        at = int(np.clip(at, 1, values.size - 1))
        thresholds = tree.threshold.copy()
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
        near = some[_in_leaf(tree, leaf, some)]
        near = near if len(near) else x[None]
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


@dataclass(frozen=True, eq=False)
class Advantages:
    """What recorded steps gained over what is usual from where they were taken.

    Attributes:
        observations: o of each step.
        actions: a.
        gains: Sum of lambda^k delta_k from here to the end of the episode, where
            delta = r + V(o') - V(o), and V is fitted to the returns to go.
    """

    observations: Floats  # [N, d]
    actions: Integers  # [N]
    gains: Floats  # [N]

    @classmethod
    def of(cls, data: Transitions, generator: np.random.Generator) -> "Advantages":
        """Return those of some of the transitions."""
        n = data.rewards.size
        rows = np.sort(generator.choice(n, min(n, MOST_ROWS), replace=False))
        value = fit_model_tree(
            data.observations[rows],
            data.returns_to_go[rows],
            max_leaves=VALUE_LEAVES,
            min_leaf=ROWS_PER_LEAF,
        )
        beyond = np.where(data.terminated, 0.0, value.predict(data.next_observations))
        gains = data.rewards + beyond - value.predict(data.observations)
        _add_what_follows(gains, data.last)
        return cls(data.observations[rows], data.actions[rows], gains[rows])

    def speak_for(self, policy: Integers, rival: Integers) -> float:
        """Return how many standard errors the rival's way gained more; 0 where nothing is known.

        Args:
            policy: What the policy does at each observation, shape [N].
            rival: What the rival does, shape [N].
        """
        differs = policy != rival
        likes = self._gained(differs & (rival == self.actions))
        own = self._gained(differs & (policy == self.actions))
        if min(likes.size, own.size) < FEW:
            return 0.0
        error = np.sqrt(likes.var() / likes.size + own.var() / own.size)
        return float((likes.mean() - own.mean()) / max(error, 1e-9))

    def _gained(self, steps: Booleans) -> Floats:
        return self.gains[steps]


@compiled
def _in_leaf(tree: ActionTree, leaf: int, observations: Floats) -> Booleans:
    """Return which of the observations [K, d] fall into the leaf, shape [K]."""
    inside = np.zeros(len(observations), dtype=np.bool_)
    for row in range(len(observations)):  # inside[:row] is decided
        inside[row] = leaf_node(tree, 0, observations[row]) == leaf
    return inside


@compiled
def _add_what_follows(gains: Floats, last: Booleans) -> None:
    """Add LAMBDA times the next sum to each of them, up to the end of its episode, in place."""
    ahead = 0.0
    for i in range(gains.size - 1, -1, -1):
        ahead = gains[i] + (0.0 if last[i] else LAMBDA * ahead)
        gains[i] = ahead
