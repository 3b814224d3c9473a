"""When a person decided, and what was on their screen then.

A step's action is read from the keys at the step's time, but it was decided before: at the key's
edge if a key went down or up since the step before, else at the step itself. A recording has the
number of the picture that was on the screen at every step and at every edge, so the observation on
the screen at any moment can be told:

* (time, picture) of steps and edges, with straight lines between them, say which picture it was;
* (picture, observation) of the steps say what that picture showed: between two steps the movement
  is shown evenly where there are pictures in between, else the next step's picture comes at once.

``shift_delay`` pairs each action with that observation. The recording itself is never changed.

The reaction time before an edge can be told only where pictures change at the steps and stand
still in between: there an edge follows the change that caused it. Where everything moves evenly,
who reacts late to a near disc looks like who reacts at once to a farther one.
"""

from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.data.demonstrations import Demonstrations
from eutree.data.episode import Episode
from eutree.errors import InvalidArgumentError
from eutree.validation import check_number

SHORTEST_STILL = 0.4  # seconds a picture must stand for a reaction to fall into the same one
FEWEST_EDGES = 5  # for a median
PAUSE = 2.0  # usual intervals between two steps: what takes longer was a pause
PICTURES_A_SECOND = 30.0
_MEASURED = ("time", "frame", "picture")


@dataclass(frozen=True)
class Delay:
    """What can be told of a person's delay; each part is None where it cannot.

    Attributes:
        screen: Mean time by which the screen was behind the environment, in seconds.
        reaction: Median time from a change of the picture to the key's edge that follows it.
        wait: Mean time from a key's edge to the step that takes it.
        n_edges: Edges of action keys during the kept episodes.
    """

    screen: float | None
    reaction: float | None
    wait: float | None
    n_edges: int


def has_times(demonstrations: Demonstrations) -> bool:
    """Return whether every kept episode was recorded with times and pictures."""
    return len(demonstrations) > 0 and all(_is_timed(episode) for episode in demonstrations)


def shift_delay(demonstrations: Demonstrations, *, delay: float = 0.0) -> Demonstrations:
    """Return demonstrations in which each action stands beside what was on the screen for it.

    They are for fitting a tree to: their observations are no transitions of the environment.
    Episodes of the turn-based mode, in which nothing moves meanwhile, stay as they are.

    Args:
        demonstrations: Episodes recorded by a person at the page or the window.
        delay: Reaction time before the keys changed, in seconds; 0 takes what was on the screen
            when the key was pressed.

    Raises:
        InvalidArgumentError: An episode was not recorded with times and pictures.
    """
    _check_times(demonstrations)
    check_number("delay", delay, low=0.0)
    whole = _whole_columns(demonstrations)
    shifted = tuple(
        _shifted(episode, delay, whole) if episode.kept else episode
        for episode in demonstrations.episodes
    )
    return replace(demonstrations, episodes=shifted)


def estimate_delay(demonstrations: Demonstrations) -> Delay:
    """Return what edges and pictures tell of a person's delay.

    Raises:
        InvalidArgumentError: An episode was not recorded with times and pictures.
    """
    _check_times(demonstrations)
    played = [e for e in demonstrations if len(e) and not e.extras.get("turn_based")]
    waits = [wait for episode in played for wait in _waits(episode)]
    reactions = [time for episode in played for time in _reactions(episode)]
    behind = [
        np.subtract(episode.steps["picture"], episode.steps["frame"]) / PICTURES_A_SECOND
        for episode in played
        if _is_smooth(episode)
    ]
    return Delay(
        screen=float(np.concatenate(behind).mean()) if behind else None,
        reaction=float(np.median(reactions)) if len(reactions) >= FEWEST_EDGES else None,
        wait=float(np.mean(waits)) if waits else None,
        n_edges=len(waits),
    )


def _is_timed(episode: Episode) -> bool:
    return all(name in episode.steps for name in _MEASURED)


