"""Trees of MountainCar for tests: nested (feature, threshold, left, right), leaves are actions."""

import gymnasium
import numpy as np

from eutree import DecisionTree, TreePolicy
from eutree.interaction import DerivedObservation, describe
from eutree.schema import EnvironmentSpec

POSITION, VELOCITY = 0, 1
LEFT, RIGHT = 0, 2

SWITCH = (VELOCITY, 0.004999893717467785, LEFT, RIGHT)
"""C4.5's tree of fifteen demonstrations, seed 4 of docs/results/task-MountainCar.md."""


def policy_of(nested, environment="MountainCar-v0", derived=(), **arguments):
    """Return the policy of a nested tuple."""
    env = DerivedObservation(gymnasium.make(environment, **arguments), derived)
    schema = describe(env)
    columns = {name: [] for name in ("feature", "threshold", "left", "right", "leaf")}
    actions = []

    def add(node):
        place = len(columns["feature"])
        for column in columns.values():
            column.append(-1)
        if isinstance(node, tuple):
            feature, threshold, left, right = node
            columns["feature"][place], columns["threshold"][place] = feature, threshold
            columns["left"][place] = add(left)
            columns["right"][place] = add(right)
        else:
            columns["threshold"][place] = np.nan
            columns["leaf"][place] = len(actions)
            actions.append(node)
        return place

    add(nested)
    tree = DecisionTree(schema.n_features, **{k: np.array(v) for k, v in columns.items()})
    spec = EnvironmentSpec(environment, arguments)
    return TreePolicy(tree, np.array(actions), schema, spec)


GOOD = (
    VELOCITY, 9.915727408912195e-05,
    (VELOCITY, -0.0038961002872987456,
     (POSITION, -0.9151777714601039, RIGHT, LEFT), (POSITION, -0.4792827899506268, RIGHT, LEFT)),
    (VELOCITY, 0.01909782315503923,
     (POSITION, -0.4207347319981922, RIGHT, (POSITION, 0.03869388487303556, LEFT, RIGHT)), RIGHT),
)  # fmt: skip
"""The learned tree of seed 4 there: it arrives from every start."""

BAD = (
    VELOCITY, 0.016992326777284093,
    (POSITION, -0.44834432760739695,
     (VELOCITY, -0.0013280637378364523, (POSITION, -0.8981929533565942, RIGHT, LEFT), RIGHT),
     LEFT),
    RIGHT,
)  # fmt: skip
"""The learned and raced tree of seed 5 there: from two starts of a thousand it never arrives."""
