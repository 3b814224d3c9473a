"""A traffic light as a Gymnasium environment; the traffic is somebody else's, ``traffic``.

A decision is which phase is to be green next. Where that is the one that is green, it stays so for
five seconds; else the amber of the city's own plan follows, and the least green after it, and only
then the light is asked again: so no controller can make either too short.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np

DECISION = 5  # seconds
LEAST_GREEN = 5  # seconds: minDur in the plan of cologne1
MOST = 120  # vehicles: more are counted as so many
LONGEST = 120  # seconds: longer is counted as so long; else red would tell the time of day
DEMANDS = 0.8, 1.2  # shares of what was counted, between which the demand of a morning is drawn


@dataclass(frozen=True)
class Junction:
    """An intersection with a light.

    Attributes:
        name: Its name in the benchmark RESCO.
        light: Id of its light.
        begin: When its traffic begins, in seconds of the day.
        phases: What each green phase lets go, in words.
        lanes: The lanes that each phase serves: RESCO's own table.
    """

    name: str
    light: str
    begin: int
    phases: tuple[str, ...]
    lanes: tuple[tuple[str, ...], ...]

    @property
    def all_lanes(self) -> list[str]:
        """Every lane once, in order."""
        return list(dict.fromkeys(lane for lanes in self.lanes for lane in lanes))


@dataclass(frozen=True)
class Episode:
    """What is played.

    Attributes:
        junction: Where.
        seconds: For how long.
        demand: How much traffic there is, as a share of what was counted.
        program: "none" where the environment's actions decide; "plan" for the city's own programme,
            "actuated" for SUMO's, which both ignore the actions.
        seed: Of the drivers, below 2**31.
    """

    junction: Junction
    seconds: int
    demand: float
    program: str
    seed: int


class Traffic(Protocol):
    """What moves the vehicles.

    ``start`` and ``show`` give the counts of all lanes: vehicles ``waiting`` and ``coming``.
    ``start`` gives the plan's green phases, too, as ``signals``, and its ``amber`` in seconds;
    ``show`` the vehicle seconds of ``standing``; ``finish`` the figures of the episode.
    """

    def start(self, episode: Episode) -> dict[str, Any]:
        """Begin."""

    def show(self, shown: list[tuple[str | None, int]]) -> dict[str, Any]:
        """Show signals, or the programme's own, each for so many seconds."""

    def finish(self) -> dict[str, float]:
        """End the episode."""

    def stop(self) -> None:
        """End wherever it is."""


def amber(before: str, after: str) -> str:
    """Return the signals between two phases: what was green and will be red is amber."""
    pairs = zip(before, after, strict=True)
    return "".join("y" if a in "Gg" and b not in "Gg" else a for a, b in pairs)


def feature_names(phases: Sequence[str]) -> tuple[str, ...]:
    """Return the names of what is observed."""
    each = ("waiting for {}", "coming for {}", "green {}", "red for {}")
    return (*(text.format(phase) for text in each for phase in phases), "unchanged for")


class TrafficLight(gymnasium.Env[Any, Any]):
    """The light of a junction.

    Observation, for each phase: vehicles that wait in the lanes it serves, vehicles that drive
    there, whether it is green, for how many seconds it has been red; then for how many seconds the
    green one has been so. Reward: minus the vehicles that stand anywhere (those that find no room
    to enter included), so that a return is minus their mean number.

    Args:
        junction: Where it is.
        traffic: What moves the vehicles.
        seconds: Length of an episode.
        demand: Share of the traffic that was counted; None to draw it for each episode.
        program: "none" where the actions decide; "plan" and "actuated" ignore them.
        amber: Seconds of amber, in place of the plan's.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration

    def __init__(
        self,
        junction: Junction,
        traffic: Traffic,
        *,
        seconds: int = 1800,
        demand: float | None = None,
        program: str = "none",
        amber: int | None = None,
    ) -> None:
        self._junction, self._traffic, self._amber = junction, traffic, amber
        self._seconds, self._demand, self._program = seconds, demand, program
        n = len(junction.phases)
        self.action_names = junction.phases
        self.feature_names = feature_names(junction.phases)
        self.feature_units = (*["vehicles"] * (2 * n), *[""] * n, *["s"] * (n + 1))
        numbers = [name for name in self.feature_names if not name.startswith("green ")]
        self.feature_kinds = {**dict.fromkeys(numbers, "integer"), "green": junction.phases}
        self.max_steps = seconds // DECISION
        high = [MOST] * (2 * n) + [1] * n + [LONGEST] * (n + 1)
        self.observation_space = gymnasium.spaces.Box(
            np.zeros(4 * n + 1), np.array(high, dtype=np.float64), dtype=np.float64
        )
        self.action_space = gymnasium.spaces.Discrete(n)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Begin with an empty road and the first phase."""
        super().reset(seed=seed)
        drivers = int(self.np_random.integers(2**31))
        demand = self.np_random.uniform(*DEMANDS) if self._demand is None else self._demand
        episode = Episode(self._junction, self._seconds, demand, self._program, drivers)
        start = self._traffic.start(episode)
        self._signals = start["signals"]
        self._yellow = start["amber"] if self._amber is None else self._amber
        self._phase, self._clock, self._since = 0, 0, 0
        self._last_green = [0] * len(self._signals)
        return self._observation(start), {}

    def step(self, action: int) -> Any:
        """Show a phase, after amber where it is another one, until the next decision."""
        begun = self._clock
        if action == self._phase or self._program != "none":
            counts = self._show((self._signals[self._phase], DECISION))
        else:
            between = amber(self._signals[self._phase], self._signals[action])
            self._last_green[self._phase] = self._clock
            self._phase, self._since = int(action), self._clock + self._yellow
            counts = self._show((between, self._yellow), (self._signals[action], LEAST_GREEN))
        observation, over = self._observation(counts), self._clock >= self._seconds
        info = self._traffic.finish() if over else {}
        info["seconds"] = self._clock - begun
        return observation, -counts["standing"] / self._seconds, False, over, info

    def close(self) -> None:
        """Let the traffic go."""
        self._traffic.stop()

    def _show(self, *wanted: tuple[str, int]) -> dict[str, Any]:
        """Show signals one after the other, at most to the end of the episode."""
        shown = []
        for signals, seconds in wanted:
            left = min(seconds, self._seconds - self._clock)
            shown.append((signals if self._program == "none" else None, left))
            self._clock += left
        return self._traffic.show(shown)

    def _observation(self, counts: dict[str, Any]) -> Any:
        order = {lane: k for k, lane in enumerate(self._junction.all_lanes)}
        served = [[order[lane] for lane in lanes] for lanes in self._junction.lanes]
        counted = [np.array(counts[kind]) for kind in ("waiting", "coming")]
        green = np.eye(len(served))[self._phase]
        red = [min(self._clock - last, LONGEST) for last in self._last_green]
        red[self._phase] = 0
        return np.array(
            [
                *(min(each[lanes].sum(), MOST) for each in counted for lanes in served),
                *green,
                *red,
                min(max(self._clock - self._since, 0), LONGEST),
            ],
            dtype=np.float64,
        )
