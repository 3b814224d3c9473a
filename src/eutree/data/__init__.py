"""The recorded data: episodes, demonstrations, the learner's transition history."""

from eutree.data.demonstrations import Demonstrations, check_rewards, derive
from eutree.data.episode import Episode
from eutree.data.files import DemonstrationFolder, RunningEpisode
from eutree.data.log_format import LogFormat

__all__ = [
    "DemonstrationFolder", "Demonstrations", "Episode", "LogFormat", "RunningEpisode",
    "check_rewards", "derive",
]  # fmt: skip
