"""The recorded data: episodes, demonstrations, the learner's transition history."""

from typing import TYPE_CHECKING

from eutree.data.demonstrations import Demonstrations, check_rewards, derive
from eutree.data.episode import Episode
from eutree.data.files import DemonstrationFolder, RunningEpisode
from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.data.log_format import LogFormat

__all__ = [
    "DemonstrationFolder", "Demonstrations", "Episode", "LogFormat", "RunningEpisode",
    "check_rewards", "derive",
]  # fmt: skip

__getattr__ = lazily(__name__, {"eutree.data.log_format": "LogFormat"})
