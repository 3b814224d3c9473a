"""A world model from stored transitions, and paired rollouts of policy trees in it."""

from typing import TYPE_CHECKING

from eutree.lazy import lazily
from eutree.world_model._kernels import ActionTree
from eutree.world_model._kernels import World as World  # the rest are for loops of other packages
from eutree.world_model._kernels import chance as chance
from eutree.world_model._kernels import fitted as fitted
from eutree.world_model._kernels import leaf_node as leaf_node
from eutree.world_model._kernels import model_leaf as model_leaf

if TYPE_CHECKING:
    from eutree.world_model._kernels_formulas import derive as derive
    from eutree.world_model.counted import fit_counted_world
    from eutree.world_model.dynamics import WorldModel, fit_world_models
    from eutree.world_model.rollouts import PairedRollouts
    from eutree.world_model.transitions import Transitions, countable

__all__ = [
    "ActionTree", "PairedRollouts", "Transitions", "WorldModel", "countable", "fit_counted_world",
    "fit_world_models",
]  # fmt: skip

__getattr__ = lazily(
    __name__,
    {
        "eutree.world_model._kernels_formulas": "derive",
        "eutree.world_model.counted": "fit_counted_world",
        "eutree.world_model.dynamics": "WorldModel fit_world_models",
        "eutree.world_model.rollouts": "PairedRollouts",
        "eutree.world_model.transitions": "Transitions countable",
    },
)
