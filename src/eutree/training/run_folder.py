"""The folder of a learning run: its results, and all it needs to go on after any interruption.

    config.json        how the run was started
    command.json       the command that started it, if one did
    checkpoint.npz     everything the learner knows, at the end of an episode
    curve.csv          the frozen evaluations so far
    progress.csv       the same and the gathering phases, under the names of Stable-Baselines3
    events.jsonl       one line for each thing that happened
    expert.json        the expert tree
    shown/             random episodes that it begins from, where nobody has shown any
    policy.json        the policy that is handed over
    learned.json       the learned one, where another is handed over
    picked.json        the one on trial at the end, where it lost to the start, without a front
    front.csv          the best tree of each size: leaves, return, success, with intervals
    front/             these trees
    .lock              held by the process that writes here

A checkpoint is written whole or not at all, so the folder can always be resumed from the old one
or the new one. The lock is the operating system's: it ends with the process that holds it.
"""

import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import msgspec

from eutree.compression.episodes import FrontEntry
from eutree.data import Demonstrations
from eutree.errors import FormatError, RunFolderError, blamed
from eutree.evaluation import curve_to_csv
from eutree.evaluation.curves import table_to_csv
from eutree.files import Document, locked, make_folder, read_document, write_document, write_text
from eutree.files.atomic import RUN, remove_orphans
from eutree.learners import METHODS, Method
from eutree.learners.registry import from_document, to_document
from eutree.policies import TreePolicy
from eutree.training.checkpoint import (
    CHECKPOINT,
    events_to_text,
    restore_checkpoint,
    write_checkpoint,
)
from eutree.training.progress import progress_to_csv
from eutree.training.proposals import identity
from eutree.training.run import Run

_FRONT = ("tree", "n_leaves", "mean_return", "return_low", "return_high", "success_rate",
          "success_low", "success_high", "picked")  # fmt: skip
SHOWN = "shown"
MIN_SAVING_INTERVAL = 1.0  # seconds
SHARE = 20
_LENGTH = ("episodes", "steps", "minutes")  # which may be another when a run is resumed
_EVALUATION = {"evaluate_every": "every", "evaluation_episodes": "episodes"}


class ConfigDocument(Document, frozen=True, kw_only=True):
    """How a run was started; a resumed run must be started the same way."""

    FORMAT: ClassVar[str] = "eutree/run"
    VERSION: ClassVar[int] = 2

    environment: str
    method: dict[str, Any]
    start: str
    episodes: int
    steps: int | None = None
    minutes: float | None = None
    evaluate_every: int | None  # None: in proportion to the run, whatever its length
    evaluation_episodes: int | None
    history: int
    seed: int
    demonstrations: str
    expert: str = ""
    teacher: str = ""
    asking: str = ""  # of earlier releases, which could ask: a run that did cannot go on
    strict: bool = False
    race: dict[str, Any] | None = None
    keep_success: bool = False
    judge_episodes: int | None = None
    return_range: tuple[float, float] | None = None
    front_steps: int | None = None
    starts: str = ""
    monotone: tuple[str, ...] = ()
    names: tuple[str, ...] = ()  # of features, with the formulas of derived ones, and actions


