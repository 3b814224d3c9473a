"""What a world model expects of an action that is held for a while."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.trees import DecisionTree
from eutree.world_model import _kernels_expectation as kernels
from eutree.world_model.dynamics import WorldModel


def hold(
    model: WorldModel,
    tree: DecisionTree,
    box: tuple[Floats, Floats],
    places: Floats,
    actions: Integers,
    *,
    discount: float,
    longest: int,
) -> tuple[Floats, Floats, Floats, Integers]:  # [N, d], [N], [N], [N]
    """Hold actions until trajectories leave the leaves that they first entered.

    Args:
        model: The world model, fitted without memory of displacements; its noise is left out.
        tree: The leaves.
        box: Lower and upper corner of the whole, to which trajectories are clipped, each [d].
        places: Where to start, shape [N, d].
        actions: What to hold, shape [N].
        discount: Weight of the next step.
        longest: Steps that an action is held at most.

    Returns:
        Where trajectories ended, their discounted rewards, discount^tau times the chance to go on,
        and the leaf they ended in.
    """
    places = np.array(places, dtype=np.float64, order="C")
    n = len(places)
    boxes = kernels.Boxes(
        tree.feature, tree.threshold, tree.left, tree.right, tree.leaf, box[0], box[1]
    )
    actions = np.ascontiguousarray(actions, dtype=np.int64)
    held = kernels.Held(actions, places, np.empty(n), np.empty(n), np.empty(n, np.int64))
    kernels.hold(model.world, boxes, discount, longest, held)
    return held.places, held.rewards, held.weights, held.entered
