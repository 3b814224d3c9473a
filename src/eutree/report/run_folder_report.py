"""The report of one run, from its folder: teacher, world model, races, curve, trees."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eutree.compression.episodes import FrontEntry
from eutree.display import fixed
from eutree.errors import FormatError, InvalidArgumentError, blamed
from eutree.files import read_bytes
from eutree.policies import TreePolicy
from eutree.policy_search.model_trust import ModelTrust
from eutree.report.chart import Series, line
from eutree.report.run_page import RunReport, Table, WatchedTree

RACES = ("race", "tree", "made by", "episodes", "mean return", "then")
SHOWN = "The policy: a click on a leaf says what is known of it."
WINDOW = 20  # training episodes of a mean of the teacher's
_MOST = 2**28  # bytes of a log
_FILES = (
    ("the policy", "policy.json"),
    ("how the run was started", "config.json"),
    ("its frozen evaluations", "curve.csv"),
    ("the best tree of each size", "front.csv"),
    ("what happened", "events.jsonl"),
)

Event = dict[str, Any]


def report_of_run(folder: str | Path) -> RunReport:
    """Return the content of a run's page.

    Args:
        folder: The run folder, of a run that is over or under way.

    Raises:
        FileError: A file of it cannot be read.
        FormatError: Its log or its configuration is not as a run writes it.
        InvalidArgumentError: It holds no run.
    """
    path = Path(folder)
    for name in ("config.json", "events.jsonl"):
        if not (path / name).exists():
            raise InvalidArgumentError(f"{path} must be a run folder, got one without {name}")
    config = _objects(path / "config.json")[0]
    events = _objects(path / "events.jsonl")
    try:
        return _report(path, config, events)
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(path / "events.jsonl", "event", f"is not a run's: {error}") from None


def _report(path: Path, config: Event, events: Sequence[Event]) -> RunReport:
    judged = _last(events, "judgement")
    taught = [event for event in events if event.get("stage") == "teacher"]
    steps = max((int(event["steps"]) for event in events), default=0)
    counted = f"Seed {config['seed']}, {steps:,} steps of learning and racing."
    notes = [*_last_evaluation(events), counted]
    trees = {
        caption: TreePolicy.load(path / name)
        for caption, name in (("The policy", "policy.json"), ("Its start", "expert.json"))
        if (path / name).exists()
    }
    policy = trees.pop("The policy", None)
    races = _races(events)
    if taught:
        notes.append(f"{int(taught[-1]['steps']):,} of them are its teacher's.")
    if config.get("teacher"):
        notes.append(f"Its teacher is one's own: {config['teacher']}, which are not counted.")
    verdict = "This run has not ended yet, or had nothing to be judged against."
    if judged is not None:
        from eutree.training import Judgement

        judgement = Judgement.from_facts(judged)
        began = judgement.start or policy  # the same where nothing better was found
        sentences = judgement.describe(0 if began is None else began.n_leaves), judgement.verdict()
        verdict = " ".join(f"{one[0].upper()}{one[1:]}." for one in sentences if one)
    front, picked = _front(path, events)
    return RunReport(
        title=f"{path.resolve().name}: {config['method']['name']} in {config['environment']}",
        curves=_curves(events, taught),
        verdict=[verdict],
        watched=None if policy is None else WatchedTree(policy, caption=SHOWN),
        tables={"Races": Table(RACES, races)} if races else {},
        trees=trees,
        files=[(label, name) for label, name in _FILES if (path / name).exists()],
        notes=notes,
        front=front,
        picked=picked,
        trust=_trust(events),
    )


def _last(events: Sequence[Event], kind: str) -> Event | None:
    return next((event for event in reversed(events) if event["event"] == kind), None)


def _front(path: Path, events: Sequence[Event]) -> tuple[list[FrontEntry], int | None]:
    """Return the front of a run whose trees are there, and the leaves of the pick."""
    known = _last(events, "front")
    if known is None or not (path / "front").is_dir():
        return [], None
    names = ["learned", *(str(int(facts["n_leaves"])) for facts in known["front"][1:])]
    trees = [TreePolicy.load(path / "front" / f"{name}.json") for name in names]
    pairs = zip(trees, known["front"], strict=True)
    return [FrontEntry.from_facts(*pair) for pair in pairs], int(known["picked"])


def _last_evaluation(events: Sequence[Event]) -> list[str]:
    """Return a sentence on how the policy did when it was last evaluated, if it ever was."""
    found = _last(events, "evaluation")
    if found is None:
        return []
    success, earned = found.get("success_rate"), found["mean_return"]
    succeeded = "" if success is None else f"{success:.0%} success, ".replace("%", " %")
    # The tree that is handed over may be another one of the front.
    learning = "" if _last(events, "front") is None else "of learning "
    return [
        f"At the end {learning}{succeeded}mean return {earned:{fixed(2, [earned])}} "
        f"with {found['n_leaves']:,} leaves."
    ]


def _objects(path: Path) -> list[Event]:
    """Return the JSON objects of a file, one or one in each line."""
    text = read_bytes(path, limit=_MOST).decode(errors="replace")
    lines = text.splitlines() if path.suffix == ".jsonl" else [text]
    with blamed(path, "document", (ValueError, RecursionError)):
        found = [json.loads(line) for line in lines]
    if not all(isinstance(one, dict) for one in found):
        raise FormatError(path, "document", "must be objects of JSON")
    return found


def _curves(events: Sequence[Event], taught: Sequence[Event]) -> dict[str, Series]:
    """Return the frozen evaluations, and the teacher's training returns, as means of twenty."""
    curves: dict[str, Series] = {}
    points = [event for event in events if event["event"] == "evaluation"]
    if len(points) > 1:
        learned = line((event["episode"], event["mean_return"]) for event in points)
        curves["return of the policy"] = {"learned": learned}
    if len(taught) > WINDOW:
        returns = np.array([float(event["return"]) for event in taught])
        mean = np.convolve(returns, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
        number = np.array([float(event["episode"]) for event in taught[WINDOW - 1 :]])
        some = np.unique(np.linspace(0, mean.size - 1, 200).astype(int))  # enough for a line
        means = line(zip(number[some], mean[some], strict=True))
        curves["return of the teacher while it learns"] = {"teacher": means}
    return curves


def _trust(events: Sequence[Event]) -> ModelTrust | None:
    """Return the last comparison of imagined with real returns; None where there was none."""
    known = [event for event in events if "imagined" in event]
    if not known:
        return None
    last = known[-1]
    return ModelTrust(
        np.array(last["imagined"], dtype=np.float64),
        np.array(last["real"], dtype=np.float64),
        np.array(last["real_episodes"], dtype=np.int64),
    )


def _races(events: Sequence[Event]) -> list[tuple[str, ...]]:
    episodes: dict[tuple[int, int], list[Event]] = {}
    winners: dict[int, Event] = {}
    for event in events:
        if "race" in event and "entrant" in event:
            episodes.setdefault((int(event["race"]), int(event["entrant"])), []).append(event)
            if "policy" in event or "winner" in event:
                winners[int(event["race"])] = event
    return [
        (
            str(race),
            str(entrant),
            str(runs[0]["origin"]),
            str(len(runs)),
            f"{np.mean([float(event['return']) for event in runs]):.1f}",
            _fate(entrant, winners.get(race)),
        )
        for (race, entrant), runs in sorted(episodes.items())
    ]


def _fate(entrant: int, end: Mapping[str, Any] | None) -> str:
    if end is None:
        return ""
    winner = end.get("winner")
    words = ["is the policy"] if entrant == end.get("policy", winner) else []
    if entrant == winner and end["ahead"]:
        words.append(f"won, {end['ahead']:+.1f} (s.e. {end['error']:.1f}, {end['pairs']} pairs)")
    return ", ".join(words)
