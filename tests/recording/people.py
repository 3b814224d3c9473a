"""A scripted person: presses keys in a session on a clock of its own, and sees every picture."""

from typing import ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete

from eutree.interaction.guard import GuardedEnv
from eutree.recording.events import Command, KeyDown, KeyUp, Seen, SessionSettings
from eutree.recording.session import Session

TICK = 1 / 60


class Corridor(gymnasium.Env):
    """Walk from 0 to 5: left, stay, right. The picture's red value is the place times ten."""

    observation_space = Box(0.0, 1e5, (2,), np.float64)
    action_space = Discrete(3)
    action_names = ("left", "stay", "right")
    feature_names = ("place", "steps")
    feature_units = ("m", "")
    metadata: ClassVar = {"render_modes": ["rgb_array"], "render_fps": 10}
    render_mode = "rgb_array"

    def __init__(self, length=5, limit=20):
        self.length = length
        self.limit = self.max_steps = limit

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.steps = float(self.np_random.integers(2)), 0
        return self._observation(), {}

    def step(self, action):
        self.place, self.steps = max(self.place + action - 1, 0.0), self.steps + 1
        there = self.place >= self.length
        late = self.steps >= self.limit and not there
        return self._observation(), float(there), there, late, {"is_success": there}

    def render(self):
        picture = np.zeros((4, 6, 3), np.uint8)
        picture[..., 0] = int(self.place * 10) % 256
        return picture

    def get_keys_to_action(self):
        return {(276,): 0, (275,): 2, (276, 275): 1}

    def _observation(self):
        return np.array([self.place, float(self.steps)])


class Person:
    """Drives a session: time passes in ticks, every picture is seen at once."""

    def __init__(self, env=None, *, session=None, tick=None, **settings):
        if session is None:
            defaults = {"target": 3, "countdown": 3.0}
            session = Session(
                GuardedEnv(env or Corridor()), settings=SessionSettings(**(defaults | settings))
            )
        self.session = session
        self._tick = tick or session.tick
        self.now = 0.0
        self.frame = 0
        self.frames = []
        self.outputs = []
        self.view = None
        self.sees = True
        self._next_seen = Seen(0)
        self.tick()

    def tick(self, *events):
        tick = self._tick(self.now, events)
        self.view = tick.view
        self.outputs += tick.outputs
        if tick.frame is not None:
            self.frames.append((self.now, tick.frame))
            if self.sees:
                self.frame = tick.frame.number
                self._tick_seen()
        return tick

    def _tick_seen(self):
        self._next_seen = Seen(self.frame)

    def wait(self, seconds):
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now += TICK
            seen = [self._next_seen] if self.sees else []
            self.tick(*seen)
        return self

    def until(self, state, limit=120.0):
        end = self.now + limit
        while self.view.state != state:
            assert self.now < end, f"still {self.view.state}, not {state}"
            self.wait(TICK)
        return self

    def press(self, key):
        self.tick(KeyDown(key, self.frame))
        return self

    def release(self, key):
        self.tick(KeyUp(key, self.frame))
        return self

    def tap(self, key):
        return self.press(key).release(key)

    def do(self, name, value=None, key=""):
        self.tick(Command(name, value, key))
        return self

    def walk(self, key="right"):
        """Start an episode and hold a key until it is over."""
        self.tap("enter").until("playing")
        self.press(key).until("review").release(key)
        return self.wait(1.0)
