"""Episodes that are shown: by a person with keys before a picture, or by an expert in code."""

from typing import TYPE_CHECKING

from eutree.lazy import lazily
from eutree.recording.record import record

if TYPE_CHECKING:
    from eutree.recording.events import SessionSettings
    from eutree.recording.keys import KeyMap, keys_of_environment, parse_keys
    from eutree.recording.recorder import Recorder
    from eutree.recording.session import Session

__all__ = [
    "KeyMap", "Recorder", "Session", "SessionSettings", "keys_of_environment", "parse_keys",
    "record",
]  # fmt: skip

__getattr__ = lazily(
    __name__,
    {
        "eutree.recording.keys": "KeyMap keys_of_environment parse_keys",
        "eutree.recording.recorder": "Recorder",
        "eutree.recording.session": "Session",
        "eutree.recording.events": "SessionSettings",
    },
)
