"""What a recording session is told at its start."""

from dataclasses import dataclass
from typing import Any

from gymnasium import Space, spaces

from eutree.interaction import GuardedEnv
from eutree.recording.keys import KeyMap
from eutree.validation import check_integer, check_number, check_seed


@dataclass(frozen=True, kw_only=True)
class SessionSettings:
    """What a session is told at its start.

    Attributes:
        target: How many kept episodes are wanted.
        seed: Seed of the recording; start k is seeded with ``episode_seed(seed, k, 6)``.
        first: Number of the first start: that of the episodes already in the folder.
        fps: Decisions per second; None for the environment's ``render_fps``.
        hud: Show the observation's numbers, which the paper's expert does not see.
        countdown: Seconds before an episode; a third of it when it goes on after a pause.
        makes: Whether a tree can be made of the demonstrations where they are recorded.
        viewer: What the person looks at, for the episode's extras.
    """

    target: int = 15
    seed: int = 0
    first: int = 0
    fps: float | None = None
    hud: bool = False
    countdown: float = 3.0
    makes: bool = False
    viewer: str = ""

    def __post_init__(self) -> None:
        check_integer("target", self.target, low=1)
        check_seed(self.seed)
        check_integer("first", self.first)
        check_number("countdown", self.countdown, low=0.0)
        if self.fps is not None:
            check_number("fps", self.fps, low=0.0, high=240.0, low_open=True)


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
