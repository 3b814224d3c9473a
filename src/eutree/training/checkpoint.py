"""Checkpoints: all that a run needs to go on from the end of an episode, in one archive.

The events of the run are stored as the bytes of its ``events.jsonl``, because the JSON document
beside the arrays may hold 16 MiB only, and a run may have more to tell.

Reading one trusts nothing: its contents are checked against the run that is to go on from it, and
against itself, before the learner is made.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats
from eutree.compression.episodes import FrontEntry
from eutree.errors import FormatError, blamed
from eutree.evaluation import CurvePoint
from eutree.files import Document, read_archive, write_archive
from eutree.learners import History, Part, Stored
from eutree.learners.declared import HISTORY_PART, Declared, part, taken
from eutree.learners.episode_buffer import transitions_of
from eutree.learners.registry import restored, state_of
from eutree.training.handover import Judgement
from eutree.training.phases import Position
from eutree.training.progress import GatheredEpisodes, progress_to_csv
from eutree.training.race_state import (
    Count,
    PolicyText,
    RaceDocument,
    episodes_from_arrays,
    episodes_to_arrays,
    race_from_document,
    race_to_document,
)
from eutree.training.run import Run
from eutree.trees import DecisionTree
from eutree.world_model import Transitions

CHECKPOINT = "checkpoint.npz"
_EVENTS = "run_events"
_MISREAD = (IndexError, KeyError, TypeError, ValueError, OverflowError)  # where events are others
MAX_CHECKPOINT = 4 * 2**30  # bytes; a run of some ten million steps and more


class FrontDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The front of a run: its trees, the largest first, and the one that was picked."""

    trees: list[PolicyText]
    picked: PolicyText


class KeptDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The policy that success must not fall from, and how often it succeeded."""

    policy: PolicyText
    successes: Count


_NAMED_SINCE = {"history_lots": "history_ranks"}  # arrays of version 2


class CheckpointDocument(Document, frozen=True, kw_only=True):
    """Where a run stood at the end of an episode; the arrays beside it are the learner's."""

    FORMAT: ClassVar[str] = "eutree/checkpoint"
    VERSION: ClassVar[int] = 4

    position: Position
    kept: KeptDocument | None = None
    result: PolicyText | None = None
    race: RaceDocument | None = None
    earlier: tuple[PolicyText, ...] = ()
    front: FrontDocument | None = None
    played: dict[str, Count] = msgspec.field(default_factory=dict)


def write_checkpoint(path: Path, run: Run) -> None:
    """Write where a run stands, atomically; not a state that could not be read back."""
    kept, search, result = run.evaluations.kept, run.racing.search, run.racing.result
    front, picked = run.evaluations.front, run.evaluations.picked
    document = CheckpointDocument(
        position=run.at,
        kept=None if kept is None else KeptDocument(PolicyText.of(kept[0]), kept[1]),
        result=None if result is None else PolicyText.of(result),
        race=None if search is None else race_to_document(search.state),
        earlier=tuple(PolicyText.of(one) for one in run.evaluations.earlier),
        front=None
        if picked is None
        else FrontDocument([PolicyText.of(one.policy) for one in front], PolicyText.of(picked)),
        played=run.evaluations.counts,
    )
    events = np.frombuffer(events_to_text(run.state.events).encode(), dtype=np.uint8)
    begin = run.beginning
    state = state_of(run.learner, begin.method, begin.problem, begin.start)
    arrays = {**state, **run.gathered.state(), _EVENTS: events}
    if search is not None:
        arrays |= episodes_to_arrays(search.all_episodes)
    write_archive(path, document, arrays, limit=MAX_CHECKPOINT)


def events_to_text(events: Sequence[Mapping[str, Any]]) -> str:
    """Return the events of a run as JSON Lines: the content of ``events.jsonl``."""
    return "".join(json.dumps(event, allow_nan=False) + "\n" for event in events)


