"""What a learner's stored state must be: the arrays of ``UTree.state``, checked before their use.

A checkpoint may come from a damaged disk or from a stranger. Compiled loops trust their indices, so
all that they index with is compared here with the size of what is indexed.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.errors import EutreeError, FormatError
from eutree.imagination import ActionTree
from eutree.imagination.action_trees import to_decision_tree
from eutree.learners.forgetting import WHOLE
from eutree.learners.settings import Settings
from eutree.trees import DecisionTree

State = Mapping[str, NDArray[Any]]

# name: kind of elements, shape (a letter stands for one size wherever it occurs)
_LEARNER: dict[str, tuple[str, str]] = {
    "feature": ("i", "M"),
    "threshold": ("f", "M"),
    "left": ("i", "M"),
    "right": ("i", "M"),
    "leaf": ("i", "M"),
    "history_observations": ("f", "Nd"),
    "history_next_observations": ("f", "Nd"),
    "history_actions": ("i", "N"),
    "history_rewards": ("f", "N"),
    "history_episodes": ("i", "N"),
    "history_continues": ("b", "N"),
    "history_terminal": ("b", "N"),
    "history_n_episodes": ("i", "1"),
    "history_n_seen": ("i", "1"),
    "mdp_values": ("f", "L"),
    "mdp_action_values": ("f", "LA"),
    "mdp_reward_sums": ("f", "LA"),
    "mdp_priority": ("f", "L"),
    "mdp_queue": ("i", "Q"),
    "tested_at": ("i", "L"),
    "inherited": ("i", "L"),
}
_WHERE_IT_IS_SO = {
    "locked": ("i", "K"),
    "history_demonstrated": ("b", "N"),
    "lessons": ("f", "Sd"),
}
_BOUNDED = {"history_lots": ("u", "N"), "history_bounds": ("u", "LA")}
_BOUNDED_EPISODES = {"history_lots": ("u", "N"), "history_bounds": ("u", "1")}
_PLAN = {
    "plan_proved": ("i", "P"),
    "plan_tried": ("i", "R"),
    "plan_planned_at": ("i", "1"),
    "plan_demonstrations": ("i", "1"),
    "plan_outdated": ("i", "1"),
    "plan_informed": ("b", "1"),
}
_PLANNED_TREES = ("policy", "candidate", "explorer", "taught")
_FINITE = ("history_observations", "history_next_observations", "history_rewards",
           "mdp_values", "mdp_reward_sums")  # fmt: skip


class _RefusedError(Exception):
    """An array is not what it must be: its name, and why."""


def check_state(path: str | Path, state: State, n_actions: int, settings: Settings) -> None:
    """Raise FormatError unless a learner of these settings can go on from the state in a file."""
    try:
        _check(state, n_actions, settings)
    except _RefusedError as refused:
        raise FormatError(path, *refused.args) from None


def _check(state: State, n_actions: int, settings: Settings) -> None:
    sizes = _check_shapes(state, _expected(state, settings), n_actions)
    if n_actions < 1 or sizes["d"] < 1:
        raise _RefusedError("history_observations", "there must be a feature and an action")
    for name in (*_FINITE, "lessons"):
        if name in state and not np.isfinite(state[name]).all():
            raise _RefusedError(name, "must be finite")
    if np.isinf(state["mdp_action_values"]).any():
        raise _RefusedError("mdp_action_values", "must not be infinite")
    if np.isnan(state["mdp_priority"]).any():
        raise _RefusedError("mdp_priority", "must be a number")
    tree = {name: state[name] for name in ("feature", "threshold", "left", "right", "leaf")}
    try:
        n_leaves = DecisionTree(sizes["d"], **tree).n_leaves
    except EutreeError as error:
        raise _RefusedError("feature", f"not a tree: {error}") from None
    if sizes["L"] != n_leaves:
        raise _RefusedError("mdp_values", f"must have {n_leaves} entries, the tree's leaves")
    _check_numbers(state, n_leaves, n_actions)
    for name in _PLANNED_TREES:
        if f"plan_{name}_feature" in state:
            _check_planned_tree(state, name, sizes["d"], n_actions)


def _expected(state: State, settings: Settings) -> dict[str, tuple[str, str]]:
    """Return the arrays that there must be, with what they must be."""
    expected = dict(_LEARNER)
    expected |= {name: what for name, what in _WHERE_IT_IS_SO.items() if name in state}
    plans = settings.imagination is not None
    if settings.solve_growth > 1.0 and not plans:
        expected["solved_at"] = ("i", "1")
    if settings.max_transitions is not None:
        expected |= _BOUNDED_EPISODES if plans else _BOUNDED
    if plans:
        expected |= _PLAN
        if "plan_helped" in state:
            expected["plan_helped"] = ("i", "H")
        for name, size in zip(_PLANNED_TREES, "TUVW", strict=True):
            if name == "policy" or f"plan_{name}_feature" in state:
                expected |= {
                    f"plan_{name}_{field}": ("f" if field == "threshold" else "i", size)
                    for field in ActionTree._fields
                }
    return expected


def _check_shapes(
    state: State, expected: Mapping[str, tuple[str, str]], n_actions: int
) -> dict[str, int]:
    """Return the size that each letter stands for."""
    for name in sorted(state.keys() ^ expected.keys()):
        raise _RefusedError(name, "missing" if name in expected else "unexpected array")
    sizes = {"A": n_actions, "1": 1}
    for name, (kind, letters) in expected.items():
        array = state[name]
        fits = array.dtype.kind == kind and array.ndim == len(letters)
        if not fits or any(
            sizes.setdefault(letter, size) != size
            for letter, size in zip(letters, array.shape, strict=True)
        ):
            raise _RefusedError(name, f"shape {array.shape} of {array.dtype} does not fit")
    return sizes


def _check_numbers(state: State, n_leaves: int, n_actions: int) -> None:
    """Compare whole numbers with what they count or index."""
    n_episodes, n_rows = int(state["history_n_episodes"][0]), len(state["history_rewards"])
    most = 2**62
    ranges = {
        "history_actions": (0, n_actions - 1),
        "inherited": (0, n_actions - 1),
        "history_n_episodes": (0, 2**31 - 1),
        "history_episodes": (0, n_episodes - 1),
        "history_n_seen": (n_rows, most),
        "history_bounds": (1, WHOLE),
        "mdp_queue": (0, n_leaves - 1),
        "tested_at": (0, most),
        "solved_at": (0, int(state["history_n_seen"][0])),
        "locked": (0, n_leaves - 1),
        "plan_proved": (0, n_episodes - 1),
        "plan_tried": (0, n_episodes - 1),
        "plan_helped": (0, n_episodes - 1),
        "plan_planned_at": (0, most),
        "plan_demonstrations": (0, n_episodes),
        "plan_outdated": (0, n_episodes),
    }
    for name, (low, high) in ranges.items():
        if name in state and state[name].size:
            least, greatest = int(state[name].min()), int(state[name].max())
            if not low <= least <= greatest <= high:
                raise _RefusedError(name, f"must be in {low}..{high}, got {least}..{greatest}")
    if (np.diff(state["history_episodes"]) < 0).any():
        raise _RefusedError("history_episodes", "must ascend")
    if np.unique(state["mdp_queue"]).size != state["mdp_queue"].size:
        raise _RefusedError("mdp_queue", "a state stands in it twice")


def _check_planned_tree(state: State, name: str, n_features: int, n_actions: int) -> None:
    first = f"plan_{name}_feature"
    for field in ("feature", "left", "right"):
        if (state[f"plan_{name}_{field}"].astype(np.int32) != state[f"plan_{name}_{field}"]).any():
            raise _RefusedError(f"plan_{name}_{field}", "not a tree: a number is out of range")
    tree = ActionTree(*(state[f"plan_{name}_{field}"] for field in ActionTree._fields))
    try:
        _, actions = to_decision_tree(tree, n_features)
    except EutreeError as error:
        raise _RefusedError(first, f"not a tree: {error}") from None
    if not ((actions >= 0) & (actions < n_actions)).all():
        raise _RefusedError(f"plan_{name}_action", f"must be in 0..{n_actions - 1}")
