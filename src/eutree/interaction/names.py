"""Names for an environment that has none: the meaning of its numbers, in a file of a person.

    {"features": ["room [°C]", "outside [°C]", "hour [h]"], "actions": ["off", "on"],
     "derived": ["difference = room - outside"]}

A unit stands in brackets. Records, trees and exports then say ``room <= 20.5 °C``; the
names travel with demonstrations and policies and need not be given again, except to an environment
that has names of its own. Of derived features
(:mod:`eutree.formulas`) the unit follows. ``"kinds"`` says which features are no quantities, see
``Schema.with_kinds``:

    {"kinds": {"tariff": "integer", "open": "flag", "mode": ["off", "on", "auto"],
               "green": ["green north", "green south"]}}
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import msgspec

from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import read_bytes, read_document
from eutree.interaction.deriving import DerivedObservation
from eutree.interaction.spaces import describe, namer_of
from eutree.schema import Feature, Schema

MAX_FILE = 2**20


def kinds_of(schema: Schema) -> dict[str, str | tuple[str, ...]]:
    """Return the kinds of the features that are no quantities, as ``with_kinds`` takes them."""
    kinds: dict[str, str | tuple[str, ...]] = {
        feature.name: feature.categories or ("flag" if feature.is_flag else "integer")
        for feature in schema.features
        if feature.is_integer and not feature.group
    }
    return kinds | {
        group: tuple(schema.features[member].category for member in members)
        for group, members in schema.groups.items()
    }


class Names(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Names of the features, with units in brackets, and of the actions; empty: as they are.

    ``kinds`` are those of features by their names. Derived features are declared under the names of
    the others.
    """

    features: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()
    kinds: dict[str, str | tuple[str, ...]] = {}
    derived: tuple[str, ...] = ()

    @classmethod
    def load(cls, path: str | Path) -> "Names":
        """Read a file of names.

        Raises:
            FormatError: It is no JSON object with lists of names.
            FileError: It is missing or cannot be read.
        """
        return read_document(path, cls, limit=MAX_FILE)

    def besides(self, other: "Names | None") -> "Names":
        """Return these names, and those of others that are not among these."""
        if other is None:
            return self
        return Names(
            features=self.features or other.features,
            actions=self.actions or other.actions,
            kinds={**other.kinds, **self.kinds},
            derived=(*other.derived, *self.derived),
        )

    def give(self, env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
        """Name the features and actions of ``env``, replacing any names; return it derived.

        Raises:
            InvalidArgumentError: There are not as many names as features or actions, or they are
                those of the environment itself in another order.
        """
        own = describe(env)
        schema = self.of(own, whose="the environment's own")
        inner: Any = namer_of(env)  # where describe looks for names
        if self.features:
            inner.feature_names = schema.feature_names
            inner.feature_units = tuple(feature.unit for feature in schema.features)
        inner.feature_kinds = kinds_of(schema)
        if self.actions:
            env.unwrapped.action_names = self.actions  # type: ignore[attr-defined]  # where it looks
        return DerivedObservation(env, self.derived) if self.derived else env

    def of(self, schema: Schema, whose: str = "those there") -> Schema:
        """Return a schema with these names, units and kinds in place of its own.

        Derived features that it has keep their names; ``whose`` the others are, a message says.

        Raises:
            InvalidArgumentError: There are not as many names as features or actions, or they are
                its own in another order, or a kind is none, or not that of the feature.
            UnknownNameError: A kind is that of no feature.
        """
        features = tuple(map(Feature.from_label, self.features)) or schema.measured.features
        actions = self.actions or schema.actions
        for kind, mine, theirs in (
            ("features", tuple(one.name for one in features), schema.measured.feature_names),
            ("actions", actions, schema.actions),
        ):
            if len(mine) != len(theirs):
                raise InvalidArgumentError(
                    f"names must have one for each of the {len(theirs)} {kind}, "
                    f"{', '.join(theirs)}, got {len(mine)}"
                )
            if mine != theirs and sorted(mine) == sorted(theirs):
                raise InvalidArgumentError(
                    f"names must be in the order of {whose}, {', '.join(theirs)}, "
                    f"got {', '.join(mine)}"
                )
        return schema.renamed(features, actions).with_kinds(self.kinds)


def declarations(path: str | Path) -> list[str]:
    """Return the derived features that a text file declares: one a line; one of ``#`` is a remark.

    Raises:
        FormatError: It is no text.
        FileError: It is missing or cannot be read.
    """
    try:
        lines = read_bytes(path, limit=MAX_FILE).decode().splitlines()
    except UnicodeDecodeError:
        raise FormatError(path, "", "must be text in UTF-8") from None
    return [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]


_given: ContextVar[Names | None] = ContextVar("names", default=None)


@contextmanager
def named(names: Names) -> Iterator[None]:
    """Give these names to every environment that is made while the context lasts."""
    before = _given.set(names)
    try:
        yield
    finally:
        _given.reset(before)


def given_names() -> Names | None:
    """Return the names that environments get now."""
    return _given.get()


def as_named(schema: Schema, names: Names | None) -> Schema:
    """Return a schema with features and actions in the order of names, where these are its own.

    Raises:
        InvalidArgumentError: Some of them are, and at other places.
    """
    from eutree.data.log_format import order_of

    if names is None or len(names.features) not in (0, len(schema.measured.features)):
        return schema  # which the number of names does not fit
    features, actions = schema.measured.features, schema.actions
    if names.features:
        named = Schema(tuple(map(Feature.from_label, names.features)), actions)
        features = tuple(features[k] for k in order_of(features, named, renames=True))
    labels = names.features or [feature.name for feature in features]
    features = tuple(map(partial(_coded, names.kinds), labels, features))
    if sorted(names.actions) == sorted(actions) and not schema.controls:
        actions = names.actions
    return replace(schema, features=(*features, *schema.derived), actions=actions)


def _coded(kinds: Mapping[str, Any], label: str, feature: Feature) -> Feature:
    """Return a feature with its categories in the order of those declared, if it has no others."""
    declared, known = kinds.get(Feature.from_label(label).name), feature.categories
    if not known or not isinstance(declared, tuple) or not set(known) <= set(declared):
        return feature
    return replace(feature, high=feature.low + len(declared) - 1, categories=declared)
