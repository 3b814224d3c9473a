"""The agent-environment loop, for any Gymnasium environment that a tree can act in."""

from typing import TYPE_CHECKING

from eutree.interaction.action_grid import GriddedAction
from eutree.interaction.decoding import DecodedObservation
from eutree.interaction.deriving import DerivedObservation
from eutree.interaction.episode import run_episode
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.record import record
from eutree.interaction.seeding import episode_seed
from eutree.interaction.spaces import describe
from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.interaction.keys import KeyMap, keys_of_environment, parse_keys
    from eutree.interaction.recorder import Recorder
    from eutree.interaction.session import Session
    from eutree.interaction.settings import SessionSettings

__all__ = [
    "DecodedObservation",
    "DerivedObservation",
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

__getattr__ = lazily(
    __name__,
    {
        "eutree.interaction.keys": "KeyMap keys_of_environment parse_keys",
        "eutree.interaction.recorder": "Recorder",
        "eutree.interaction.session": "Session",
        "eutree.interaction.settings": "SessionSettings",
    },
)