def _check_times(demonstrations: Demonstrations) -> None:
    for number, episode in enumerate(demonstrations.episodes):
        if episode.kept and not _is_timed(episode):
            raise InvalidArgumentError(
                "demonstrations must be recorded by a person at the page or the window, with times "
                f"and pictures; episode {number} has none"
            )


def _whole_columns(demonstrations: Demonstrations) -> Booleans:
    """Return which features are whole numbers throughout: nothing lies between two of them."""
    observations = demonstrations.observations
    return np.asarray((observations == np.round(observations)).all(axis=0))


def _edges(episode: Episode) -> Floats:
    """Return time and picture of the edges of action keys, in order, shape [K, 2]."""
    keys = set(episode.extras.get("keys", ()))
    rows = [(when, frame) for key, _, when, frame in episode.extras.get("edges", ()) if key in keys]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _waits(episode: Episode) -> list[float]:
    """Return how long each edge during the episode waited for the step that takes it.

    Those are left out between whose steps the episode was paused.
    """
    times = np.asarray(episode.steps["time"], dtype=np.float64)
    if len(times) < 2:
        return []
    when = _edges(episode)[:, 0]
    step = np.searchsorted(times, when)
    during = (step > 0) & (step < len(times))
    step, when = step[during], when[during]
    gaps = np.diff(times)
    steady = gaps[step - 1] < PAUSE * np.median(gaps)
    return [float(wait) for wait in (times[step] - when)[steady]]


def _reactions(episode: Episode) -> list[float]:
    """Return how long after the last change of a still picture each edge came."""
    if _is_smooth(episode):
        return []
    times = np.asarray(episode.steps["time"], dtype=np.float64)
    when = _edges(episode)[:, 0]
    step = np.searchsorted(times, when)  # the picture of this step came at the step before
    found = []
    for edge, after in zip(when.tolist(), step.tolist(), strict=True):
        if 0 < after < len(times) and times[after] - times[after - 1] >= SHORTEST_STILL:
            found.append(edge - float(times[after - 1]))
    return found


def _is_smooth(episode: Episode) -> bool:
    """Return whether the movement between two steps was shown."""
    pictures = np.asarray(episode.steps["picture"])
    return len(pictures) > 1 and bool(np.diff(pictures).max() > 1)


def _shifted(episode: Episode, delay: float, whole: Booleans) -> Episode:
    if episode.extras.get("turn_based") or not len(episode):
        return episode
    decided = _decision_times(episode) - delay
    seen = _on_screen(episode, decided, whole)
    return replace(episode, observations=np.vstack([seen, episode.observations[-1:]]))


def _decision_times(episode: Episode) -> Floats:
    """Return when the keys of each step got as they were: at an edge since the last, or at it."""
    times = np.asarray(episode.steps["time"], dtype=np.float64)
    when = _edges(episode)[:, 0]
    last = np.searchsorted(when, times, side="right") - 1  # the last edge before each step
    edge = np.where(last >= 0, when[np.maximum(last, 0)] if len(when) else -np.inf, -np.inf)
    before = np.concatenate([[-np.inf], times[:-1]])
    return np.where(edge > before, edge, times)


def _on_screen(episode: Episode, moments: Floats, whole: Booleans) -> Floats:
    """Return the observation that the screen showed at some moments, shape [M, d]."""
    pictures = np.asarray(episode.steps["picture"], dtype=np.float64)
    known = np.vstack(
        [np.column_stack([episode.steps["time"], episode.steps["frame"]]), _edges(episode)]
    )
    known = known[np.argsort(known[:, 0], kind="stable")]
    frames = np.interp(moments, known[:, 0], np.maximum.accumulate(known[:, 1]))
    rows = episode.observations[:-1]
    is_smooth = _is_smooth(episode)
    if not is_smooth:
        frames = np.ceil(frames - 1e-9)  # the next step's picture comes at once
    earlier = np.clip(np.searchsorted(pictures, frames, side="right") - 1, 0, None)
    columns = [
        rows[earlier, j] if whole[j] or not is_smooth else np.interp(frames, pictures, rows[:, j])
        for j in range(rows.shape[1])
    ]
    return np.column_stack(columns)
