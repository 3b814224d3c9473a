"""The inputs of a recording session, and its outputs to be stored and shown."""

from dataclasses import dataclass, field
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.validation import check_integer, check_measures, check_number, check_seed

Number = Annotated[int, msgspec.Meta(ge=0, lt=2**32)]  # of a picture or of a key

# ---- in: the settings of a session, and the acts of the person and the viewer


@dataclass(frozen=True, kw_only=True)
class SessionSettings:
    """The settings of a session.

    Attributes:
        target: How many kept episodes are wanted.
        seed: Seed of the recording; start k is seeded with ``episode_seed(seed, k, 6)``.
        first: Number of the first start: that of the episodes already in the folder.
        fps: Decisions per second; None for the environment's ``render_fps``.
        hud: Show the observation's numbers, which the paper's expert does not see.
        countdown: Seconds before an episode; a third of it when it goes on after a pause.
        makes: Whether a tree can be made of the demonstrations where they are recorded.
        viewer: The person's view, for the episode's extras.
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
        check_measures(self, "fps", low=0.0, high=240.0, low_open=True)


@dataclass(frozen=True)
class KeyDown:
    """A key went down while the picture ``frame`` was on the viewer's screen."""

    key: str
    frame: int = 0


@dataclass(frozen=True)
class KeyUp:
    """A key went up while the picture ``frame`` was on the viewer's screen."""

    key: str
    frame: int = 0


class Seen(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="drawn"):
    """The viewer has drawn the picture ``frame``; as JSON it is the page's message of that."""

    frame: Number


@dataclass(frozen=True)
class Away:
    """Focus or connection was lost: all keys count as released, a running episode pauses."""

    reason: str


@dataclass(frozen=True)
class Present:
    """A viewer has come, or has come back."""


class Command(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="do"):
    """A button was pressed or a setting chosen: see ``Session.COMMANDS``; as JSON a message."""

    name: str
    value: float | bool | None = None
    key: str = ""


Event = KeyDown | KeyUp | Seen | Away | Present | Command

# ---- out: to be stored


@dataclass(frozen=True)
class EpisodeStarted:
    """An episode was reset."""

    observation: Floats  # [d]
    seed: int
    extras: dict[str, Any]


@dataclass(frozen=True)
class StepTaken:
    """One step of the running episode."""

    action: int
    reward: float
    observation: Floats  # [d] after the action
    terminated: bool
    truncated: bool
    steps: dict[str, Any]


@dataclass(frozen=True)
class EpisodeEnded:
    """The running episode is over and is to be stored; ``index`` is its place in the list."""

    index: int
    episode: Episode


@dataclass(frozen=True)
class EpisodeAbandoned:
    """The running episode ended before its first step: there is nothing to store."""


@dataclass(frozen=True)
class EpisodeChanged:
    """A stored episode was kept or discarded."""

    index: int
    episode: Episode


Output = EpisodeStarted | StepTaken | EpisodeEnded | EpisodeAbandoned | EpisodeChanged

# ---- out: to be shown


@dataclass(frozen=True)
class Frame:
    """A picture of the environment, numbered from 1."""

    number: int
    pixels: NDArray[np.uint8]  # [height, width, 3]


@dataclass(frozen=True)
class ActionView:
    """An action, and the keys that mean it."""

    name: str
    keys: list[str]
    is_idle: bool


@dataclass(frozen=True)
class EpisodeView:
    """One line of the list of episodes."""

    number: int
    result: str
    success: bool | None
    length: int
    total: float
    kept: bool
    comment: str
    by_hand: int | None  # steps in which the person took over; None where no tree drove


@dataclass(frozen=True)
class DrivingView:
    """The picture and the facts to be seen while a tree drives."""

    number: int  # of the episode, from 1
    of: int  # 0 where it goes on until the person has enough
    action: int  # the tree's
    by_hand: bool  # the person acts in its place
    n_by_hand: int  # steps in which the person acted
    note: str  # on these episodes as a whole
    is_over: bool
    is_paused: bool
    ending: str
    success: bool | None
    why: str  # the cause of failure in the episode that is over
    nodes: tuple[int, ...]  # the way through the tree, from the root to the leaf
    tests: tuple[str, ...]  # on that way, with the values sensed


@dataclass(frozen=True)
class View:
    """All that a screen shows beside the picture, in JSON's types."""

    state: str
    environment: str
    message: str
    countdown: int
    step: int
    saved: int
    target: int
    action: int
    held: list[str]
    speed: float
    toggle: bool
    turn_based: bool
    keys_chosen: bool
    actions: list[ActionView]
    controls: dict[str, str]
    episodes: list[EpisodeView]
    last: int | None  # place in them of the episode that ended just now, if it had a step
    leaving: bool  # leaving now gives up the tree that is being made: the person is asked
    coming: int  # the action that the held keys mean, taken at the next decision
    awaits_key: bool  # the first decision comes with the first action key
    interval: float  # seconds between two decisions
    beat: float  # share of the interval that was over when it last began or went on
    is_slowed: bool  # the task is quick, and is shown slowly
    task: str
    makes: bool
    missing: str  # the situation not shown yet, where the next episode may begin
    can_watch: bool
    can_correct: bool
    driving: DrivingView | None
    numbers: list[tuple[str, str]] | None
    size: tuple[int, int]


@dataclass(frozen=True)
class Tick:
    """The answer of a session at one moment: its view, a new picture if any, its outputs."""

    view: View
    frame: Frame | None
    outputs: list[Output] = field(default_factory=list)