def restore_checkpoint(path: Path, run: Run) -> None:
    """Bring ``run``, at its start, to where the checkpoint stands.

    Raises:
        FormatError: The file is damaged, or is the checkpoint of another run.
    """
    document, arrays = read_archive(path, CheckpointDocument, limit=MAX_CHECKPOINT)
    if document.version < 3:
        arrays = {_NAMED_SINCE.get(name, name): array for name, array in arrays.items()}
    method, problem, start = run.beginning.method, run.beginning.problem, run.beginning.start
    gathered, events = _gathered(path, arrays), _events(path, arrays)
    raced = []
    if document.race is not None:
        n_features = document.race.incumbent.policy(path).tree.n_features
        raced = episodes_from_arrays(path, arrays, problem.n_actions, n_features)
    _check_events(path, events, gathered)
    run.learner = restored(path, arrays, method, problem, start)
    run.state.at = document.position
    with blamed(path, f"{_EVENTS}: an evaluation", _MISREAD):
        points = [event for event in events if event["event"] == "evaluation"]
        rows = [{one.name: point.get(one.name) for one in fields(CurvePoint)} for point in points]
        run.evaluations.curve = msgspec.convert(rows, list[CurvePoint])
    with blamed(path, f"{_EVENTS}: a judgement", _MISREAD):
        judged = [Judgement.from_facts(one) for one in events if one["event"] == "judgement"]
    run.evaluations.judgement = judged[-1] if judged and run.at.judged else None
    run.state.events, run.gathered = events, gathered
    if document.kept is not None:
        run.evaluations.kept = document.kept.policy.policy(path), document.kept.successes
    run.evaluations.played.counts = dict(document.played)
    run.evaluations.counts = dict(document.played)
    run.evaluations.earlier = [one.policy(path) for one in document.earlier]
    if document.front is not None and run.at.fronted:
        run.evaluations.picked = document.front.picked.policy(path)
        trees = [one.policy(path) for one in document.front.trees]
        with blamed(path, f"{_EVENTS}: a front", _MISREAD):
            facts = [event["front"] for event in events if event["event"] == "front"]
            pairs = zip(trees, facts[-1] if trees else (), strict=True)
            run.evaluations.front = tuple(FrontEntry.from_facts(*pair) for pair in pairs)
    if document.result is not None:
        run.racing.result = document.result.policy(path)
    if document.race is not None:
        state = race_from_document(document.race, path, len(raced))
        run.racing.search = run.new_search()
        run.racing.search.restore(state, raced)


_GATHERED = Part({
    "episode_returns": Stored("f8", "E"),
    "episode_lengths": Stored("i8", "E"),
    "episode_successes": Stored("i1", "E"),
})  # fmt: skip


def stored_observations(path: str | Path) -> Floats:
    """Return the observations of all transitions that a run folder's learner stored, [N, d]."""
    checkpoint, name = Path(path) / CHECKPOINT, "history_observations"
    stored = read_archive(checkpoint, CheckpointDocument, limit=MAX_CHECKPOINT)[1].get(name)
    if stored is None:
        raise FormatError(checkpoint, name, "missing")
    if stored.dtype != np.float64 or stored.ndim != 2 or not np.isfinite(stored).all():
        raise FormatError(checkpoint, name, "must be finite numbers of shape [N, d]")
    return stored


def stored_transitions(path: str | Path, n_actions: int) -> Transitions:
    """Return all transitions that a run folder's learner stored, as a world model is fitted to.

    Args:
        path: The folder.
        n_actions: Number of actions of its task.
    """
    checkpoint = Path(path) / CHECKPOINT
    arrays = read_archive(checkpoint, CheckpointDocument, limit=MAX_CHECKPOINT)[1]
    stored = {name: arrays[name] for name in HISTORY_PART.arrays if name in arrays}
    n_features = np.shape(stored.get("history_observations", 0))[-1:] or (0,)
    declared = Declared(n_features[0], n_actions, (HISTORY_PART,))
    state = part(taken(checkpoint, stored, declared), "history_")
    return transitions_of(
        History.from_state(state, DecisionTree.single_leaf(n_features[0])), n_actions
    )


def _gathered(path: Path, arrays: dict[str, NDArray[Any]]) -> GatheredEpisodes:
    """Take a run's notes on its episodes out of the arrays of its checkpoint."""
    gathered = GatheredEpisodes()
    state = {name: arrays.pop(name, array) for name, array in gathered.state().items()}
    taken(path, state, Declared(0, 0, (_GATHERED,)))
    gathered.restore(state)
    return gathered


def _events(path: Path, arrays: dict[str, NDArray[Any]]) -> list[dict[str, Any]]:
    """Take the events of a run out of the arrays of its checkpoint."""
    stored = arrays.pop(_EVENTS, None)
    if stored is None or stored.dtype != np.uint8 or stored.ndim != 1:
        raise FormatError(path, _EVENTS, "must be there, as bytes")
    events, wrong = [], (msgspec.MsgspecError, RecursionError, UnicodeDecodeError)
    for number, line in enumerate(stored.tobytes().splitlines(), 1):
        with blamed(path, f"{_EVENTS}, line {number}", wrong):
            events.append(msgspec.json.decode(line, type=dict[str, Any]))
    return events


def _check_events(path: Path, events: list[dict[str, Any]], gathered: GatheredEpisodes) -> None:
    """Raise FormatError unless each event has a name and an episode, and tells its kind's facts."""
    for place, event in enumerate(events, 1):
        where = f"{_EVENTS}, line {place}"
        if not isinstance(event.get("event"), str):
            raise FormatError(path, where, "event must be a name")
        if type(event.get("episode")) is not int:
            raise FormatError(path, where, "episode must be a whole number")
    with blamed(path, f"{_EVENTS}: not those of a run", _MISREAD):
        progress_to_csv(events, gathered)
