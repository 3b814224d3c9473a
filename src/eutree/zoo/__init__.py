"""Learned trees that come with the package: the best of each task at each size.

Every tree was learned by this package, in a run whose command, seed and counted steps its card
names, and evaluated on episodes that chose nothing (``benchmarks/table.py``, docs/zoo.md).

>>> from eutree import zoo
>>> zoo.load("MountainCar-v0").tree.n_leaves <= 8
True
"""

import json
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from eutree.errors import InvalidArgumentError, UnknownNameError, shown
from eutree.policies import TreePolicy

__all__ = [
    "PREFIX", "Card", "card", "cards", "load", "module_of", "path_of", "settings_of", "tasks",
]  # fmt: skip

PREFIX = "zoo:"  # of a name where a file could stand as well
_HOME = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class Card:
    """The record of a tree of the zoo.

    Attributes:
        task: Id of its environment.
        most_leaves: The size that it is the best of.
        leaves: Leaves that it has.
        mean_return: Mean return of the episodes.
        interval: 95 % interval of the mean over the episodes.
        worst: Return of the worst of them.
        success: Share of them that succeeded; None where the task has no success.
        episodes: Fresh episodes that were played.
        steps: Environment steps that it was learned in, everything counted.
        seed: Seed of its run.
        command: The command that learned it.
        commit: With which sources.
        date: When, as YYYY-MM-DD.
        extra: Package to install to play it, such as ``gymnasium[box2d]``; may be empty.
        module: Module that registers its environment where the package does not, for ``--import``:
            a module of the repository; may be empty.
        proven: Sentence of ``eutree prove`` on it; None where nothing is proven.
        file: Its file in the zoo.
    """

    task: str
    most_leaves: int
    leaves: int
    mean_return: float
    interval: tuple[float, float]
    worst: float
    success: float | None
    episodes: int
    steps: int
    seed: int
    command: str
    commit: str
    date: str
    extra: str
    module: str
    proven: str | None
    file: str

    @property
    def name(self) -> str:
        """Return the name by which it is loaded, such as ``CartPole-v1:4``."""
        return f"{self.task}:{self.most_leaves}"


@cache
def cards() -> tuple[Card, ...]:
    """Return the cards of all trees: task by task, the smallest size first."""
    documents = json.loads((_HOME / "cards.json").read_text())
    return tuple(Card(**one | {"interval": tuple(one["interval"])}) for one in documents)


def tasks() -> tuple[str, ...]:
    """Return the ids of the tasks of which there are trees."""
    return tuple(dict.fromkeys(one.task for one in cards()))


def card(name: str) -> Card:
    """Return the card of a tree.

    Args:
        name: A task, ``MountainCar-v0``, for the smallest of its trees whose mean return lies in
            the interval of the best one's; or with a size, ``MountainCar-v0:4``, for the best of at
            most so many leaves.

    Raises:
        UnknownNameError: There is no tree of this task.
        InvalidArgumentError: There is none as small as that, or the name is no text.
    """
    if not isinstance(name, str):
        raise InvalidArgumentError(f"name must be that of a tree of the zoo, got {shown(name)}")
    task, separator, size = name.removeprefix(PREFIX).rpartition(":")
    if not separator:
        task, size = size, ""
    known = [one for one in cards() if one.task == task]
    if not known:
        raise UnknownNameError("tree of the zoo", task, tasks(), hint="eutree zoo lists them")
    best = max(known, key=lambda one: one.mean_return)
    if not size:
        return next(one for one in known if one.mean_return >= best.interval[0])
    small = [one for one in known if size.isdecimal() and one.leaves <= int(size)]
    if not small:
        raise InvalidArgumentError(
            f"the size of {task} in the zoo must be a number of leaves, at least "
            f"{min(one.leaves for one in known)}, got {size!r}"
        )
    return max(small, key=lambda one: one.mean_return)


def path_of(name: str) -> Path:
    """Return the policy file of a tree; see ``card`` for its name."""
    return _HOME / "trees" / card(name).file


def load(name: str) -> TreePolicy:
    """Return a tree of the zoo, ready to decide; see ``card`` for its name and the errors."""
    return TreePolicy.load(path_of(name))


def settings_of(task: str) -> Path:
    """Return the file of settings that are known to work on a task, for ``learn --settings``.

    Raises:
        UnknownNameError: There is none of this task.
        InvalidArgumentError: The task is no text.
    """
    if not isinstance(task, str):
        raise InvalidArgumentError(f"task must be that of settings of the zoo, got {shown(task)}")
    name, files = task.removeprefix(PREFIX), _settings()
    if name not in files:
        raise UnknownNameError("task with settings", name, files)
    return files[name]


def module_of(task: str) -> str:
    """Return the example of the repository that registers a task; "" where none has to."""
    file = _settings().get(task)
    expert: str = "" if file is None else tomllib.loads(file.read_text())["run"]["expert"]
    return expert.rpartition(":")[0]


def _settings() -> dict[str, Path]:
    """Return the files of settings by task; they have "-" where the ids of our tasks have "/"."""
    found = (_HOME / "settings").glob("*.toml")
    return {file.stem.replace("eutree-", "eutree/"): file for file in found}
