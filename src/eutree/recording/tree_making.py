"""The page's view of the tree that is made of its demonstrations, and the protocol of its maker.

Recording knows nothing of learning: the page is handed a ``TreeMaker``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from eutree.recording.events import Event
from eutree.recording.scenes import Programme, Scene
from eutree.schema import Schema

FITTING, PLAYING, PRACTISING = "fitting", "playing", "practising"
READY, FAILED = "ready", "failed"


@dataclass(frozen=True, kw_only=True)
class WayView:
    """One way of doing the task, beside others, in JSON's types."""

    name: str  # of its owner: "your tree", "practised"
    cells: tuple[str, ...]  # its result, its time, its waiting and its risk, in words
    keep: str = ""  # the words of the button that chooses it; empty for a way without a tree
    is_kept: bool = False  # it is the one on the page


@dataclass(frozen=True)
class Segment:
    """Consecutive steps of one demonstrated episode in which the same action was taken.

    Attributes:
        episode: Number among ``Demonstrations.episodes``; on the recorder's page in the folder.
        start: Its first step, from 0.
        stop: The step after its last one.
        seconds: When it begins and ends, from the episode's first step; None if unknown.
        action: The action taken.
        becomes: The action to be imitated in its place; None for nothing.
    """

    episode: int
    start: int
    stop: int
    seconds: tuple[float, float] | None
    action: int
    becomes: int | None

    def words(self, schema: Schema, numbers: Sequence[int] | None) -> str:
        """Return which steps these are, counted from 1, and the action in their place.

        Args:
            schema: Names of the actions.
            numbers: The number of each episode in its folder; None does not name the episode.
        """
        names, first = schema.actions, self.start + 1
        steps = f"step {first}" if self.stop == first else f"steps {first} to {self.stop}"
        when = (
            "" if self.seconds is None else f" ({self.seconds[0]:.1f} to {self.seconds[1]:.1f} s)"
        )
        to = "" if self.becomes in (None, self.action) else f", as if {names[self.becomes or 0]}"
        which = "" if numbers is None else f"episode {numbers[self.episode]}, "
        return f"{which}{steps}{when}: {names[self.action]}{to}"


@dataclass(frozen=True, kw_only=True)
class StripView:
    """The course of an episode: its actions, the keys held, the steps that hurt."""

    number: int  # of the episode
    runs: tuple[tuple[int, int], ...]  # action and number of steps, one after the other
    keys: tuple[tuple[str, int, int], ...]  # name, first step and the one after the last, each time
    marks: tuple[tuple[int, int], ...]  # first step and the one after the last
    words: str  # the same in a sentence


@dataclass(frozen=True, kw_only=True)
class HurtView:
    """Segments that cost the tree its success."""

    what: str  # "cut", "flip" or "show again"
    title: str  # the proposal, in words
    why: str  # the common trait of the segments
    reached: str  # the result of the tree with them, and without them
    segments: tuple[Segment, ...]  # cut, flipped or shown again; their episodes as in the folder
    strips: tuple[StripView, ...]  # the episodes that they are of, as many as can be looked at


@dataclass(frozen=True, kw_only=True)
class TreeView:
    """How far a tree is, in JSON's types.

    ``message`` is the work under way, or the verdict: ``"you 13 of 15 (62 to 97 %); this tree 196
    of 200 (94 to 100 %): better"``. ``verdict`` is how it compares with the person: ``"better"``,
    ``"as good"``, ``"worse"``, ``"too close to tell"`` or ``"not comparable"``; empty before.
    """

    phase: str  # "fitting", "playing", "practising", "ready" or "failed"
    message: str = ""
    note: str = ""  # the consequence of the message; may be empty
    finished: int = 0  # episodes played or practised so far
    of: int = 0  # how many there will be; 0 where that is not known
    verdict: str = ""
    may_gain: bool = False  # whether practice may make it better, so that it is offered
    n_leaves: int = 0  # 0 before there is a tree
    svg: str = ""  # drawing of the tree; empty before there is one
    rules: str = ""  # the tree as nested rules
    curve: tuple[tuple[int, float], ...] = ()  # episodes of practice, and the result after them
    yours: float | None = None  # the person's result, on the curve's scale; None if unknown
    is_share: bool = True  # curve and yours are shares of successful episodes, else mean returns
    commands: tuple[str, ...] = ()  # the next ones for a shell, one a line
    columns: tuple[str, ...] = ()  # heads of the columns of the ways
    ways: tuple[WayView, ...] = ()  # own, tree, practised, smaller ones; empty before practice
    changes: tuple[str, ...] = ()  # sentences on the changes by practice
    hurts: tuple[HurtView, ...] = ()  # in the demonstrations
    was_searched: bool = False  # whether these were looked for
    asks: bool = False  # made without some of them, and to be accepted or taken back


