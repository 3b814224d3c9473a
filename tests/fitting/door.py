"""A corridor with a door that opens and shuts by chance, and who walks through it with care."""

import gymnasium
import numpy as np


class Corridor(gymnasium.Env):
    """Five steps to the door; it opens and shuts by chance, and hits who walks into it shut."""

    observation_space = gymnasium.spaces.Box(0.0, 6.0, (2,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)
    action_names = ("wait", "walk")
    feature_names = ("place", "gap")

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.steps, self.gap = 0, 0, float(self.np_random.random())
        return self._seen(), {}

    def step(self, action):
        hit = bool(action and self.place == 4 and self.gap < 0.7)
        self.place += int(action and not hit)
        self.steps += 1
        self.gap = float(self.np_random.random())
        arrived = self.place == 5
        ended = hit or arrived
        info = {"is_success": arrived}
        return self._seen(), 10.0 * arrived - 5.0 * hit, ended, self.steps >= 40, info

    def _seen(self):
        return np.array([float(self.place), self.gap])


class Careful:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        place, gap = np.asarray(observation)
        return int(place < 4 or gap >= 0.7), state
