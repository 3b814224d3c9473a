"""The parts of a session's view: actions with their keys, lines of the list, the sensed numbers."""

from collections.abc import Iterable

from eutree.data import Episode
from eutree.interaction.events import ActionView, EpisodeView
from eutree.interaction.keys import KeyMap
from eutree.interaction.trial import Trial
from eutree.schema import Schema


def action_views(keys: KeyMap, schema: Schema) -> list[ActionView]:
    """Return every action with the keys that mean it."""
    return [
        ActionView(name, keys.keys_of(action), action == keys.idle)
        for action, name in enumerate(schema.actions)
    ]


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
        )
        for number, episode in zip(numbers, episodes, strict=True)
    ]


def sensed(schema: Schema, trial: Trial | None) -> list[tuple[str, str]]:
    """Return names and values of the last observation, for people."""
    if trial is None or trial.observation is None:
        return []
    return [
        (feature.name, f"{value:.3g} {feature.unit}".strip())
        for feature, value in zip(schema.features, trial.observation, strict=True)
    ]