class Show(Protocol):
    """Lets the page show how far a tree is, and once it is ready its scenes."""

    def __call__(self, view: TreeView, programme: Programme | None = None) -> None:
        """Show a view; let the tree drive in the page's picture if there is a programme."""


class TreeMaker(Protocol):
    """Makes a tree of the recording, in a thread beside the page.

    All methods call ``show`` as they go on, with ``"ready"`` last. ``stop`` becomes true when the
    page is closed for ever; unfinished work then is given up.
    """

    def make(self, show: Show, stop: Callable[[], bool]) -> None:
        """Fit a tree to the demonstrations recorded so far, and let it play."""

    def practise(self, show: Show, stop: Callable[[], bool]) -> None:
        """Let the tree learn for a while, and keep the better one."""

    def missing(self) -> Scene | None:
        """Return a situation not shown yet, as a scene; None if nothing is found."""

    def choose(self, way: int, show: Show) -> None:
        """Keep the tree of one of the ways that were shown."""

    def look(self, show: Show, stop: Callable[[], bool]) -> None:
        """Find the seconds of the demonstrations that cost the tree its success."""

    def make_without(self, show: Show, stop: Callable[[], bool]) -> None:
        """Make the tree of the steps left, beside the one of all, and ask which one to keep."""

    def settle(self, show: Show, *, undo: bool) -> None:
        """Keep the tree of the steps left, or the one before it."""


class Guide(Protocol):
    """Leads a person through a session, part by part, on the page."""

    def advance(self, now: float) -> list[Event]:
        """Go on to the next part if this one is over; return the events for the session."""

    def hear(self, name: str, place: int, text: str) -> None:
        """Take in the person's answer to the guide."""

    def view(self) -> dict[str, Any]:
        """Return the guide's fields on the page, in JSON's types."""


class Wishes:
    """The person's wishes for the demonstrations, until they are taken up."""

    def __init__(self, are_offered: bool) -> None:
        self.are_offered = are_offered  # there is a TreeMaker
        self.is_busy = False  # whether a tree is being made; set by its maker
        self.way = 0  # that was last chosen
        self.look = False  # whether to look for situations that were not shown so far
        self._wish, self._is_leaving, self._was_made = "", False, False

    def express(self, name: str, way: float | str | None = None) -> None:
        """Wish for ``"make"`` or ``"practise"``, or ``"choose"`` one of the ways."""
        if self.are_offered:
            self._wish, self._was_made = name, True
            self.way = int(way or 0)

    def express_first(self) -> None:
        """Wish for a tree unless one has been wished for."""
        if not self._was_made:
            self.express("make")

    @property
    def is_leaving(self) -> bool:
        """Whether the person wanted to leave while a tree is being made, and is asked again."""
        return self._is_leaving and self.is_busy

    def leave(self) -> bool:
        """Return whether to leave now: while a tree is being made, at the second wish only."""
        asked, self._is_leaving = self.is_leaving, True
        return asked or not self.is_busy

    def stay(self) -> bool:
        """Take back a wish to leave; return whether there was one to answer."""
        asked, self._is_leaving = self.is_leaving, False
        return asked

    def take(self) -> str:
        """Return the wish, once; empty if there is none."""
        wish, self._wish = self._wish, ""
        return wish
