"""A policy watched while it decides: the tree, an episode player, what is known of each leaf."""

import base64
import json
from collections.abc import Sequence
from html import escape
from string import Template
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.data import Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.export._palette import FILLS
from eutree.policies import TreePolicy
from eutree.report.html import as_json, asset, base_style, page
from eutree.report.watching import WatchedEpisode
from eutree.wording import counted

_SCRIPTS = ("model", "tree", "player", "details", "rules", "slices", "search")

SIZE_LIMIT = 5_000_000

EXACT, SHORT = 17, 6  # significant digits: all that a double has; enough to read
MOST_EXACT = 60_000  # numbers of observations, about a megabyte


def policy_page(
    policy: TreePolicy,
    *,
    episodes: Sequence[WatchedEpisode] = (),
    demonstrations: Demonstrations | None = None,
    title: str = "",
    file: str = "policy.json",
    size_limit: int = SIZE_LIMIT,
) -> str:
    """Return one self-contained HTML page on which the policy can be watched and questioned.

    Args:
        policy: The policy.
        episodes: Episodes of the policy to play, with or without pictures.
        demonstrations: Which demonstrated steps fell in which leaf is shown, if given.
        title: Heading of the page; by default the environment's id.
        file: Name of the policy's file, for the command line that repeats what is changed on the
            page and for the name of the edited file.
        size_limit: Size of the page in bytes above which pictures are left out, those of the
            last episodes first.
    """
    heading = title or (policy.environment.id if policy.environment else "A decision tree")
    subtitle = f"{counted(policy.n_leaves, 'leaf')}, {policy.schema.n_features} features"
    if policy.environment and policy.environment.arguments:
        arguments = sorted(policy.environment.arguments.items())
        subtitle += "".join(f", {key} = {value}" for key, value in arguments)
    body = Template(asset("policy.html")).substitute(
        title=escape(heading), subtitle=escape(subtitle)
    )
    data = _data(policy, episodes, demonstrations) | {"file": file}
    scripts = "".join(asset(f"{name}.js") for name in _SCRIPTS)
    style = asset("policy.css")
    text = body + scripts + base_style() + style
    room = size_limit - len(as_json(data)) - len(text.encode()) - 4096
    for entry, watched in zip(data["episodes"], episodes, strict=True):
        frames = _frames(watched)
        room -= sum(map(len, frames)) + 3 * len(frames)
        if room < 0:
            break
        entry["frames"] = frames or None
    return page(title=heading, body=body, style=style, script=scripts, data=data)


def _data(
    policy: TreePolicy,
    episodes: Sequence[WatchedEpisode],
    demonstrations: Demonstrations | None,
) -> dict[str, Any]:
    """Return what the page's script reads, without pictures."""
    tree, schema = policy.tree, policy.schema
    names = ("feature", "left", "right", "leaf")
    shown = [
        {
            "name": feature.name,
            "unit": feature.unit,
            "low": _finite(feature.low),
            "high": _finite(feature.high),
        }
        for feature in schema.features
    ]
    recorded = () if demonstrations is None else demonstrations.episodes
    n_numbers = sum(watched.episode.observations.size for watched in episodes) * (
        policy.history + 1
    )
    digits = EXACT if n_numbers <= MOST_EXACT else SHORT
    statistics = None
    if policy.leaves is not None:
        statistics = {
            "visits": policy.leaves.visits.tolist(),
            "values": _rounded(policy.leaves.values),
            "deviations": _rounded(policy.leaves.deviations),
        }
    return {
        "tree": {name: getattr(tree, name).tolist() for name in names}
        | {"threshold": [_finite(value) for value in tree.threshold.tolist()]},
        "features": shown,
        "actions": list(schema.actions),
        "fills": FILLS,
        "leafActions": policy.actions.tolist(),
        "leaves": statistics,
        "document": _document(policy),
        "episodes": [
            _episode(policy, watched.episode, whole=True, digits=digits) for watched in episodes
        ],
        "demonstrations": [_episode(policy, episode, whole=False) for episode in recorded],
    }


def _document(policy: TreePolicy) -> Any:
    """Return the content of the policy's file, or None if no file can hold it."""
    try:
        return json.loads(policy.to_bytes())
    except InvalidArgumentError:
        return None


def _episode(
    policy: TreePolicy, episode: Episode, *, whole: bool, digits: int = SHORT
) -> dict[str, Any]:
    """Return an episode: always which leaf each step fell in; what was seen, if ``whole``."""
    features = policy_features(policy, episode)
    leaves = policy.tree.leaf_index(features)
    entry = {
        "actions": episode.actions.tolist(),
        "rewards": [float(f"{value:.6g}") for value in episode.rewards.tolist()],
        "leaves": leaves.tolist() if whole else leaves[:-1].tolist(),
    }
    if whole:
        entry |= {
            "observations": _rounded(features, digits),
            "ending": episode.ending,
            "success": episode.is_success,
            "frames": None,
        }
    return entry


def policy_features(policy: TreePolicy, episode: Episode) -> Floats:
    """Return what the policy sees at each observation of an episode, the past included."""
    observations = episode.observations
    if observations.shape[1] != policy.observation_size:
        raise InvalidArgumentError(
            f"episodes must have observations of {policy.observation_size} features, "
            f"got {observations.shape[1]}"
        )
    return policy.features.of_episode(observations, episode.actions)


def _frames(watched: WatchedEpisode) -> list[str]:
    """Return the pictures of an episode as data URIs."""
    return [
        f"data:{watched.media_type};base64,{base64.b64encode(frame).decode('ascii')}"
        for frame in watched.frames
    ]


def _rounded(matrix: Floats, digits: int = SHORT) -> list[list[float | None]]:
    """Return numbers with some significant digits; NaN becomes None."""
    return [
        [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in row]
        for row in matrix.tolist()
    ]


def _finite(value: float) -> float | None:
    """Return a finite number, or None."""
    return value if np.isfinite(value) else None
