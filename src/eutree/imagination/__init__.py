"""Planning in imagination: a world model from stored transitions, policy trees improved in it."""

from eutree.imagination._kernels import ActionTree
from eutree.imagination.planner import Imagination, Plan
from eutree.imagination.transitions import Transitions
from eutree.imagination.world_model import WorldModel, fit_world_models

__all__ = [
    "ActionTree",
    "Imagination",
    "Plan",
    "Transitions",
    "WorldModel",
    "fit_world_models",
]
