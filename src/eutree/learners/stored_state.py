"""What a learner's stored state must be, checked before its use.

A checkpoint may come from a damaged disk or from a stranger. Compiled loops trust their indices, so
all that they index with is compared here with the size of what is indexed.

What an array must be is a pair: its kind of elements ("i", "u", "f", "b"), and a letter for each
axis, which stands for one size wherever it occurs: "N" transitions, "d" features, "L" leaves, "A"
actions, "M" nodes, "1" one.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.errors import EutreeError, FormatError
from eutree.learners.forgetting import RANKS
from eutree.learners.learner import Problem
from eutree.trees import DecisionTree
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import to_decision_tree

State = Mapping[str, NDArray[Any]]
Expected = dict[str, tuple[str, str]]

MOST = 2**62
TREE = ("feature", "threshold", "left", "right", "leaf")
TREE_ARRAYS: Expected = {name: ("f" if name == "threshold" else "i", "M") for name in TREE}
HISTORY_ARRAYS: Expected = {
    "history_observations": ("f", "Nd"),
    "history_next_observations": ("f", "Nd"),
    "history_actions": ("i", "N"),
    "history_rewards": ("f", "N"),
    "history_episodes": ("i", "N"),
    "history_continues": ("b", "N"),
    "history_terminal": ("b", "N"),
    "history_n_episodes": ("i", "1"),
    "history_n_seen": ("i", "1"),
}
WHERE_IT_IS_SO: Expected = {
    "locked": ("i", "K"),
    "history_demonstrated": ("b", "N"),
    "lessons": ("f", "Sd"),
    "split_at": ("i", "1"),
}
_U_TREE: Expected = {
    "mdp_values": ("f", "L"),
    "mdp_action_values": ("f", "LA"),
    "mdp_reward_sums": ("f", "LA"),
    "mdp_priority": ("f", "L"),
    "mdp_queue": ("i", "Q"),
    "tested_at": ("i", "L"),
    "prior": ("i", "L"),
}
_PLAN: Expected = {
    "actions": ("i", "L"),
    "plan_incumbent_episodes": ("i", "P"),
    "plan_challenger_episodes": ("i", "R"),
    "plan_assisted_episodes": ("i", "H"),
    "plan_planned_at": ("i", "1"),
    "plan_demonstrations": ("i", "1"),
    "plan_valid_from": ("i", "1"),
    "plan_informed": ("b", "1"),
}
_PLANNED_TREES = ("incumbent", "challenger", "explorer", "corrected")


class StateCheck:
    """The checks of one stored state; each raises FormatError, naming the array.

    Args:
        path: The file that it comes from.
        state: Its arrays.
        problem: What is learned: its numbers of features and actions.
        expected: What the arrays must be; there may be no others.
        bounds: Letters of the axes of a bounded history's reservoirs; "" where it is not bounded.
    """

    def __init__(
        self,
        path: str | Path,
        state: State,
        problem: Problem,
        expected: Expected,
        *,
        bounds: str = "",
    ) -> None:
        self._path, self._state, self._problem = path, state, problem
        expected = TREE_ARRAYS | HISTORY_ARRAYS | expected
        expected |= {name: what for name, what in WHERE_IT_IS_SO.items() if name in state}
        if bounds:
            expected |= {"history_ranks": ("u", "N"), "history_bounds": ("u", bounds)}
        self._check_shapes(expected)
        self.n_leaves = self._leaves_of_tree()
        self._check_history()

    def refuse(self, name: str, reason: str) -> FormatError:
        """Return the error for an array."""
        return FormatError(self._path, name, reason)

    def sized(self, name: str, size: int, of: str) -> None:
        """Compare the first axis of an array with what it must be."""
        if len(self._state[name]) != size:
            raise self.refuse(name, f"must have {size} entries, {of}")

    def finite(self, names: Iterable[str]) -> None:
        """Compare numbers with nan and infinity."""
        for name in names:
            if name in self._state and not np.isfinite(self._state[name]).all():
                raise self.refuse(name, "must be finite")

    def within(self, ranges: Mapping[str, tuple[int, int]]) -> None:
        """Compare whole numbers with what they count or index."""
        for name, (low, high) in ranges.items():
            if name in self._state and self._state[name].size:
                least, greatest = int(self._state[name].min()), int(self._state[name].max())
                if not low <= least <= greatest <= high:
                    raise self.refuse(name, f"must be in {low}..{high}, got {least}..{greatest}")

    @property
    def n_episodes(self) -> int:
        """Episodes of the history."""
        return int(self._state["history_n_episodes"][0])

    @property
    def n_seen(self) -> int:
        """Transitions ever seen."""
        return int(self._state["history_n_seen"][0])

    def _check_shapes(self, expected: Expected) -> None:
        state = self._state
        for name in sorted(state.keys() ^ expected.keys()):
            raise self.refuse(name, "missing" if name in expected else "unexpected array")
        n_features = state["history_observations"].shape[-1:]
        if n_features != (self._problem.n_features,):
            raise self.refuse(
                "history_observations",
                f"must have {self._problem.n_features} features, the environment's, "
                f"got {n_features[0] if n_features else 'none'}",
            )
        sizes = {"A": self._problem.n_actions, "d": self._problem.n_features, "1": 1}
        for name, (kind, letters) in expected.items():
            array = state[name]
            fits = array.dtype.kind == kind and array.ndim == len(letters)
            if not fits or any(
                sizes.setdefault(letter, size) != size
                for letter, size in zip(letters, array.shape, strict=True)
            ):
                raise self.refuse(name, f"shape {array.shape} of {array.dtype} does not fit")

    def _leaves_of_tree(self) -> int:
        try:
            tree = {name: self._state[name] for name in TREE}
            return DecisionTree(self._problem.n_features, **tree).n_leaves
        except EutreeError as error:
            raise self.refuse("feature", f"not a tree: {error}") from None

    def _check_history(self) -> None:
        self.finite(("history_observations", "history_next_observations", "history_rewards",
                     "lessons"))  # fmt: skip
        self.within({
            "history_actions": (0, self._problem.n_actions - 1),
            "history_n_episodes": (0, 2**31 - 1),
            "history_episodes": (0, self.n_episodes - 1),
            "history_n_seen": (len(self._state["history_rewards"]), MOST),
            "history_bounds": (1, RANKS),
            "locked": (0, self.n_leaves - 1),
        })  # fmt: skip
        if (np.diff(self._state["history_episodes"]) < 0).any():
            raise self.refuse("history_episodes", "must ascend")


def check_u_tree(
    path: str | Path,
    state: State,
    problem: Problem,
    *,
    bounded: bool,
    solves_at: bool,
    keeps_actions: bool = False,
) -> None:
    """Raise FormatError unless a Continuous U-Tree can go on from the state in a file."""
    expected = _U_TREE | ({"solved_at": ("i", "1")} if solves_at else {})
    if keeps_actions:
        expected["kept_values"] = ("f", "K")
    check = StateCheck(path, state, problem, expected, bounds="LA" if bounded else "")
    check.sized("mdp_values", check.n_leaves, "the tree's leaves")
    if keeps_actions:
        check.sized("kept_values", check.n_leaves, "the tree's leaves")
    check.finite(("mdp_values", "mdp_reward_sums", "kept_values"))
    if np.isinf(state["mdp_action_values"]).any():
        raise check.refuse("mdp_action_values", "must not be infinite")
    if np.isnan(state["mdp_priority"]).any():
        raise check.refuse("mdp_priority", "must be a number")
    check.within({
        "prior": (0, problem.n_actions - 1),
        "mdp_queue": (0, check.n_leaves - 1),
        "tested_at": (0, MOST),
        "solved_at": (0, check.n_seen),
        "split_at": (0, check.n_seen),
    })  # fmt: skip
    if np.unique(state["mdp_queue"]).size != state["mdp_queue"].size:
        raise check.refuse("mdp_queue", "a state stands in it twice")


def check_planning(path: str | Path, state: State, problem: Problem, *, bounded: bool) -> None:
    """Raise FormatError unless model-based planning can go on from the state in a file."""
    expected = dict(_PLAN)
    for name, size in zip(_PLANNED_TREES, "TUVW", strict=True):
        if name == "incumbent" or f"plan_{name}_feature" in state:
            expected |= action_tree_arrays(f"plan_{name}_", size)
    check = StateCheck(path, state, problem, expected, bounds="1" if bounded else "")
    check.sized("actions", check.n_leaves, "the tree's leaves")
    last = check.n_episodes - 1
    check.within({
        "actions": (0, problem.n_actions - 1),
        "plan_incumbent_episodes": (0, last),
        "plan_challenger_episodes": (0, last),
        "plan_assisted_episodes": (0, last),
        "plan_planned_at": (0, MOST),
        "plan_demonstrations": (0, check.n_episodes),
        "plan_valid_from": (0, check.n_episodes),
    })  # fmt: skip
    for name in _PLANNED_TREES:
        if f"plan_{name}_feature" in state:
            check_action_tree(check, state, f"plan_{name}_", problem)


def action_tree_arrays(prefix: str, axis: str) -> Expected:
    """Return what the arrays of a tree of actions must be, under names with a prefix."""
    return {
        f"{prefix}{field}": ("f" if field == "threshold" else "i", axis)
        for field in ActionTree._fields
    }


def check_action_tree(check: StateCheck, state: State, prefix: str, problem: Problem) -> None:
    """Raise FormatError unless arrays under names with a prefix are a tree of actions."""
    first = f"{prefix}feature"
    for field in ("feature", "left", "right"):
        if (state[f"{prefix}{field}"].astype(np.int32) != state[f"{prefix}{field}"]).any():
            raise check.refuse(f"{prefix}{field}", "not a tree: a number is out of range")
    tree = ActionTree(*(state[f"{prefix}{field}"] for field in ActionTree._fields))
    try:
        _, actions = to_decision_tree(tree, problem.n_features)
    except EutreeError as error:
        raise check.refuse(first, f"not a tree: {error}") from None
    if not ((actions >= 0) & (actions < problem.n_actions)).all():
        raise check.refuse(f"{prefix}action", f"must be in 0..{problem.n_actions - 1}")


def prefixed(prefix: str, state: State) -> dict[str, NDArray[Any]]:
    """Return the arrays under names that begin with ``prefix``."""
    return {prefix + name: array for name, array in state.items()}


def part(state: State, prefix: str) -> dict[str, NDArray[Any]]:
    """Return the arrays whose names begin with ``prefix``, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
