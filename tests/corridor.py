"""A corridor whose right action depends on the place, and policies of stripes."""

from dataclasses import replace

import gymnasium
import numpy as np

from eutree.interaction import GuardedEnv
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree


class Corridor(gymnasium.Env):
    """Ten visits at random places; the right action is worth 1, and 5 beyond x = 9."""

    observation_space = gymnasium.spaces.Box(0.0, 10.0, (1,), dtype=np.float64)
    action_space = gymnasium.spaces.Discrete(2)
    steps_made = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left, self.place = 10, self.np_random.random() * 10
        return np.array([self.place]), {}

    def step(self, action):
        type(self).steps_made += 1
        right = int(self.place > 5)
        reward = (5.0 if self.place > 9 else 1.0) * (action == right)
        self.place, self.left = self.np_random.random() * 10, self.left - 1
        return np.array([self.place]), float(reward), self.left == 0, False, {}


def striped(*cuts_and_actions):
    """Return a policy on [0, 10] of stripes: action, cut, action, cut, ..., action."""
    tree, actions = DecisionTree.single_leaf(1), [cuts_and_actions[0]]
    for cut, action in zip(cuts_and_actions[1::2], cuts_and_actions[2::2], strict=True):
        tree = tree.split(tree.n_leaves - 1, 0, cut)
        actions.append(action)
    return TreePolicy(tree, np.array(actions), Schema.anonymous(1, 2))


SCHEMA = GuardedEnv(Corridor()).schema


def policy_of(*cuts_and_actions):
    return replace(striped(*cuts_and_actions), schema=SCHEMA)


WRONG = policy_of(0, 7.0, 1)  # wrong on a fifth of the places: 5 is right
