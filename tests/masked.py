"""The light with masks, in which nobody plays a masked action unseen."""

import numpy as np
from examples.minimum_green import MinimumGreen


class Light(MinimumGreen):
    """One that raises at a masked action, and with ``asked`` tells masks by ``action_masks``."""

    feature_kinds = {}  # noqa: RUF012 - as of its base

    def __init__(self, asked=False):
        super().__init__(masked=not asked)
        if asked:
            self.action_masks = self._mask

    def step(self, action):
        if not self._mask()[action]:
            raise RuntimeError(f"{action} is masked")
        return super().step(action)


class Longest:
    """Serve the longest queue of those that may be served."""

    def __init__(self, env):
        pass

    def predict(self, observation, action_masks=None):
        masks = np.ones(3) if action_masks is None else action_masks
        return int(np.where(masks, observation["queues"], -1.0).argmax()), None
