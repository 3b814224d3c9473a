"""A learner that asks once: a corridor under way, and a record of what was shown."""

import numpy as np

from eutree.interaction.guard import GuardedEnv
from eutree.interaction.requests import Request, Stretch
from tests.interaction.people import Corridor


class Asked:
    """A request at the second step of an episode in a corridor, for a stretch of ``max_steps``."""

    def __init__(self, max_steps=3, env=None):
        self.env = GuardedEnv(env or Corridor(length=9))
        first = self.env.reset(3)
        idle = 1 if self.env.schema.n_actions == 3 else 0
        second = self.env.step(idle)[0]
        self.actions, self.over = [], False
        self.request = Request(
            number=2,
            of=7,
            episode=4,
            step=1,
            reason="The tree has seen few situations like this.",
            observations=np.array([first, second]),
            max_steps=max_steps,
            intended="right",
        )
        self.stretch = Stretch(self.env, self.step)

    def step(self, action, count):
        answer = self.env.step(action)
        self.actions.append(action)
        return answer, answer[2] or answer[3] or count >= self.request.max_steps
