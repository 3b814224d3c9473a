"""A frozen tree with one action a leaf: learning produces it and everything else consumes it.

A policy does not know its environment, so the entries of a dict that it observes are found by the
names that ``eutree.interaction.describe`` gives them: ``"speed"``, ``"lidar.x0"``, ``"arm.angle"``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats, Frozen, Integers, freeze, frozen
from eutree.display import Displayed, counted
from eutree.errors import InvalidArgumentError, blamed, shown
from eutree.features import Derivation, FeatureMap
from eutree.files import read_bytes, write_bytes
from eutree.files.documents import MAX_DOCUMENT, decode_document
from eutree.policies.document import PolicyDocument, check_unchanged, policy_parts, policy_to_bytes
from eutree.policies.leaf_statistics import LeafStatistics, check_masks, orders_of
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.text import definitions, printable, rules
from eutree.validation import check_integer, check_kind, check_whole, in_order

_KINDS = {"tree": DecisionTree, "schema": Schema, "environment": EnvironmentSpec, "masked": bool}


def rows_of(observation: Any, features: Sequence[Feature]) -> Floats:
    """Return one observation, of d features, as a vector, or a batch as a matrix.

    It is numbers of shape [d] or [E, d]; where d is 1, one number or those of E > 1 rows, [E]; or
    an observation of a ``Dict`` or ``Tuple`` space, or a batch of it, whose leaves have E rows.

    Raises:
        InvalidArgumentError: It is none of these.
    """
    names, size = [feature.name for feature in features], len(features)
    if not isinstance(observation, np.ndarray):  # which names nothing, and is what mostly comes
        observation = in_order("observation", observation, names)
    if not isinstance(observation, Mapping):
        try:
            array = np.asarray(observation, dtype=np.float64)
        except (TypeError, ValueError) as error:
            if not isinstance(observation, tuple):
                raise InvalidArgumentError(
                    f"observation must have numbers, of shape ({size},) or (E, {size}): {error}"
                ) from None
            array = np.empty((0, 0))  # entries of several sizes
        if size == 1 and array.ndim < 2 and array.size and not isinstance(observation, tuple):
            return array.reshape(1 if array.size == 1 else (-1, 1))
        if array.ndim in (1, 2) and array.shape[-1] == size:
            # Each entry of a Tuple space is a column: a batch of d looks like rows.
            columns = isinstance(observation, tuple) and not isinstance(observation[0], tuple)
            return array.T.copy() if columns and array.shape == (size, size) else array
        if not isinstance(observation, tuple):
            raise InvalidArgumentError(
                f"observation must have shape ({size},) or (E, {size}), got {array.shape}"
            )
    return _joined(observation, features)


def _is_complete(observation: Any, n_measured: int, size: int) -> bool:
    """Return whether an observation, or a batch, has its derived features with it."""
    try:
        shape = np.shape(observation)
    except ValueError:  # entries of several sizes: of a Tuple space, which derives nothing
        return False
    columns = isinstance(observation, tuple) and shape == (n_measured, size)
    return shape[-1:] == (size,) and not columns


def _joined(observation: Any, features: Sequence[Feature]) -> Floats:
    """Return the entries of a dict or a tuple in the order of their names."""
    names = [feature.name for feature in features]
    try:
        columns = _columns(observation, _copies(_leaves(observation), features))
    except (TypeError, ValueError):
        columns = []
    found = [name for name, _ in columns]
    if isinstance(observation, tuple) and len(found) == len(names):
        return np.stack([column for _, column in columns], axis=-1)
    if sorted(found) != sorted(names):
        listing = ", ".join(names)
        raise InvalidArgumentError(
            f"observation must have the entries {shown(listing)}, got "
            f"{shown(', '.join(found)) if found else shown(observation)}; eutree.play, "
            "eutree.evaluate and eutree.interaction.GuardedEnv make them of what an environment "
            "observes"
        )
    by_name = dict(columns)
    return np.stack([by_name[name] for name in names], axis=-1)


def _leaves(value: Any) -> list[NDArray[Any]]:
    """Return the arrays in a nested value."""
    if not isinstance(value, Mapping | tuple):
        return [np.asarray(value)]
    parts = value.values() if isinstance(value, Mapping) else value
    return [leaf for part in parts for leaf in _leaves(part)]


def _copies(leaves: list[NDArray[Any]], features: Sequence[Feature]) -> int | None:
    """Return how many observations leaves are a batch of; None for one alone.

    A batch of one has as many numbers as one alone, but each leaf has an axis more: one is [1, n],
    or all are [1] and can be of ``Discrete`` spaces, as those of a ``Box`` of one number cannot.
    """
    total, size = sum(leaf.size for leaf in leaves), len(features)
    if total != size:
        return None if total % size else total // size
    codes = all(leaf.dtype == np.int64 for leaf in leaves) and all(f.is_integer for f in features)
    deeper = codes or any(leaf.ndim > 1 for leaf in leaves)
    return 1 if deeper and all(leaf.shape[:1] == (1,) for leaf in leaves) else None


def _columns(value: Any, copies: int | None) -> list[tuple[str, Floats]]:
    """Return the numbers in a nested value by name: each alone, or those of a batch, [E]."""
    if isinstance(value, Mapping):
        parts = [(str(key), part) for key, part in value.items()]
    elif isinstance(value, tuple):
        parts = [(f"x{i}", part) for i, part in enumerate(value)]
    else:
        array = np.asarray(value, dtype=np.float64)
        rows = array.reshape(-1) if copies is None else array.reshape(copies, -1).T
        return [(f"x{i}", np.asarray(row)) for i, row in enumerate(rows)]
    named = []
    for key, part in parts:
        columns = _columns(part, copies)
        alone = len(columns) == 1
        named += [(key if alone else f"{key}.{name}", column) for name, column in columns]
    return named


class Policy(Protocol):
    """Anything with SB3's ``predict``; every evaluator and recorder accepts it.

    It is called by keyword, with the environment's own observation. A policy that says
    ``reads_features = True`` gets the vector of the environment's features instead, as trees do:
    the same for a Box, a vector of float64 for Discrete, MultiDiscrete, Dict and Tuple spaces.
    """

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation (or a batch) and the policy's next state."""


