"""The state of a learner: each array declared once, with type, axes, range and place.

Saving, restoring and checking follow from the declaration. ``arrays_of`` takes the arrays from a
learner, ``give_back`` gives them to one at its start. A checkpoint may come from a damaged disk or
from a stranger, and compiled loops trust their indices, so before that ``taken`` compares it with
the declaration: names, elements, sizes, ranges, and by rules how arrays must agree.

An axis is a letter (or a word), which stands for one size wherever it occurs, or a number, which
stands for itself. The letters ``d`` and ``A`` are the features and actions of the problem, ``L``
the leaves of the tree, ``N`` the transitions of the history; all others are given beforehand, or
bound where they first occur.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from eutree.errors import EutreeError, FormatError
from eutree.learners.forgetting import RANKS
from eutree.learners.history import History
from eutree.trees import DecisionTree
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import to_decision_tree

Arrays: TypeAlias = dict[str, NDArray[Any]]
State: TypeAlias = Mapping[str, NDArray[Any]]
Size: TypeAlias = str | int
Kept = TypeVar("Kept")

MOST = 2**62  # what is counted stays far from the largest integer


class Stored(NamedTuple):
    """One array: of which kind it is, and where a learner has it.

    Attributes:
        elements: Type of its elements, as NumPy writes it: "i8", "f8", "b1". Narrower ones of the
            same kind are taken and widened.
        axes: Its axes: letters, or words and numbers.
        low: Least element; a number, a size, or the name of an array of one element.
        most: Greatest element, likewise.
        below: A bound that all elements are less than, likewise.
        nan: Whether NaN may be among them.
        inf: Whether infinity may be.
        at: The learner's attribute, with dots for one of an attribute: an array, a number, which is
            stored as an array of one, or numbers in a tuple, a list or a set; several numbers by
            the names of all. "" where it belongs to the object of its part, or the learner has a
            ``state()`` of its own.
    """

    elements: str
    axes: str | tuple[Size, ...]
    low: Size | None = None
    most: Size | None = None
    below: Size | None = None
    nan: bool = False
    inf: bool = False
    at: str = ""


class Part(NamedTuple):
    """Arrays that belong together.

    Attributes:
        arrays: They by name.
        rule: How they must agree; raises FormatError.
        optional: Whether all of them may be missing, as they are where each is empty.
        at: The learner's attribute that they are made of, as in ``Stored``; None has no arrays.
        prefix: Begins the names of its arrays.
        save: Returns the arrays of the object there, without the prefix.
        make: Returns it again, from a learner at its start, to which the parts before were given,
            and all arrays whose names begin with the prefix, without it; None if it was changed
            in place.
    """

    arrays: Mapping[str, Stored]
    rule: "Callable[[Found], None] | None" = None
    optional: bool = False
    at: str = ""
    prefix: str = ""
    save: Callable[[Any], State] | None = None
    make: Callable[[Any, Arrays], Any] | None = None


@dataclass(frozen=True)
class Declared:
    """The state of a learner."""

    n_features: int  # d, of a stored observation
    n_actions: int  # A
    parts: tuple[Part, ...]  # all arrays; a size that several share is bound by the first
    # Other sizes that are known beforehand, by the letters of axes.
    sizes: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Found:
    """A stored state under examination."""

    path: Path  # the file that it comes from
    state: State  # its arrays
    sizes: dict[str, int]  # the sizes that letters of axes stand for, as far as they are known

    def refuse(self, name: str, reason: str) -> FormatError:
        """Return the error for an array."""
        return FormatError(self.path, name, reason)

    def value(self, name: str) -> Any:
        """Return the element of an array of one."""
        return self.state[name].reshape(-1)[0].item()

    def take(self, part: Part) -> Arrays:
        """Return the arrays of a part with the elements that are declared.

        Raises:
            FormatError: An array is not as it is declared.
        """
        for name, stored in part.arrays.items():
            self._check_shape(name, stored)
        for name, stored in part.arrays.items():
            self._check_elements(name, stored)
        if part.rule is not None:
            part.rule(self)
        return {
            name: np.ascontiguousarray(self.state[name], dtype=np.dtype(stored.elements))
            for name, stored in part.arrays.items()
        }

    def _check_shape(self, name: str, stored: Stored) -> None:
        array, wanted = self.state[name], np.dtype(stored.elements)
        fits = (
            array.dtype.kind == wanted.kind
            and np.can_cast(array.dtype, wanted, "safe")
            and array.ndim == len(stored.axes)
            and [*map(self._bound, stored.axes, array.shape)] == [*array.shape]
        )
        if not fits:
            raise self.refuse(
                name,
                f"shape {array.shape} of {array.dtype} does not fit: must be of {wanted} and of "
                f"shape {self._in_words(stored.axes)}",
            )

    def _bound(self, axis: Size, size: int) -> int:
        """Return the size of an axis: the first one that its letter meets, or the digit it is."""
        word = str(axis)
        return int(word) if word.isdecimal() else self.sizes.setdefault(word, size)

    def _in_words(self, axes: Sequence[Size]) -> str:
        known = (f"{axis} = {self.sizes[axis]}" if axis in self.sizes else f"{axis}"
                 for axis in map(str, axes))  # fmt: skip
        return f"[{', '.join(known)}]"

    def _check_elements(self, name: str, stored: Stored) -> None:
        array = self.state[name]
        if array.dtype.kind == "f":
            self._check_numbers(name, stored)
        bounds = stored.low, stored.most, stored.below
        if bounds == (None,) * 3 or not (known := array[array == array]).size:  # all but NaN
            return
        low, most, below = map(self._bound_of, bounds)
        if below is not None:
            most = below - 1
        least, greatest = known.min().item(), known.max().item()
        if (low is not None and least < low) or (most is not None and greatest > most):
            span = f"{'' if low is None else low}..{'' if most is None else most}"
            raise self.refuse(name, f"must be in {span}, got {least}..{greatest}")

    def _check_numbers(self, name: str, stored: Stored) -> None:
        array = self.state[name]
        if not stored.nan and not stored.inf and not np.isfinite(array).all():
            raise self.refuse(name, "must be finite")
        if not stored.nan and np.isnan(array).any():
            raise self.refuse(name, "must be a number")
        if not stored.inf and np.isinf(array).any():
            raise self.refuse(name, "must not be infinite")

    def _bound_of(self, bound: Size | None) -> int | None:
        if bound is None or isinstance(bound, int):
            return bound
        return self.sizes[bound] if bound in self.sizes else int(self.value(bound))


def taken(path: str | Path, state: State, declared: Declared) -> Arrays:
    """Return the arrays of a stored state with the elements that are declared.

    Raises:
        FormatError: They are not.
    """
    sizes = {"d": declared.n_features, "A": declared.n_actions, **declared.sizes}
    found = Found(Path(path), state, sizes)
    here = [one for one in declared.parts if not one.optional or one.arrays.keys() & state.keys()]
    expected = {name for part in here for name in part.arrays}
    for name in sorted(state.keys() ^ expected):
        raise found.refuse(name, "missing" if name in expected else "unexpected array")
    return {name: array for part in here for name, array in found.take(part).items()}


# Saving and restoring. ----------------------------------------------------------------------------


def arrays_of(learner: object, parts: Iterable[Part]) -> Arrays:
    """Return the state of a learner as its parts declare it: its own arrays, not copies."""
    state: Arrays = {}
    for one in parts:
        own = {
            name: _array(attrgetter(*stored.at.split())(learner), stored)
            for name, stored in one.arrays.items()
            if stored.at
        }
        if not one.optional or any(array.size for array in own.values()):
            state |= own
        if one.save is not None and (value := attrgetter(one.at)(learner)) is not None:
            state |= prefixed(one.prefix, one.save(value))
    return state


def give_back(learner: Kept, parts: Iterable[Part], state: State) -> Kept:
    """Return a learner, at its start, after it was given copies of what ``arrays_of`` made.

    Numbers come back in the types that it has at its start.
    """
    for one in parts:
        lacks = one.optional and not one.arrays.keys() & state.keys()
        for name, stored in one.arrays.items():
            places, array = stored.at.split(), _NOTHING if lacks else state[name]
            for at, value in zip(places, [array] if len(places) < 2 else array, strict=False):
                put(learner, at, _value(value, attrgetter(at)(learner)))
        if one.make is not None and not lacks:
            made = one.make(learner, part(state, one.prefix))
            if made is not None:
                put(learner, one.at, made)
    return learner


def put(holder: Any, at: str, value: Any) -> None:
    """Set an attribute, with dots for one of an attribute; a frozen value is replaced."""
    place, _, name = at.rpartition(".")
    owner = attrgetter(place)(holder) if place else holder
    try:
        setattr(owner, name, value)
    except AttributeError:
        replaced = getattr(owner, "_replace", partial(replace, owner))
        put(holder, place, replaced(**{name: value}))


_NOTHING = np.empty(0, dtype=np.int64)


def _array(value: Any, stored: Stored) -> NDArray[Any]:
    if isinstance(value, np.ndarray):
        return value
    numbers = sorted(value) if isinstance(value, frozenset) else value
    return np.atleast_1d(np.array(numbers, dtype=stored.elements))


def _value(array: NDArray[Any], like: Any) -> Any:
    if isinstance(like, np.ndarray):
        return np.array(array)
    several = isinstance(like, frozenset | list | tuple)
    return type(like)(array.tolist() if several else array.item())


# Parts that several methods have. -----------------------------------------------------------------

TREE = ("feature", "threshold", "left", "right", "leaf")


def tree_arrays(tree: DecisionTree) -> Arrays:
    """Return a tree as arrays."""
    return {name: getattr(tree, name) for name in TREE}


def tree_of(state: State, n_features: int) -> DecisionTree:
    """Return the tree that ``tree_arrays`` made arrays of."""
    return DecisionTree(n_features, **{name: state[name] for name in TREE})


def _is_tree(found: Found) -> None:
    try:
        tree = tree_of(found.state, found.sizes["d"])
    except EutreeError as error:
        raise found.refuse("feature", f"not a tree: {error}") from None
    found.sizes["L"] = tree.n_leaves


def tree_part(at: str = "tree") -> Part:
    """Return the arrays of the tree of a learner, which is at an attribute of it."""

    def make(learner: Any, state: Arrays) -> DecisionTree:
        return tree_of(state, attrgetter(at)(learner).n_features)

    arrays = {
        name: Stored("f8", "M", nan=True) if name == "threshold" else Stored("i8", "M")
        for name in TREE
    }
    return Part(arrays, _is_tree, at=at, save=tree_arrays, make=make)


def _is_history(found: Found) -> None:
    if (np.diff(found.state["history_episodes"]) < 0).any():
        raise found.refuse("history_episodes", "must ascend")


def history_parts(at: str = "history", *, tree: str = "") -> tuple[Part, ...]:
    """Return the arrays of the history of a learner, but for those that it forgets by.

    ``tree`` is where it has the tree whose leaves label the transitions; "" for a single leaf.
    """

    def make(learner: Any, state: Arrays) -> History:
        old = attrgetter(at)(learner)
        single = DecisionTree.single_leaf(old.observations.shape[1])
        return History.from_state(
            state, attrgetter(tree)(learner) if tree else single, old.forgetting
        )

    arrays = {
        "history_observations": Stored("f8", "Nd"),
        "history_next_observations": Stored("f8", "Nd"),
        "history_actions": Stored("i4", "N", low=0, below="A"),
        "history_rewards": Stored("f8", "N"),
        "history_n_episodes": Stored("i8", "1", low=0, most=2**31 - 1),
        "history_episodes": Stored("i4", "N", low=0, below="history_n_episodes"),
        "history_continues": Stored("b1", "N"),
        "history_terminal": Stored("b1", "N"),
        "history_n_seen": Stored("i8", "1", low="N", most=MOST),
    }
    return (
        Part(arrays, _is_history, False, at, "history_", History.state, make),
        Part({"history_demonstrated": Stored("b1", "N")}, optional=True),
        Part({"history_allowed": Stored("b1", "NA")}, optional=True),
    )


def bounds_part(axes: str) -> tuple[Part]:
    """Return the arrays that a bounded history forgets by; the axes are those of its reservoirs."""
    ranks, bounds = Stored("u4", "N"), Stored("u8", axes, low=1, most=RANKS)
    return (Part({"history_ranks": ranks, "history_bounds": bounds}),)


TREE_PART = tree_part()
HISTORY_PART, SHOWN_PART, MASKS_PART = history_parts()
LOCKED_PART = Part({"locked": Stored("i8", "K", low=0, below="L", at="_locked")}, optional=True)

TREE_AND_HISTORY = (TREE_PART, HISTORY_PART, SHOWN_PART, MASKS_PART, LOCKED_PART)


def action_tree_part(prefix: str, at: str = "", *, optional: bool = False) -> Part:
    """Return the arrays of one tree of actions, under names with a prefix; None has none."""

    def is_tree(found: Found) -> None:
        check_action_trees(found, prefix, [len(found.state[f"{prefix}feature"])])

    def make(_: Any, state: Arrays) -> ActionTree:
        return ActionTree(*(np.array(state[name]) for name in ActionTree._fields))

    ways = (ActionTree._asdict, make) if at else (None, None)
    return Part(_action_tree_arrays(prefix), is_tree, optional, at, prefix, *ways)


def packed_trees_part(prefix: str, n_trees: Size) -> Part:
    """Return the arrays of trees over features ``f``, one after the other, after a prefix."""

    def are_trees(found: Found) -> None:
        sizes = found.state[f"{prefix}n_nodes"].tolist()
        if not sizes or sum(sizes) != found.sizes[f"{prefix}nodes"]:
            raise found.refuse(f"{prefix}n_nodes", "must be the nodes of at least one tree")
        check_action_trees(found, prefix, sizes, "f")

    n_nodes = Stored("i8", (n_trees,), low=1, most=f"{prefix}nodes")
    return Part(_action_tree_arrays(prefix) | {f"{prefix}n_nodes": n_nodes}, are_trees)


def check_action_trees(
    found: Found, prefix: str, sizes: Sequence[int], features: str = "d"
) -> None:
    """Raise FormatError unless arrays under names with a prefix are trees of so many nodes."""
    for end, size in zip(np.cumsum(sizes).tolist(), sizes, strict=True):
        rows = slice(end - size, end)
        tree = ActionTree(*(found.state[f"{prefix}{name}"][rows] for name in ActionTree._fields))
        try:
            _, actions = to_decision_tree(tree, found.sizes[features])
        except EutreeError as error:
            raise found.refuse(f"{prefix}feature", f"not a tree: {error}") from None
        if not ((actions >= 0) & (actions < found.sizes["A"])).all():
            most = found.sizes["A"] - 1
            raise found.refuse(f"{prefix}action", f"must be in 0..{most}")


def _action_tree_arrays(prefix: str) -> dict[str, Stored]:
    nodes = (f"{prefix}nodes",)
    whole = Stored("i8", nodes, low=-(2**31), below=2**31)
    return {
        f"{prefix}{name}": Stored("f8", nodes, nan=True) if name == "threshold" else whole
        for name in ActionTree._fields
    }


def prefixed(prefix: str, state: State) -> Arrays:
    """Return the arrays under names that begin with ``prefix``."""
    return {prefix + name: array for name, array in state.items()}


def part(state: State, prefix: str) -> Arrays:
    """Return the arrays whose names begin with ``prefix``, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