def started(out: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the parts of the budget and of the schedule of the run in a folder; none without."""
    path = Path(out) / "config.json"
    if not path.exists():
        return {}, {}
    known = read_document(path, ConfigDocument)
    schedule = {part: getattr(known, name) for name, part in _EVALUATION.items()}
    return {name: getattr(known, name) for name in _LENGTH}, schedule


class SavingClock:
    """When the next checkpoint is due.

    Args:
        seconds: Time between two checkpoints; None for at least a second, and as much more as
            it takes for saving to cost at most a twentieth of the time.
    """

    def __init__(self, seconds: float | None = None) -> None:
        self._last = time.monotonic()
        self._seconds = seconds
        self._cost = MIN_SAVING_INTERVAL / SHARE

    def due(self) -> bool:
        """Return whether enough time has passed since the last checkpoint."""
        wait = self._cost * SHARE if self._seconds is None else self._seconds
        return time.monotonic() - self._last >= wait

    @contextmanager
    def saving(self) -> Iterator[None]:
        """Measure how long saving takes."""
        start = time.monotonic()
        yield
        self._last = time.monotonic()
        self._cost = max(self._last - start, MIN_SAVING_INTERVAL / SHARE)


class RunFolder:
    """An open and locked run folder.

    Args:
        path: The folder; it is made if it does not exist.
        config: How the run is started.
        kind: The class of its method, which reads back its state.
        resume: Go on with the run that is there, instead of refusing a folder that holds a run.

    Raises:
        RunFolderError: Another process writes here; or a run is here and ``resume`` is False; or
            the run that is here was started differently.
    """

    def __init__(
        self, path: str | Path, config: ConfigDocument, kind: type[Method], *, resume: bool
    ) -> None:
        self.path = make_folder(path, of=RUN)
        self._lock = locked(self.path)
        self._begun_with: list[Path] = []
        try:
            self._open(config, kind, resume=resume)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "RunFolder":
        return self

    def __exit__(self, kind: type[BaseException] | None, *exception: object) -> None:
        if kind is not None and not (self.path / CHECKPOINT).exists():
            for path in self._begun_with:  # nothing to go on with: it would only be in the way
                path.unlink(missing_ok=True)
        self.close()

    def close(self) -> None:
        """Let go of the lock."""
        os.close(self._lock)

    def save_start(self, expert: TreePolicy | None) -> None:
        """Write the expert tree, if it is not there; one that is there is never replaced."""
        path = self.path / "expert.json"
        if expert is not None and not path.exists():
            expert.save(path)
            self._begun_with.append(path)

    def save_shown(self, shown: Demonstrations) -> None:
        """Write the random episodes that a run begins from: not every environment repeats them."""
        if not (self.path / SHOWN).exists():
            shown.save(self.path / SHOWN)

    def save_checkpoint(self, run: Run) -> None:
        """Write all that is needed to go on from here, and the curve so far."""
        write_checkpoint(self.path / CHECKPOINT, run)
        write_text(self.path / "curve.csv", curve_to_csv(run.curve))
        progress = progress_to_csv(run.state.events, run.gathered)
        write_text(self.path / "progress.csv", progress)
        write_text(self.path / "events.jsonl", events_to_text(run.state.events))

    def load_checkpoint(self, run: Run) -> bool:
        """Bring ``run`` to where the checkpoint stands; return whether there is one."""
        path = self.path / CHECKPOINT
        if not path.exists():
            return False
        restore_checkpoint(path, run)
        if run.at.raced and self._longer:
            raise RunFolderError(
                f"{self.path}: the run has raced after {run.episode} episodes and cannot gather "
                "more; start another one from its policy"
            )
        if self._longer:
            for name, lived in (("episodes", run.at.episode), ("steps", run.at.steps)):
                most = getattr(self._config, name)
                if most is not None and lived > most:
                    raise RunFolderError(
                        f"{self.path}: the run has had {lived} {name}; ask for more, or leave "
                        "that out"
                    )
            write_document(self.path / "config.json", self._config)
        return True

    def save_result(
        self,
        policy: TreePolicy,
        learned: TreePolicy,
        front: Sequence[FrontEntry],
        picked: TreePolicy | None,
        *,
        lost: bool,
    ) -> None:
        """Write the policy that is handed over; beside it the learned one where it is another.

        Also where the start is handed over, because another tree has ``lost`` to it.
        """
        policy.save(self.path / "policy.json")
        kept = {}
        if lost or identity(learned) != identity(policy):
            kept["learned"] = learned
        if picked is not None and not front and identity(picked) != identity(policy):
            kept["picked"] = picked
        for name in ("learned", "picked"):
            file = self.path / f"{name}.json"
            if name in kept:
                kept[name].save(file)
            else:
                file.unlink(missing_ok=True)
        _save_front(self.path, front, picked)

    def _open(self, config: ConfigDocument, kind: type[Method], *, resume: bool) -> None:
        remove_orphans(self.path)
        self._longer, self._config = False, config
        path = self.path / "config.json"
        if not path.exists():
            if any(self.path.glob("runs/*/config.json")):
                held = f"{self.path} already holds several runs"
                raise RunFolderError(f"{held}; choose another folder")
            shutil.rmtree(self.path / SHOWN, ignore_errors=True)  # of a run that never began
            write_document(path, config)
            self._begun_with.append(path)
            return
        if not resume:
            raise RunFolderError(
                f"{self.path} already holds a run; go on with it (--resume) or choose another "
                "folder"
            )
        found = read_document(path, ConfigDocument)
        _check_same(path, found, config, kind)
        length = {name: getattr(config, name) for name in _LENGTH}
        self._config = msgspec.structs.replace(found, **length)
        self._longer = self._config != found


def names_of(front: Sequence[FrontEntry]) -> list[str]:
    """Return the name of each tree's file: the others were made of the first."""
    sizes = [one.policy.n_leaves for one in front[1:]]
    return [f"front/{name}.json" for name in ("learned", *sizes)][: len(front)]


def _save_front(folder: Path, front: Sequence[FrontEntry], picked: TreePolicy | None) -> None:
    """Write the trees of a front, if there is one, and the table of their returns."""
    shutil.rmtree(folder / "front", ignore_errors=True)  # of a run that is longer now
    (folder / "front.csv").unlink(missing_ok=True)
    if not front:
        return
    make_folder(folder / "front")
    rows = []
    for number, (name, one) in enumerate(zip(names_of(front), front, strict=True)):
        one.policy.save(folder / name)
        success = one.success_rate, *(one.success_interval or (None, None))
        size = one.policy.n_leaves
        is_picked = number > 0 and picked is not None and size == picked.n_leaves
        rows.append((name, size, one.mean_return, *one.return_interval, *success, int(is_picked)))
    write_text(folder / "front.csv", table_to_csv(_FRONT, rows))


def _check_same(
    path: Path, found: ConfigDocument, wanted: ConfigDocument, kind: type[Method]
) -> None:
    """Raise RunFolderError unless the run was started as it is resumed; its length may differ."""
    unsaid = [name for name in _EVALUATION if getattr(found, name) is None]
    unsaid += ["names"] * (not found.names)  # of earlier releases
    free = ("format", "version", "made_by", "method", *_LENGTH, *unsaid)
    names = [name for name in ConfigDocument.__struct_fields__ if name not in free]
    pairs = {name: (repr(getattr(found, name)), repr(getattr(wanted, name))) for name in names}
    pairs |= _choices(_method(path, found, kind), wanted.method)
    for name, (one, other) in pairs.items():
        if one != other:
            if name in ("demonstrations", "expert", "starts"):  # hashes, which tell nobody anything
                one, other = "that are not those given now", "these"
            own = name == "method" and found.method["name"] not in METHODS
            raise RunFolderError(
                f"{path}: the run was started with {name} {one}, so it cannot be resumed with "
                f"{other}{'; name its class again, MODULE:CLASS' if own else ''}"
            )


def _method(path: Path, config: ConfigDocument, kind: type[Method]) -> dict[str, Any]:
    """Return the method of a stored configuration; choices that it does not name are usual ones.

    A method of another name is not asked for: that the names differ is all there is to say.
    """
    if not isinstance(config.method.get("name"), str):
        raise FormatError(path, "method", "must have a name")
    if config.method["name"] != kind.name:
        return {"name": config.method["name"]}
    with blamed(path, "method"):
        return to_document(from_document(config.method, kind=kind))


def _choices(
    one: dict[str, Any], other: dict[str, Any], prefix: str = ""
) -> dict[str, tuple[str, str]]:
    """Return each choice of two methods, those of a part as ``"planner.growth"``."""
    pairs: dict[str, tuple[str, str]] = {}
    for name in one | other:
        mine, theirs = one.get(name), other.get(name)
        if isinstance(mine, dict) and isinstance(theirs, dict):
            pairs |= _choices(mine, theirs, f"{prefix}{name}.")
        else:
            label = "method" if name == "name" and not prefix else prefix + name
            pairs[label] = (repr(mine), repr(theirs))
    return pairs
