"""The controls of a person: the keys under their hands, the pace and the mode of acting."""

from collections.abc import Iterable
from typing import Any

from gymnasium import Space, spaces

from eutree.errors import InvalidArgumentError
from eutree.interaction import GuardedEnv
from eutree.recording.events import Command
from eutree.recording.keys import START_KEYS, KeyMap
from eutree.validation import check_number

SPEEDS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
QUICK = 15.0  # decisions a second; beyond that a person is offered the slowest speed first
FRAME_SECONDS = 1.0 / 30.0
_TOLERANCE = 1e-9
TURN_SECONDS = 0.25  # of the picture's movement after a step in the turn-based mode
MOST_TURNS = 10  # pressed, and not taken yet


class Pace:
    """The time between two decisions, which can be slowed down, sped up and stopped.

    It has no clock: each call is given the time.
    """

    def __init__(self, fps: float) -> None:
        self.fps = fps  # decisions per second at speed 1
        self.speed = 1.0
        self.turn_based = False
        self.beat = 0.0  # share of the interval that was over when it last began, or went on
        self._began = 0.0
        self._stopped_at: float | None = 1.0  # share of the interval; None while running

    @property
    def interval(self) -> float:
        """Seconds between two decisions, or of a picture's movement in the turn-based mode."""
        interval = 1.0 / (self.fps * self.speed)
        return min(interval, TURN_SECONDS) if self.turn_based else interval

    def begin(self, now: float) -> None:
        """Start the interval that follows a step; delays do not add up.

        A delay of less than an interval is made up for, at most half an interval at once.
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
        if self.interval <= 2.0 * FRAME_SECONDS:  # no time for pictures between two decisions
            return 1.0
        return min(self.elapsed(now) / (1.0 - FRAME_SECONDS / self.interval), 1.0)

    def due(self, now: float) -> float:
        """Return when the interval is over."""
        return now if self._stopped_at is not None else self._began + self.interval


class Controls:
    """The keys under a person's hands, in three modes: hold, toggle, turn-based; and their pace."""

    def __init__(self, keys: KeyMap, pace: Pace) -> None:
        self.keys, self.pace = keys, pace
        self.held: dict[str, None] = {}  # in the order in which they went down
        self.toggle = False  # whether a key switches its action on and off
        self.start()

    def start(self) -> None:
        """Begin an episode: nothing is switched on, and the idle action was the last one."""
        self.action = self.keys.idle or 0  # the last one taken
        self.turns: list[list[str]] = []  # the keys of each turn that waits to be taken
        self._switched: int | None = None  # the action that is on, in the toggle mode

    def press(self, key: str) -> None:
        """Take note of an action key, for the mode in which a press switches the action."""
        if self.toggle:
            action = self.keys.action([key], self.action)
            self._switched = None if self._switched == action else action

    def add_turn(self, keys: Iterable[str]) -> None:
        """Let keys be a turn, after those that wait, in the turn-based mode."""
        if self.pace.turn_based:
            self.turns = [*self.turns, list(keys)][:MOST_TURNS]

    def release(self) -> None:
        """Let go of everything."""
        self.held.clear()
        self.turns, self._switched = [], None

    @property
    def is_active(self) -> bool:
        """Whether an action key is held, or switched on."""
        if self.toggle:
            return self._switched is not None
        return any(key in self.keys.keys for key in self.held)

    def chosen(self) -> int:
        """Return the action that the hands mean, of the next waiting turn if there is one."""
        if self.toggle and not self.pace.turn_based:
            idle = self.action if self.keys.idle is None else self.keys.idle
            return idle if self._switched is None else self._switched
        return self.keys.action(self.turns[0] if self.turns else list(self.held), self.action)

    def command(self, key: str, *, playing: bool) -> Command | None:
        """Return the command that a key means, while an episode is played or between two."""
        name = "start" if not playing and key in START_KEYS else self.keys.command(key)
        return None if name is None else Command(name)

    def facts(self) -> dict[str, Any]:
        """Return the facts to store with an episode: the keys that act, and in which mode."""
        return {
            "keys": list(self.keys.keys),
            "toggle": self.toggle,
            "fps": self.pace.fps,
            "turn_based": self.pace.turn_based,
        }

    def set_speed(self, command: Command, now: float) -> None:
        """Obey ``slower``, ``faster`` or ``speed``: one of those that are offered."""
        speed = command.value
        if command.name != "speed":
            nearest = min(range(len(SPEEDS)), key=lambda at: abs(SPEEDS[at] - self.pace.speed))
            place = nearest + (1 if command.name == "faster" else -1)
            speed = SPEEDS[min(max(place, 0), len(SPEEDS) - 1)]
        if isinstance(speed, int | float) and speed in SPEEDS:
            self.pace.set_speed(now, float(speed))

    def set_mode(self, command: Command) -> None:
        """Obey ``toggle`` or ``turn_based``; ``mode`` goes on: hold, toggle, turn-based."""
        toggle, turn_based = self.toggle, self.pace.turn_based
        if command.name == "mode":
            toggle, turn_based = not (toggle or turn_based), toggle
        elif command.name == "toggle":
            toggle = bool(command.value)
        else:
            turn_based = bool(command.value)
        if command.name != "turn_based":
            self.toggle, self._switched = toggle, None
        if command.name != "toggle":
            self.pace.turn_based, self.turns = turn_based, []
            self.pace.finish()

    def bind(self, key: str, action: int) -> str:
        """Let a key mean an action from now on; return why it cannot, or ""."""
        try:
            self.keys = self.keys.with_key(key, action)
        except InvalidArgumentError as error:
            return str(error)
        return ""


def frames_per_second(env: GuardedEnv) -> float:
    """Return the environment's ``render_fps``, or 30 where it has none."""
    own = env.env.metadata.get("render_fps") or 30.0
    return check_number("metadata['render_fps']", own, low=0.0, low_open=True)


def takes_turns(env: GuardedEnv, keys: KeyMap) -> bool:
    """Return whether no time passes between two steps, so that a key is one step.

    That is so where finitely many things are observed, as on a grid, and no action is to wait.
    """
    return keys.idle is None and _is_finite(env.env.unwrapped.observation_space)


def _is_finite(space: Space[Any]) -> bool:
    if isinstance(space, spaces.Tuple):
        return all(map(_is_finite, space.spaces))
    if isinstance(space, spaces.Dict):
        return all(map(_is_finite, space.spaces.values()))
    return isinstance(space, spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary)
