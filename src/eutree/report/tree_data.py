"""The data for the scripts of a page: the tree, the facts about its leaves, episodes to play."""

import base64
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats, plain
from eutree.data import Demonstrations, Episode
from eutree.display import decimals_of, told_apart, usual_width
from eutree.errors import InvalidArgumentError
from eutree.export.drawing import fills
from eutree.features import formulas_of, parts_of
from eutree.policies import TreePolicy
from eutree.report.html import LeafChange, as_json, base_style
from eutree.report.watching import WatchedEpisode
from eutree.schema import Feature, Schema, combined_actions
from eutree.trees.text import Digits

SIZE_LIMIT = 5_000_000

EXACT, SHORT = 17, 6  # significant digits: all that a double has; enough to read
MOST_EXACT = 60_000  # numbers of observations, about a megabyte


def tree_data(
    policy: TreePolicy,
    episodes: Sequence[WatchedEpisode],
    demonstrations: Demonstrations | None = None,
    changes: Mapping[int, LeafChange] | None = None,
) -> dict[str, Any]:
    """Return the data for a page's scripts, without pictures.

    Which demonstrated steps fell in which leaf is shown; ``changes`` are the leaves to be marked.
    """
    tree, schema = policy.tree, policy.schema
    names = ("feature", "left", "right", "leaf")
    decimals = _decimals(policy, episodes)
    parts = parts_of(tree.feature.tolist(), formulas_of(schema))
    shown = [
        {
            "name": feature.name,
            "unit": feature.unit,
            "low": plain(feature.low),
            "high": plain(feature.high),
            "decimals": decimals[number],
            "isPart": number in parts,
        }
        | _kind(feature)
        for number, feature in enumerate(schema.features)
    ]
    recorded = () if demonstrations is None else demonstrations.episodes
    n_numbers = (policy.history + 1) * sum(one.episode.observations.size for one in episodes)
    digits = EXACT if n_numbers <= MOST_EXACT else SHORT
    is_masked = policy.masked or any(one.episode.allowed is not None for one in episodes)
    statistics = None
    if policy.leaves is not None:
        statistics = {
            "visits": policy.leaves.visits.tolist(),
            "values": _rounded(policy.leaves.values),
            "deviations": _rounded(policy.leaves.deviations),
            "meaning": policy.leaves.meaning,
        }
    document = _document(policy)
    return {
        "tree": {name: getattr(tree, name).tolist() for name in names}
        | {"threshold": plain(tree.threshold)},
        "tests": _tests(policy),
        "features": shown,
        "actions": list(schema.actions),
        "fills": fills(schema),
        "levels": _levels(schema),
        "leafActions": policy.actions.tolist(),
        "orders": policy.orders.tolist() if is_masked else None,
        "leaves": statistics,
        "changes": {str(leaf): change.facts() for leaf, change in (changes or {}).items()},
        "document": document,
        "environment": json.dumps(document and document["environment"]),
        "episodes": [
            _episode(policy, watched.episode, whole=True, digits=digits) | {"by": watched.by}
            for watched in episodes
        ],
        "demonstrations": [_episode(policy, episode, whole=False) for episode in recorded],
    }


def _kind(feature: Feature) -> dict[str, Any]:
    """Return a feature's kind in place of bounds; nothing of a quantity."""
    if not feature.is_integer:
        return {}
    if feature.group:
        return {"whole": True, "group": feature.group, "category": feature.category}
    if feature.is_flag and not feature.categories:
        return {"whole": True, "flag": True}
    return {"whole": True, "categories": list(feature.categories)}


def _levels(schema: Schema) -> dict[str, Any] | None:
    """Return the one quantity that actions set and are named by, and its levels in words."""
    if len(schema.controls) != 1 or schema.actions != combined_actions(schema.controls):
        return None
    (control,) = schema.controls
    texts = told_apart(control.levels, max(control.levels) - min(control.levels))
    return {"label": control.label, "texts": [texts[level] for level in control.levels]}


def _tests(policy: TreePolicy) -> list[list[str] | None]:
    """Return each inner node's test and its opposite, as they are shown; None for a leaf."""
    tree, digits = policy.tree, Digits(policy.schema, policy.tree)
    return [
        None
        if feature == tree.NO_FEATURE
        else [
            digits.at_most(feature, threshold).replace("<=", "≤"),
            digits.above(feature, threshold).replace(">=", "≥"),
        ]
        for feature, threshold in zip(tree.feature.tolist(), tree.threshold.tolist(), strict=True)
    ]


