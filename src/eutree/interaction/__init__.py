"""The agent-environment loop, for any Gymnasium environment that a tree can act in."""

from eutree.interaction.action_grid import GriddedAction
from eutree.interaction.decoding import DecodedObservation
from eutree.interaction.episode import run_episode
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.keys import KeyMap, keys_of_environment, parse_keys
from eutree.interaction.record import record
from eutree.interaction.recorder import Recorder
from eutree.interaction.seeding import episode_seed
from eutree.interaction.session import Session
from eutree.interaction.settings import SessionSettings
from eutree.interaction.spaces import describe

__all__ = [
    "DecodedObservation",
    "GriddedAction",
    "GuardedEnv",
    "KeyMap",
    "Recorder",
    "Session",
    "SessionSettings",
    "describe",
    "episode_seed",
    "keys_of_environment",
    "parse_keys",
    "record",
    "run_episode",
]
