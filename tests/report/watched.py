"""Episodes of policies for Evasion, with pictures of one pixel."""

import base64

import numpy as np

from eutree.data import Episode
from eutree.policies import TreePolicy
from eutree.report import WatchedEpisode

PIXEL = base64.b64decode(
    "UklGRiQAAABXRUJQVlA4IBgAAAAwAQCdASoBAAEAAgA0JaQAA3AA/vuUAAA="
)  # the smallest picture there is


def episodes(policy: TreePolicy, *, count: int = 3, steps: int = 12, frame: bytes = PIXEL) -> list:
    rng = np.random.default_rng(0)
    watched = []
    for number in range(count):
        observations = rng.uniform(-11, 11, size=(steps + 1, policy.observation_size))
        observations[:, 0] = np.linspace(0, 30, steps + 1)
        actions = np.array([policy.act(row) for row in observations[:-1].tolist()])
        rewards = np.where(actions == 0, -2.0, 0.0) + 100.0 * (np.arange(steps) == steps - 1)
        episode = Episode(observations, actions, rewards, True, False, number, "goal", True)
        frames = tuple(frame for _ in range(steps + 1)) if number != 1 else ()
        watched.append(WatchedEpisode(episode, frames))
    return watched
