"""The agent-environment loop, for any Gymnasium environment that a tree can act in."""

from eutree.interaction.action_grid import GriddedAction
from eutree.interaction.decoding import DecodedObservation
from eutree.interaction.deriving import DerivedObservation
from eutree.interaction.episode import episode_seed, run_episode
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.spaces import describe

__all__ = [
    "DecodedObservation", "DerivedObservation", "GriddedAction", "GuardedEnv", "describe",
    "episode_seed", "run_episode",
]  # fmt: skip
