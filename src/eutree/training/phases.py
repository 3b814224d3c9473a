"""Where a run stands, and its next phase: a function of its plan and of its position.

    gather    one episode (Table 1, data gathering phase)
    update    the learner learns from its history (Table 1, expansion phase)
    evaluate  the frozen policy, on the same episodes each time
    race      one episode of the policy search, at the end
    front     the best tree of each size, of which one is picked
    judge     the pick against the start, on episodes that chose nothing

Nothing else decides: neither the clock nor the log of events. A run that learns from recorded
episodes alone has no gathering phase: it updates until nothing changes.

A run of few episodes, in an environment whose episodes run one by one, was made short because they
are dear: it evaluates in proportion. How much its frozen trees play follows from the number of its
episodes alone, so the same seed gives the same bytes on any machine; only where minutes are the
budget the clock has a say, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import msgspec
import numpy as np

from eutree.learners import Step
from eutree.training.handover import Handover
from eutree.training.proposals import SearchSettings
from eutree.training.race_state import Count
from eutree.validation import check_amounts, check_measures, check_seed

USUAL = 400  # episodes of a run; in one of so many, or more, evaluation is no matter of proportion
FEW = 40  # episodes up to which half as many are played beside
EVERY, EPISODES = 20, 100  # of the frozen evaluations, where they are not dear
ENOUGH = 5  # episodes of an evaluation, where a quarter of the allowance is less
END = 0.2  # of the minutes: what is kept for evaluation at the end
ALONG = 0.2  # of the time so far, that evaluations along the way may take


def allowance(lived: float) -> int:
    """Return the most episodes that are played beside so many that are learned from.

    Half as many up to 40, and from there on as the square.

    >>> [allowance(lived) for lived in (10, 40, 100, 400)]
    [5, 20, 125, 2000]
    """
    return int(lived * max(lived, FEW) / (2 * FEW))


def is_dear(expected: float | None) -> bool:
    """Return whether a run of so many episodes, which run one by one, has to keep to proportion."""
    return expected is not None and 0 < expected < USUAL


def curve_of(
    every: int | None, episodes: int | None, expected: int | None, *, decides: bool
) -> tuple[int, int]:
    """Return the episodes between two evaluations, and those of each, as far as nobody named them.

    ``expected`` are those of the run, where it has to keep to proportion. ``decides`` says whether
    evaluations along the way decide; else the first and the last do.
    """
    if expected is None or not is_dear(expected):
        return every or EVERY, episodes or EPISODES
    every = every or (EVERY if decides else USUAL)
    most, points = allowance(expected), 1 - (-expected // every)
    fair = max(most // (4 * points), min(ENOUGH, most // (2 * points)), 1)
    return every, episodes or min(fair, EPISODES)


def left(lived: float, played: int) -> int:
    """Return how many episodes may still be played at the end of a run.

    A quarter of the allowance is, whatever was played beside those lived, races included: that was
    asked for by name.
    """
    return max(allowance(lived) - played, allowance(lived) // 4, 2)


def within(seconds: float, played: int, took: float) -> int:
    """Return how many episodes, or steps, so much time is enough for, one at least.

    It took ``took`` seconds to play ``played`` of them.
    """
    return max(int(seconds * played / took), 1) if played and took > 0.0 else 1


MANY = 10**12  # episodes, where only another budget ends a run
FEWEST = 5  # episodes between two updates, however long they are


class Phase(StrEnum):
    """A phase of a run."""

    GATHER = "gather"
    UPDATE = "update"
    EVALUATE = "evaluate"
    RACE = "race"
    FRONT = "front"
    JUDGE = "judge"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How long a run is, and when it does each thing.

    Attributes:
        episodes: Most episodes of experience; without gathering, most updates.
        steps: Most environment steps of the run: gathering, teachers and racing. An episode begins
            only if the longest possible one still fits or, where none is known, the longest so
            far; a longer one is cut short. None sets no limit.
        seconds: Most seconds of the clock; None sets no limit.
        evaluate_every: Episodes between two evaluations; the first is before episode 0.
        evaluation_episodes: Episodes of each.
        is_dear: Whether all that frozen trees play is in proportion to the run.
        gathers: Whether there is an environment to gather in.
        race: The policy search at the end; None for none.
        keep_success: Whether the policy is replaced only by one that succeeds as often.
        handover: How it is decided whether the result or the start is handed over; None hands over
            the result, and says how it did against the start.
        monotone: Rules that every policy of the run keeps, as for ``verify``.
        seed: Seed of the run.
    """

    episodes: int = 400
    steps: int | None = None
    seconds: float | None = None
    evaluate_every: int = 20
    evaluation_episodes: int = EPISODES
    is_dear: bool = False
    gathers: bool = True
    race: SearchSettings | None = None
    keep_success: bool = False
    handover: Handover | None = None
    monotone: tuple[str, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        check_amounts(self, episodes=0, steps=1, evaluate_every=1)
        check_measures(self, "seconds", low=0.0, low_open=True)
        check_seed(self.seed)

    def room(self, at: "Position") -> int | None:
        """Return the steps that are left for gathering; None sets no limit."""
        return None if self.steps is None else self.steps - self.race_steps - at.steps

    def time_is_over(self, at: "Position") -> bool:
        """Return whether the clock ends gathering and racing: a share is kept for the end."""
        if self.seconds is None:
            return False
        one_more = at.seconds / at.episode if at.episode else 0.0
        return at.seconds + one_more >= (1.0 - END) * self.seconds

    @property
    def race_steps(self) -> int:
        """Steps set aside for racing."""
        return 0 if self.race is None else self.race.steps


class Position(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where a run stands between two phases.

    Attributes:
        episode: Episodes gathered.
        steps: Environment steps gathered, those of teachers included.
        teacher_steps: Those in which a teacher acted: one who was asked, or whom trees copy.
        racing_steps: Environment steps of the policy search.
        longest: Steps of the longest episode gathered.
        seconds: Seconds of the clock so far.
        challengers: Trees that were put to the test so far, those of a race under way apart.
        updates: Updates so far.
        updated_at: Episode of the last update; -1 if there was none.
        updated_steps: Steps gathered up to the last update.
        evaluated_at: Episode of the last evaluation of the present policy; -1 if there was none.
        settled: Whether the last update changed nothing.
        raced: Whether the policy search is over.
        fronted: Whether the front was made.
        front_steps: Environment steps that it took.
        judged: Whether the result was compared with the start.
        played_episodes: Episodes that frozen trees played: those of evaluations, front, judgement.
        evaluation_steps: Steps of the evaluations among them.
    """

    episode: Count = 0
    steps: Count = 0
    teacher_steps: Count = 0
    racing_steps: Count = 0
    longest: Count = 0
    seconds: float = 0.0
    challengers: Count = 0
    updates: Count = 0
    updated_at: int = -1
    updated_steps: Count = 0
    evaluated_at: int = -1
    settled: bool = False
    raced: bool = False
    fronted: bool = False
    front_steps: Count = 0
    judged: bool = False
    played_episodes: Count = 0
    evaluation_steps: Count = 0

    @property
    def lived(self) -> float:
        """Episodes that were learned from; a race counts for as many as its steps would be."""
        if not self.steps:
            return float(self.episode)
        return self.episode * (self.steps + self.racing_steps) / self.steps


def due(
    plan: Plan,
    at: Position,
    *,
    gathering_episodes: int,
    max_episode_steps: int | None,
    gathering_steps: int | None = None,
) -> Phase | None:
    """Return the phase that comes next; None at the end of the run.

    Between two updates the learner gathers so many episodes or, five at least, so many steps. The
    longest episode so far stands for an unknown ``max_episode_steps``.
    """
    if not plan.gathers:
        return None if at.settled or at.updates >= plan.episodes else Phase.UPDATE
    if at.raced:
        return _after_the_race(plan, at)
    over = at.episode >= plan.episodes or not _fits(plan, at, max_episode_steps)
    fresh = max(at.updated_at, at.evaluated_at) < at.episode
    enough = at.episode % gathering_episodes == 0
    if gathering_steps is not None:
        few = at.episode - max(at.updated_at, 0) < FEWEST
        enough = enough or (not few and at.steps - at.updated_steps >= gathering_steps)
    if at.episode and fresh and (over or enough):
        return Phase.UPDATE
    if at.evaluated_at < at.episode and (over or at.episode % plan.evaluate_every == 0):
        return Phase.EVALUATE
    if not over:
        return Phase.GATHER
    return Phase.RACE if plan.race_steps else _after_the_race(plan, at)


def _after_the_race(plan: Plan, at: Position) -> Phase | None:
    if at.evaluated_at < at.episode:
        return Phase.EVALUATE
    if plan.handover is not None and plan.handover.has_front and not at.fronted:
        return None if at.judged else Phase.FRONT
    judges = plan.handover is None or plan.handover.judges
    return Phase.JUDGE if judges and not at.judged else None


def _fits(plan: Plan, at: Position, max_episode_steps: int | None) -> bool:
    """Return whether one more episode may be gathered: steps and time allow for it."""
    if plan.time_is_over(at):
        return False
    room = plan.room(at)
    longest = at.longest if max_episode_steps is None else max_episode_steps
    return room is None or max(longest, 1) <= room


class Follower:
    """Is told of the steps of a run, and may end it; see ``eutree.training.listeners.Listener``."""

    def wants_stop(self) -> bool:
        """Return whether the run is to end at its last finished episode; asked before each step."""
        return False

    def gathering_begins(self) -> None:
        """Take note that the first episode of a gathering phase, or the race, begins."""

    def step_taken(self, step: Step) -> bool:
        """Take note of a step; return False to end the run."""
        return True

    def gathering_ends(self) -> None:
        """Take note that an update follows, or that the race is over."""


class RunState:
    """The state that the phases of a run have in common.

    Args:
        listeners: Who is told of each step, in this order, and may end the run.

    Attributes:
        at: Where the run stands between two phases.
        steps_of_episode: Steps of the episode under way, gathered or raced; 0 between two.
        events: Those so far: updates, evaluations, races, and the records of listeners.
        recorded: Measurements of listeners since the last finished episode, by name.
        stopped: Whether a listener ended the run.
        whole: Whether the learner is between two phases, so that a checkpoint may be saved; False
            while, and after, an interruption struck in the middle of one.
    """

    def __init__(self, listeners: Sequence[Follower] = ()) -> None:
        self.at = Position()
        self.steps_of_episode = 0
        self.events: list[dict[str, Any]] = []
        self.recorded: dict[str, float | int | None] = {}
        self.stopped = False
        self.whole = True
        self._listeners = listeners
        self._gathering = False

    @property
    def num_timesteps(self) -> int:
        """Steps so far: gathered, raced, and those of the running episode."""
        return self.at.steps + self.at.racing_steps + self.steps_of_episode

    def move(self, **changes: Any) -> None:
        """Stand elsewhere from now on."""
        self.at = msgspec.structs.replace(self.at, **changes)

    def note(self, event: str, facts: dict[str, Any]) -> None:
        """Add an event that happened here and now."""
        here = {"event": event, "episode": self.at.episode, "steps": self.num_timesteps}
        self.events.append(here | facts)

    def note_what_was_recorded(self) -> None:
        """Add the listeners' measurements, if there are any."""
        if self.recorded:
            self.note("record", {"values": dict(self.recorded)})
            self.recorded.clear()

    def must_stop(self) -> bool:
        """Return whether the run ends here; who may end it is asked."""
        self.stopped = self.stopped or any(one.wants_stop() for one in self._listeners)
        return self.stopped

    def step_taken(self, step: Step) -> None:
        """Tell listeners of a step; each may end the run."""
        wishes = [one.step_taken(step) for one in self._listeners]
        self.stopped = self.stopped or not all(wishes)

    def gathering_begins(self) -> None:
        """Tell listeners that episodes follow, if none came before."""
        for one in () if self._gathering else self._listeners:
            one.gathering_begins()
        self._gathering = True

    def gathering_ends(self) -> None:
        """Tell listeners that an update follows, or that the race is over."""
        if self._gathering:
            for one in self._listeners:
                one.gathering_ends()
            self.note_what_was_recorded()
        self._gathering = False


def generator_of(seed: int, stream: int, number: int) -> np.random.Generator:
    """Return the generator of one episode or update of a run."""
    return np.random.default_rng(np.random.SeedSequence((seed, stream, number)))
