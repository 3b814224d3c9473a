"""The words of a session on a task and on its episodes."""

import inspect
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources
from typing import Any

import gymnasium

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.interaction.first_look import is_limited
from eutree.recording.events import EpisodeView
from eutree.schema import Schema


def episode_views(
    numbers: Iterable[int], episodes: Iterable[Episode], env: gymnasium.Env[Any, Any] | None = None
) -> list[EpisodeView]:
    """Return the lines of the list of episodes, in the words of their environment."""
    return [
        EpisodeView(
            number=number,
            result=told(episode, env)[0],
            success=told(episode, env)[1],
            length=len(episode),
            total=episode.undiscounted_return,
            kept=episode.kept,
            comment=episode.comment,
            by_hand=None if episode.by_hand is None else int(episode.by_hand.sum()),
        )
        for number, episode in zip(numbers, episodes, strict=True)
    ]


@dataclass(frozen=True)
class _Told:
    """The words of one of Gymnasium's own tasks on its goal and its end; see ``tasks.toml``."""

    task: str
    by: str = ""
    good: str = "goal"
    bad: str = ""
    always_ends: bool = False


_TOLD = {
    name: _Told(**told)
    for name, told in tomllib.loads(
        (resources.files(__package__) / "tasks.toml").read_text(encoding="utf-8")
    ).items()
}


ENDLESS = (
    "Nothing but the task itself ends an episode: it names no time limit, and where it has none a "
    "tree that stands still stands for ever. Start with --env-arg max_episode_steps=200 to set one."
)


def never_ends(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether an episode may go on for ever, as far as the environment says."""
    known = _TOLD.get(type(env.unwrapped).__name__)
    return not is_limited(env) and not (known is not None and known.always_ends)


def told(episode: Episode, env: gymnasium.Env[Any, Any] | None) -> tuple[str, bool | None]:
    """Return how an episode ended, and whether that is a success, where its return tells it."""
    plain = episode.ending or "ended"
    known = None if env is None else _TOLD.get(type(env.unwrapped).__name__)
    ended = episode.terminated or episode.truncated
    if known is None or not known.by or episode.is_success is not None or not ended:
        return plain, episode.is_success
    by_return = episode.undiscounted_return > 0.0
    success = by_return if known.by == "return" else bool(getattr(episode, known.by))
    if success:
        return known.good, True
    return (known.bad if episode.terminated and known.bad else plain), False


def sensed(schema: Schema, observation: Floats | None) -> list[tuple[str, str]]:
    """Return names and values of an observation [d], for people; nothing of none."""
    if observation is None:
        return []
    return [
        (feature.name, f"{feature.text(float(value))} {feature.unit}".strip())
        for feature, value in zip(schema.features, observation, strict=True)
    ]


_SECTION = re.compile(r"^#+ *Description\s*\n(.*?)(?=^#|\Z)", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\[([^\]]*)\](\([^)]*\))?")
_GOAL = re.compile(r"\b(goal|objective|aim) (is|of)\b", re.IGNORECASE)
_LONGEST_TASK = 420


def task_description(env: gymnasium.Env[Any, Any]) -> str:
    """Return the task in the environment's own words, or an empty string.

    These are its ``task_description``, or for Gymnasium's own a sentence that is known here; else
    the first paragraph under *Description* in its docstring, without markup. Of a long one whole
    sentences are left: the first that names a goal and the means to it, else the first ones.
    """
    own = getattr(env.unwrapped, "task_description", None)
    if isinstance(own, str):
        return " ".join(own.split())
    known = _TOLD.get(type(env.unwrapped).__name__)
    if known is not None:
        return known.task
    found = _SECTION.search(inspect.cleandoc(type(env.unwrapped).__doc__ or ""))
    if found is None:
        return ""
    paragraph = found[1].strip().split("\n\n")[0]
    text = " ".join(_LINK.sub(r"\1", paragraph).replace("`", "").replace("*", "").split())
    return text if len(text) <= _LONGEST_TASK else _shortened(text)


def _shortened(text: str) -> str:
    """Return whole sentences of a long text: the means to the goal, and the goal."""
    sentences = re.split(r"(?<=\.) ", text)
    goals = (n for n, sentence in enumerate(sentences) if _GOAL.search(sentence))
    if (goal := next(goals, None)) is None:
        return text[:_LONGEST_TASK].rpartition(". ")[0] + "."
    first = goal
    while first > 0 and len(" ".join(sentences[first - 1 : goal + 1])) <= _LONGEST_TASK:
        first -= 1
    return " ".join(sentences[first : goal + 1])
