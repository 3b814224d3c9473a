"""An environment that breaks."""

from tests.recording.people import Corridor


class Broken(Corridor):
    """Raises in ``step`` at the third step, or where it is told to."""

    def __init__(self, where="step"):
        super().__init__()
        self.where = where

    def reset(self, *, seed=None, options=None):
        if self.where == "reset":
            raise OSError("no device")
        return super().reset(seed=seed)

    def step(self, action):
        if self.where == "step" and self.steps == 3:
            raise KeyError("motor")
        return super().step(action)

    def render(self):
        return "no picture" if self.where == "render" else super().render()