@dataclass(frozen=True, eq=False)
class TreePolicy(Displayed, Frozen):
    """A decision tree whose leaves are actions.

    Attributes:
        tree: The tree; its features are those of ``schema``.
        actions: Action of each leaf.
        schema: Names, units and bounds of the tree's features; names of the actions.
        environment: The environment it was made for, if known.
        history: Number of previous observations that follow the present one in the tree's
            features; ``predict`` keeps them in its ``state``.
        past_actions: Number of previous actions that follow these.
        leaves: Visits and values of each leaf, where they are known.
        locked: Leaves that neither learning nor an edit may change, in order.
        masked: Whether some actions are forbidden at times where it acts. Then a leaf decides for
            the first action that is allowed in its order; see ``orders``.
        ranks: Place of each action in the order of its leaf, where an edit keeps what a leaf falls
            back on; all 0 where ``tree`` and ``leaves`` say it.
    """

    reads_features: ClassVar[bool] = True

    tree: DecisionTree
    actions: Integers  # [L]
    schema: Schema
    environment: EnvironmentSpec | None = None
    history: int = 0
    past_actions: int = 0
    leaves: LeafStatistics | None = None
    locked: tuple[int, ...] = ()
    masked: bool = False
    ranks: Integers | None = None  # [L, A]

    def __post_init__(self) -> None:
        for one in fields(self):
            if one.name in _KINDS and getattr(self, one.name) is not one.default:
                check_kind(one.name, getattr(self, one.name), _KINDS[one.name])
        object.__setattr__(self, "locked", tuple(self.locked))
        shapes = {"actions": (self.n_leaves,), "ranks": (self.n_leaves, self.schema.n_actions)}
        for name, shape in shapes.items():
            if name == "ranks" and self.ranks is None:
                continue
            check_whole(name, getattr(self, name))
            freeze(self, name, dtype=np.int64)
            if (given := getattr(self, name).shape) != shape:
                raise InvalidArgumentError(f"{name} must have shape {shape}, got {given}")
        if self.actions.min() < 0 or self.actions.max() >= self.schema.n_actions:
            raise InvalidArgumentError(
                f"actions must be in 0..{self.schema.n_actions - 1}, got {self.actions.tolist()}"
            )
        if self.schema.n_features != self.tree.n_features:
            raise InvalidArgumentError(
                f"schema must name the tree's {self.tree.n_features} features, "
                f"got {self.schema.n_features}"
            )
        n, past = self.tree.n_features, check_integer("past_actions", self.past_actions)
        seen = n - past * self.schema.n_actions
        if seen < 1:
            raise InvalidArgumentError(
                f"past_actions must leave at least one of the tree's {n} features, got {past}"
            )
        if seen % (check_integer("history", self.history) + 1):
            raise InvalidArgumentError(
                f"history + 1 must divide the tree's {seen} features that are not actions, got "
                f"history {self.history}"
            )
        if list(self.locked) != sorted(set(self.locked) & set(range(self.n_leaves))):
            raise InvalidArgumentError(
                f"locked must be leaves from 0 to {self.n_leaves - 1} in order, got {self.locked}"
            )

    @property
    def n_leaves(self) -> int:
        """Number of leaves."""
        return self.tree.n_leaves

    @cached_property
    def orders(self) -> Integers:
        """The order in which each leaf prefers the actions, its own first, shape [L, A]."""
        own = np.eye(self.schema.n_actions, dtype=np.int64)[self.actions]
        return frozen(orders_of(self.tree, own, self.leaves, self.ranks))

    @property
    def observation_size(self) -> int:
        """Number of entries of one observation, without the past."""
        return self.features.n_observed

    @cached_property
    def features(self) -> FeatureMap:
        """How observations and the past become the tree's features."""
        seen = self.tree.n_features - self.past_actions * self.schema.n_actions
        return FeatureMap(
            n_observed=seen // (self.history + 1),
            n_actions=self.schema.n_actions,
            observations=self.history,
            actions=self.past_actions,
        )

    @cached_property
    def _observed(self) -> Schema:
        """The schema of one observation, derived features included."""
        return replace(self.schema, features=self.schema.features[: self.observation_size])

    @cached_property
    def derivation(self) -> Derivation:
        """How the derived features of an observation are computed of those measured."""
        known = Derivation.of(self._observed)
        if known.n_measured + len(known.formulas) == self.observation_size:
            return known
        return Derivation(self.observation_size)  # callers that hand in the past have derived it

    _action_list = cached_property(lambda policy: policy.actions.tolist())  # of plain ints

    def save(self, path: str | Path) -> None:
        """Write the policy to a file that ``load`` reads; see docs/formats.

        Raises:
            InvalidArgumentError: The policy holds an infinite value, which no file may hold.
            FileError: The file cannot be written; the file that was there before is intact.
        """
        write_bytes(path, self.to_bytes())

    @classmethod
    def load(cls, path: str | Path, *, hand_edited: bool = False) -> "TreePolicy":
        """Read a policy from a file, checking everything; no code in it is ever run.

        Args:
            path: The file.
            hand_edited: Take a file that was changed after it was written, which its checksum
                tells. Everything else in it is checked as always.

        Raises:
            FormatError: The file is no policy, was changed by hand, or was made by a newer version.
            FileError: The file is missing or cannot be read.
        """
        return cls.from_bytes(read_bytes(path, limit=MAX_DOCUMENT), path, hand_edited=hand_edited)

    def to_bytes(self) -> bytes:
        """Return the content of the policy's file; the same policy gives the same bytes."""
        return policy_to_bytes({one.name: getattr(self, one.name) for one in fields(self)})

    @classmethod
    def from_bytes(
        cls, data: bytes, path: str | Path = "policy", *, hand_edited: bool = False
    ) -> "TreePolicy":
        """Return the policy that ``to_bytes`` wrote; ``path`` is for the messages."""
        document = decode_document(data, PolicyDocument, path)
        with blamed(path):
            policy = cls(**policy_parts(document, path))
        if not hand_edited:  # last: a message about a fault in a file says more
            check_unchanged(document, path)
        return policy

    @classmethod
    def from_sklearn(cls, classifier: Any, schema: Schema | None = None) -> "TreePolicy":
        """Return the policy that decides like a ``sklearn.tree.DecisionTreeClassifier``.

        The decisions are the same on every finite observation of float64, although scikit-learn
        rounds it to float32 first: each threshold becomes the largest float64 number that is
        rounded to at most the classifier's. A NaN goes to the "no" branch here and where training
        sent most rows there. The other way round there is ``TreePolicyClassifier``.

        Args:
            classifier: Fitted, with one output.
            schema: Names of features and actions; the classes are then numbers of actions or, if
                not all of them are, names. By default the names are the classifier's.
        """
        from eutree.policies.sklearn_tree import parts_of

        return cls(**parts_of(classifier, schema))

    def act(self, features: Sequence[float], allowed: Booleans | None = None) -> int:
        """Return the action for one sequence of the tree's features (history included).

        Args:
            features: Numbers of one step, in the schema's order.
            allowed: Which actions are allowed, shape [A]; None for all.
        """
        actions: list[int] = self._action_list
        leaf = self.tree.leaf_of(features)
        if allowed is None or allowed[actions[leaf]]:
            return actions[leaf]
        order = self.orders[leaf]
        return int(order[allowed[order].argmax()])

    def predict(
        self,
        observation: Any,
        state: Floats | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
        action_masks: ArrayLike | None = None,
    ) -> tuple[Any, Floats | None]:
        """Return the action for one observation or a batch, as in Stable-Baselines3.

        Args:
            observation: One observation, shape [d], or a batch, shape [E, d]; or the environment's
                own, a dict or a tuple, if its entries have the names of the policy's schema. Where
                features are derived, the m that are measured are enough, shape [m] or [E, m]. Of
                single numbers a batch may have shape [E], but shape [1] or [d] is one observation.
            state: State that the last call returned, for a policy that sees the past or derives a
                feature of ``last`` values; None at the start of an episode. Others ignore it.
            episode_start: Whether each observation is the first of its episode, shape [E].
            deterministic: Ignored: a tree always decides the same.
            action_masks: Which actions are allowed, shape [A] or [E, A], as in sb3-contrib; the
                first allowed one in the order of the leaf is chosen.

        Returns:
            An int for one observation, an int64 array of shape [E] for a batch; and the state.
        """
        seen, derivation = self._observed.features, self.derivation
        if not derivation.formulas or _is_complete(observation, derivation.n_measured, len(seen)):
            array = rows_of(observation, seen)
        else:
            measured = rows_of(observation, seen[: derivation.n_measured])
            array = derivation.after(measured, state, episode_start)
            if self.features.is_identity and derivation.remembered:
                state = array
        if self.features.is_identity:
            return self.decide(array, action_masks), state
        state = self.features.after(state, array, episode_start)
        actions = self.decide(state, action_masks)
        if self.past_actions:  # the action chosen on these features follows them
            state = np.concatenate([state, np.asarray(actions, np.float64)[..., None]], axis=-1)
        return actions, state

    def predict_values(
        self,
        observation: Any,
        state: Floats | None = None,
        episode_start: ArrayLike | None = None,
        *,
        action_masks: ArrayLike | None = None,
    ) -> tuple[Floats, Floats | None]:
        """Return the levels to which the actions for observations set the schema's K controls.

        Args:
            observation: As in ``predict``, shape [d] or [E, d].
            state: As in ``predict``.
            episode_start: As in ``predict``.
            action_masks: As in ``predict``.

        Returns:
            Numbers of shape [K] or [E, K], in the units of the controls; and the state.

        Raises:
            InvalidArgumentError: The actions set no quantity; see
                ``eutree.interaction.GriddedAction``.
        """
        if not self.schema.controls:
            raise InvalidArgumentError(
                "predict_values needs actions that set quantities (an action grid), got "
                f"{', '.join(self.schema.actions)}"
            )
        actions, state = self.predict(observation, state, episode_start, action_masks=action_masks)
        values: Floats = np.array(self.schema.action_values)[actions]
        return values, state

    def decide(self, features: Floats, masks: ArrayLike | None = None) -> Any:
        """Return the action for features [d] and a mask [A], or those for [E, d] and [E, A]."""
        n_actions = self.schema.n_actions
        if features.ndim == 1:
            allowed = None if masks is None else check_masks(masks, (n_actions,))
            return self.act(features.tolist(), allowed)
        leaves = self.tree.leaf_index(features)
        if masks is None:
            return self.actions[leaves]
        orders = self.orders[leaves]
        allowed = np.take_along_axis(check_masks(masks, orders.shape), orders, axis=1)
        return orders[np.arange(len(orders)), allowed.argmax(axis=1)]

    def __repr__(self) -> str:
        """Return the policy's size in one line; ``str`` gives its rules."""
        made_for = f", for {self.environment}" if self.environment is not None else ""
        leaves = counted(self.n_leaves, "leaf")
        return f"<TreePolicy: {leaves}, depth {self.tree.depth}{made_for}>"

    def __str__(self) -> str:
        """Return the policy as nested rules, with the names and units of its schema."""
        names = [printable(name) for name in self.schema.actions]
        words = rules(self.tree, self.schema, [names[action] for action in self.actions])
        return "\n".join([words, *definitions(self.tree, self.schema)])

    def __eq__(self, other: object) -> bool:
        """Return whether both decide by the same tree with the same names and statistics."""
        if not isinstance(other, TreePolicy):
            return NotImplemented
        mine, theirs = (
            known and [column.tobytes() for column in vars(known).values()]
            for known in (self.leaves, other.leaves)
        )
        equal, arrays = (
            ("schema", "environment", "features", "locked", "masked"),
            ("actions", "ranks"),
        )
        return (
            self.tree.equals(other.tree)
            and all(getattr(self, one) == getattr(other, one) for one in equal)
            and all(np.array_equal(getattr(self, one), getattr(other, one)) for one in arrays)
            and mine == theirs
        )

    def __hash__(self) -> int:
        """Return the same for equal policies."""
        return hash(self.actions.tobytes())
