"""The parts of a session's view: actions with their keys, lines of the list, the sensed numbers."""

import inspect
import re
from collections.abc import Iterable
from typing import Any

import gymnasium

from eutree.data import Episode
from eutree.interaction.controls import Hands
from eutree.interaction.events import ActionView, EpisodeView
from eutree.interaction.keys import KeyMap
from eutree.interaction.pace import QUICK, Pace
from eutree.interaction.trial import Trial
from eutree.schema import Schema


def action_views(keys: KeyMap, schema: Schema) -> list[ActionView]:
    """Return every action with the keys that mean it."""
    return [
        ActionView(name, keys.keys_of(action), action == keys.idle)
        for action, name in enumerate(schema.actions)
    ]


def hands_fields(hands: Hands, schema: Schema) -> dict[str, Any]:
    """Return the view's fields on keys and what is done with them."""
    return {
        "action": hands.action,
        "held": list(hands.held),
        "toggle": hands.toggle,
        "keys_chosen": hands.keys.chosen,
        "actions": action_views(hands.keys, schema),
        "controls": hands.keys.controls(),
    }


def pace_fields(pace: Pace, *, is_own: bool) -> dict[str, Any]:
    """Return the view's fields on the pace; ``is_own`` if it is the environment's."""
    return {
        "speed": pace.speed,
        "turn_based": pace.turn_based,
        "interval": pace.interval,
        "beat": pace.beat,
        "is_slowed": is_own and pace.fps > QUICK and pace.speed < 1.0,
    }


def episode_views(numbers: Iterable[int], episodes: Iterable[Episode]) -> list[EpisodeView]:
    """Return the lines of the list of episodes."""
    return [
        EpisodeView(
            number=number,
            result=episode.ending or "ended",
            success=episode.is_success,
            length=len(episode),
            total=episode.undiscounted_return,
            kept=episode.kept,
            comment=episode.comment,
            by_hand=None if episode.by_hand is None else int(episode.by_hand.sum()),
        )
        for number, episode in zip(numbers, episodes, strict=True)
    ]


def sensed(schema: Schema, trial: Trial | None) -> list[tuple[str, str]]:
    """Return names and values of the last observation, for people."""
    if trial is None or trial.observation is None:
        return []
    return [
        (feature.name, f"{feature.text(float(value))} {feature.unit}".strip())
        for feature, value in zip(schema.features, trial.observation, strict=True)
    ]


_SECTION = re.compile(r"^#+ *Description\s*\n(.*?)(?=^#|\Z)", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\[([^\]]*)\](\([^)]*\))?")
_GOAL = re.compile(r"\b(goal|objective|aim) (is|of)\b", re.IGNORECASE)
_LONGEST_TASK = 420


def task_description(env: gymnasium.Env[Any, Any]) -> str:
    """Return the task in the environment's own words, or an empty string.

    These are its ``task_description``; else the first paragraph under *Description* in its
    docstring, without markup. Of a long one whole sentences are left: the first that names a goal
    and what leads to it, else the first ones.
    """
    own = getattr(env.unwrapped, "task_description", None)
    if isinstance(own, str):
        return " ".join(own.split())
    found = _SECTION.search(inspect.cleandoc(type(env.unwrapped).__doc__ or ""))
    if found is None:
        return ""
    paragraph = found[1].strip().split("\n\n")[0]
    text = " ".join(_LINK.sub(r"\1", paragraph).replace("`", "").replace("*", "").split())
    return text if len(text) <= _LONGEST_TASK else _shortened(text)


def _shortened(text: str) -> str:
    """Return whole sentences of a long text: what leads to the goal, and the goal."""
    sentences = re.split(r"(?<=\.) ", text)
    goals = (n for n, sentence in enumerate(sentences) if _GOAL.search(sentence))
    if (goal := next(goals, None)) is None:
        return text[:_LONGEST_TASK].rpartition(". ")[0] + "."
    first = goal
    while first > 0 and len(" ".join(sentences[first - 1 : goal + 1])) <= _LONGEST_TASK:
        first -= 1
    return " ".join(sentences[first : goal + 1])