def _decimals(policy: TreePolicy, episodes: Sequence[WatchedEpisode]) -> list[int]:
    """Return how many digits after the point matter in each feature's values."""
    tree, seen = policy.tree, [policy_features(policy, w.episode) for w in episodes]
    found = []
    for number, feature in enumerate(policy.schema.features):
        values = tree.threshold[tree.feature == number].tolist()
        for rows in seen:
            column = rows[np.isfinite(rows[:, number]), number]
            values += [float(column.min()), float(column.max())] if len(column) else []
        found.append(decimals_of(usual_width(feature.low, feature.high, values)))
    return found


def add_pictures(
    data: dict[str, Any], episodes: Sequence[WatchedEpisode], text: str, limit: int = SIZE_LIMIT
) -> None:
    """Add the pictures of as many episodes, from the first on, as have room on a page.

    Its ``text`` is all but the data and the style of every page; it has so many bytes at most.
    """
    room = limit - len(as_json(data)) - len((text + base_style()).encode()) - 4096
    for entry, watched in zip(data["episodes"], episodes, strict=True):
        frames = [
            f"data:image/webp;base64,{base64.b64encode(frame).decode('ascii')}"
            for frame in watched.frames
        ]
        room -= sum(map(len, frames)) + 3 * len(frames)
        if room < 0:
            break
        entry["frames"] = frames or None


def _document(policy: TreePolicy) -> Any:
    """Return the content of the policy's file, or None if no file can hold it."""
    try:
        return json.loads(policy.to_bytes())
    except InvalidArgumentError:
        return None


def _episode(
    policy: TreePolicy, episode: Episode, *, whole: bool, digits: int = SHORT
) -> dict[str, Any]:
    """Return an episode: always the leaf of each step; the values sensed, if ``whole``."""
    features = policy_features(policy, episode)
    leaves = policy.tree.leaf_index(features)
    entry = {
        "actions": episode.actions.tolist(),
        "rewards": [float(f"{r:.6g}") for r in episode.rewards.tolist() * episode.has_rewards],
        "leaves": leaves.tolist() if whole else leaves[:-1].tolist(),
    }
    if whole:
        decided = policy.decide(features[:-1], episode.allowed)
        entry |= {
            "observations": _on_their_side(policy, features, digits),
            "ending": episode.ending,
            "success": episode.is_success,
            "own": bool(np.array_equal(decided, episode.actions)),
            "allowed": None if episode.allowed is None else _masks(episode.allowed),
            "frames": None,
        }
    return entry


def _masks(allowed: Booleans) -> list[str]:
    """Return a text of 0 and 1 for the mask of each step, [T, A]."""
    return ["".join(map(str, row)) for row in allowed.astype(int).tolist()]


def _on_their_side(policy: TreePolicy, features: Floats, digits: int) -> list[list[Any]]:
    """Return numbers with some digits, or with all where a test would go the other way.

    NaN is None, and an infinite one a word: JSON has neither.
    """
    shown, tree = _rounded(features, digits), policy.tree
    values = np.array(shown, dtype=np.float64).reshape(features.shape)  # NaN for None
    for node in np.flatnonzero(tree.feature != tree.NO_FEATURE).tolist():
        column, threshold = int(tree.feature[node]), tree.threshold[node]
        exact = features[:, column]
        went = np.isfinite(exact) & ((exact <= threshold) != (values[:, column] <= threshold))
        for row in np.flatnonzero(went).tolist():
            shown[row][column] = float(exact[row])
    for row, column in np.argwhere(np.isinf(features)).tolist():
        shown[row][column] = "Infinity" if features[row, column] > 0 else "-Infinity"
    return shown


def policy_features(policy: TreePolicy, episode: Episode) -> Floats:
    """Return the policy's input at each observation of an episode, the past included."""
    observations = episode.observations
    if observations.shape[1] != policy.observation_size:
        raise InvalidArgumentError(
            f"episodes must have observations of {policy.observation_size} features, "
            f"got {observations.shape[1]}"
        )
    return policy.features.of_episode(observations, episode.actions)


def _rounded(matrix: Floats, digits: int = SHORT) -> list[list[Any]]:
    """Return numbers with some significant digits; NaN becomes None."""
    return [
        [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in row]
        for row in matrix.tolist()
    ]
