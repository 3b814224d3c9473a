"""A world model from stored transitions, and paired rollouts of policy trees in it."""

from eutree.world_model._kernels import ActionTree
from eutree.world_model._kernels import leaf_node as leaf_node  # for the loops of other packages
from eutree.world_model.dynamics import WorldModel, fit_world_models
from eutree.world_model.rollouts import PairedRollouts
from eutree.world_model.transitions import Transitions

__all__ = [
    "ActionTree",
    "PairedRollouts",
    "Transitions",
    "WorldModel",
    "fit_world_models",
]
