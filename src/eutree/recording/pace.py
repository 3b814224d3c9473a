"""When the next step is due, and how much of the present one has been shown."""

from typing import Any

SPEEDS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
QUICK = 15.0  # decisions a second; beyond that a person is offered the slowest speed first
FRAME_SECONDS = 1.0 / 30.0
_TOLERANCE = 1e-9
TURN_SECONDS = 0.25  # of the picture's movement after a step in the turn-based mode


class Pace:
    """The time between two decisions, which can be slowed down, sped up and stopped.

    It has no clock: whoever asks says what time it is.

    Args:
        fps: Decisions per second at speed 1.

    Attributes:
        beat: Share of the interval that was over when it last began, or went on.
    """

    def __init__(self, fps: float) -> None:
        self.fps = fps
        self.speed = 1.0
        self.turn_based = False
        self.beat = 0.0
        self._began = 0.0
        self._stopped_at: float | None = 1.0  # share of the interval; None while running

    def facts(self) -> dict[str, Any]:
        """Return what is stored with an episode: decisions per second, and whether in turns."""
        return {"fps": self.fps, "turn_based": self.turn_based}

    @property
    def interval(self) -> float:
        """Seconds between two decisions, or of a picture's movement in the turn-based mode."""
        interval = 1.0 / (self.fps * self.speed)
        return min(interval, TURN_SECONDS) if self.turn_based else interval

    @property
    def is_smooth(self) -> bool:
        """Whether there is time for pictures between two decisions."""
        return self.interval > 2.0 * FRAME_SECONDS

    def begin(self, now: float) -> None:
        """Start the interval that follows a step; delays do not add up.

        What is late by less than an interval is made up for, at most half an interval at once.
        """
        late = now - self.due(now)
        kept = min(late, self.interval / 2.0) if 0.0 <= late < self.interval else 0.0
        self._began, self._stopped_at, self.beat = now - kept, None, 0.0

    def stop(self, now: float) -> None:
        """Hold the interval where it is."""
        if self._stopped_at is None:
            self._stopped_at = self.elapsed(now)

    def resume(self, now: float) -> None:
        """Go on from where ``stop`` held it."""
        if self._stopped_at is not None:
            self.beat = self._stopped_at
            self._began, self._stopped_at = now - self._stopped_at * self.interval, None

    def restart(self, now: float) -> None:
        """Begin a whole interval that follows no step."""
        self._began, self._stopped_at, self.beat = now, None, 0.0

    def finish(self) -> None:
        """Be at the end of the interval: the next step is due."""
        self._stopped_at = 1.0

    def set_speed(self, now: float, speed: float) -> None:
        """Change the speed; the share of the interval that is over stays the same."""
        was_running = self._stopped_at is None
        self.stop(now)
        self.speed = speed
        if was_running:
            self.resume(now)

    def shift_speed(self, now: float, steps: int) -> None:
        """Go up or down by some of the offered speeds."""
        nearest = min(range(len(SPEEDS)), key=lambda place: abs(SPEEDS[place] - self.speed))
        self.set_speed(now, SPEEDS[min(max(nearest + steps, 0), len(SPEEDS) - 1)])

    def elapsed(self, now: float) -> float:
        """Return the share of the interval that is over, from 0 to 1."""
        if self._stopped_at is not None:
            return self._stopped_at
        return min(max((now - self._began) / self.interval, 0.0), 1.0)

    def is_over(self, now: float) -> bool:
        """Return whether the interval is over."""
        return self.elapsed(now) >= 1.0 - _TOLERANCE

    def shown(self, now: float) -> float:
        """Return the share of the movement to show: all of it one picture before the end."""
        if not self.is_smooth:
            return 1.0
        return min(self.elapsed(now) / (1.0 - FRAME_SECONDS / self.interval), 1.0)

    def due(self, now: float) -> float:
        """Return when the interval is over."""
        return now if self._stopped_at is not None else self._began + self.interval
