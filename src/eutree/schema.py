"""Names, units and bounds of features, names of actions, and the environment they belong to.

A schema travels with demonstrations and policies, so that every text, picture and export can
speak of ``opponent_1 <= 8.25 m`` and ``stop`` instead of ``x[1]`` and ``0``.
"""

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from eutree.controls import Control, n_combinations, name_and_unit
from eutree.display import decimals_of, number, usual_width
from eutree.errors import InvalidArgumentError, UnknownNameError, shown
from eutree.formulas import declared, in_formula, parse, renamed
from eutree.validation import check_integer, check_kind, check_listed

MAX_FEATURES = 10_000  # the past included
MAX_ACTIONS = 1_000  # learners hold tables of leaves x actions, and C4.5 of actions x cuts

# Names that say nothing; up to release 0.1 they had blanks, and tuples had bare numbers.
_NUMBERED = re.compile(r"x?\d+(\.x?\d+)*(, \d+ ago)?|did action[ _]\d+, \d+ ago")
_AGO = re.compile(r", \d+ ago$")
_INTEGER = re.compile(r"-?\d+")
_NUMBERED_ACTION = re.compile(r"(action[ _])?-?\d+|control_\d+ -?\d+(, control_\d+ -?\d+)*")


def combined_actions(controls: Sequence[Control]) -> tuple[str, ...]:
    """Return the names of actions that set some controls: ``"valve 25 %, heater 3 kW"``."""
    words = (control.names() for control in controls)
    return tuple(", ".join(parts) for parts in itertools.product(*words))


def _are_unnamed(features: Sequence[str]) -> bool:
    """Return whether names of features say nothing."""
    return all(map(_NUMBERED.fullmatch, features))


def _are_numbered(actions: Sequence[str]) -> bool:
    """Return whether names of actions say nothing; of bare numbers 0, 50, 100 are quantities."""
    numbers = [int(name) for name in actions if _INTEGER.fullmatch(name)]
    counted = not numbers or numbers == list(range(numbers[0], numbers[0] + len(actions)))
    return counted and all(map(_NUMBERED_ACTION.fullmatch, actions))


def numbered_actions(n_actions: int) -> tuple[str, ...]:
    """Return the names of actions that have none: ``action_0, action_1, ...``."""
    return tuple(f"action_{i}" for i in range(n_actions))


@dataclass(frozen=True)
class Feature:
    """One attribute of an observation.

    Attributes:
        name: Its name, for example ``"opponent_1"``.
        unit: Its unit, for example ``"m"``; empty for a pure number.
        low: Smallest possible value; ``-inf`` where unbounded.
        high: Largest possible value; ``inf`` where unbounded.
        is_integer: Whether it is known to have whole values only.
        categories: Names of its values ``low, low + 1, ..., high``, where these are codes.
        group: Name of the choice of which it is one category: 1 in exactly one of the features of
            that group, 0 in the others.
        formula: How a derived feature is computed of those before it; empty where it is measured.
    """

    name: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    is_integer: bool = False
    categories: tuple[str, ...] = ()
    group: str = ""
    formula: str = ""

    @classmethod
    def from_label(cls, label: str) -> "Feature":
        """Return a feature from its name with its unit in brackets: ``"position [m]"``."""
        return cls(*name_and_unit(label))

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", check_kind("name", self.name, str))
        object.__setattr__(self, "unit", check_kind("unit", self.unit, str))
        if math.isnan(self.low) or math.isnan(self.high) or self.low > self.high:
            raise InvalidArgumentError(
                f"feature {self.name!r} must have low <= high, got {self.low} and {self.high}"
            )
        if self.categories and not (
            self.is_integer and self.high - self.low == len(set(self.categories)) - 1
        ):
            raise InvalidArgumentError(
                f"feature {self.name!r} must have one category, all distinct, for each whole "
                f"number from {self.low:g} to {self.high:g}, got {list(self.categories)}"
            )
        if self.group and not self.is_flag:
            raise InvalidArgumentError(
                f"feature {self.name!r} must be 0 or 1 in a group, got {self.low:g}, {self.high:g}"
            )

    def is_coded_as(self, other: "Feature") -> bool:
        """Return whether no value has a name here and another there."""
        pairs = list(zip(self.categories, other.categories, strict=False))
        return not pairs or (self.low == other.low and all(mine == own for mine, own in pairs))

    @property
    def is_flag(self) -> bool:
        """Whether it is 0 or 1."""
        return self.is_integer and (self.low, self.high) == (0.0, 1.0)

    @property
    def category(self) -> str:
        """The category of its group that it stands for: its name without the group's."""
        group, name = (_AGO.sub("", text) for text in (self.group, self.name))
        for beginning in (f"{group} is ", f"{group} ", f"{group}."):
            if name.startswith(beginning) and name != beginning:
                return name.removeprefix(beginning)
        return name

    def text(self, value: float) -> str:
        """Return a value in the digits that matter."""
        return number(value, decimals_of(usual_width(self.low, self.high, [value])))


def _of_kind(feature: Feature, kind: str | Sequence[str]) -> Feature:
    """Return a feature of a kind: a flag, an integer, or a code whose values have names."""
    if kind == "integer":
        return replace(feature, is_integer=True)
    low, high = 0.0, 1.0
    if not isinstance(kind, str):
        low = feature.low if math.isfinite(feature.low) else 0.0
        high = low + len(kind) - 1
    elif kind != "flag":
        raise InvalidArgumentError(
            f"kind of {feature.name!r} must be flag, integer or the names of its values, "
            f"got {kind!r}"
        )
    for own, bound in ((feature.low, low), (feature.high, high)):
        if math.isfinite(own) and own != bound:
            raise InvalidArgumentError(
                f"kind of {feature.name!r} must have a value for each whole number from "
                f"{feature.low:g} to {feature.high:g}, got {kind!r}"
            )
    categories = () if isinstance(kind, str) else tuple(kind)
    known = feature.categories
    if categories != known and sorted(categories) == sorted(known):  # they name codes recorded
        raise InvalidArgumentError(
            f"kind of {feature.name!r} must have its values in their order, {', '.join(known)}, "
            f"got {', '.join(categories)}"
        )
    return replace(feature, low=low, high=high, is_integer=True, categories=categories)


def _described(features: Sequence[Feature]) -> tuple[str, ...]:
    """Return the names of features: how they are derived, and of codes those of their values."""
    values = (f" ({', '.join(one.categories)})" if one.categories else "" for one in features)
    formulas = (f" = {one.formula}" if one.formula else "" for one in features)
    return tuple(map("".join, zip((one.name for one in features), formulas, values, strict=True)))


@dataclass(frozen=True)
class Schema:
    """Features of the observations and names of the actions, both in index order.

    Attributes:
        features: Name, unit and bounds of each number observed.
        actions: Names of the actions.
        controls: The quantities of which actions set levels; an action is a combination of levels,
            and those of the last quantity change fastest. Empty where an action is a mere choice.
    """

    features: tuple[Feature, ...]
    actions: tuple[str, ...]
    controls: tuple[Control, ...] = ()

    def __post_init__(self) -> None:
        for name, of in (("features", Feature), ("actions", str), ("controls", Control)):
            entries = check_listed(name, getattr(self, name))
            object.__setattr__(self, name, tuple(check_kind(name, one, of) for one in entries))
        controls = [control.name for control in self.controls]
        if len(set(controls)) != len(controls):
            raise InvalidArgumentError(f"schema must have distinct controls, got {controls}")
        if self.controls and n_combinations(self.controls) != len(self.actions):
            raise InvalidArgumentError(
                f"schema must have an action for each of the {n_combinations(self.controls)} "
                f"combinations of its controls, got {len(self.actions)}"
            )
        for kind, names in (("features", self.feature_names), ("actions", self.actions)):
            if not names:
                raise InvalidArgumentError(f"schema must name at least one of {kind}, got none")
            if len(set(names)) != len(names):
                raise InvalidArgumentError(f"schema must have distinct {kind}, got {list(names)}")
        derived = [j for j, feature in enumerate(self.features) if feature.formula]
        if derived and (not derived[0] or derived[-1] - derived[0] + 1 != len(derived)):
            raise InvalidArgumentError(
                "schema must have its derived features together, after those that are measured"
            )
        for j in derived:
            parse(self.features[j].formula, self.feature_names[:j])

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names of the features, in index order."""
        return tuple(feature.name for feature in self.features)

    @property
    def n_features(self) -> int:
        """Number of features."""
        return len(self.features)

    @cached_property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """The features of each one-hot group, by its name."""
        members: dict[str, tuple[int, ...]] = {}
        for place, feature in enumerate(self.features):
            if feature.group:
                members[feature.group] = (*members.get(feature.group, ()), place)
        return members

    @property
    def measured(self) -> "Schema":
        """The schema of the measured features: those before the first derived one."""
        measured = itertools.takewhile(lambda feature: not feature.formula, self.features)
        return replace(self, features=tuple(measured))

    @property
    def derived(self) -> tuple[Feature, ...]:
        """The derived features."""
        return tuple(feature for feature in self.features if feature.formula)

    def derive(self, declarations: "Sequence[str | Feature]") -> "Schema":
        """Return the schema with derived features behind the others.

        Args:
            declarations: ``"NAME = FORMULA"``, a unit behind the name in brackets; where there is
                none, it follows from the formula (see ``eutree.formulas``). Or such features.

        Raises:
            InvalidArgumentError: A declaration is none, or its name is taken.
            UnknownNameError: A formula names no feature before it.
        """
        schema = self
        for feature in check_listed("derived features", declarations):
            if not isinstance(feature, Feature):
                label, text = declared(feature)
                feature = replace(Feature.from_label(label), formula=text)
            if feature.name in schema.feature_names:
                raise InvalidArgumentError(
                    f"a derived feature must have a name of its own, got {shown(feature.name)}"
                )
            formula = parse(feature.formula, schema.feature_names)
            unit = feature.unit or formula.unit([known.unit for known in schema.features])
            schema = replace(schema, features=(*schema.features, replace(feature, unit=unit)))
        return schema

    def renamed(self, features: Sequence[Feature], actions: tuple[str, ...]) -> "Schema":
        """Return the schema with the names and units of others for the measured features.

        Args:
            features: A feature for each that is measured; the units of those derived follow anew.
            actions: Names of the actions.
        """
        measured = tuple(
            replace(was, name=new.name, unit=new.unit)
            for was, new in zip(self.measured.features, features, strict=True)
        )
        words = [in_formula(feature.name) for feature in (*measured, *self.derived)]
        units = [feature.unit for feature in self.features]
        derived = []
        for j, was in enumerate(self.derived, len(measured)):
            names = self.feature_names[:j]
            unit = "" if was.unit == parse(was.formula, names).unit(units) else was.unit
            formula = renamed(was.formula, names, words[:j])
            derived.append(replace(was, unit=unit, formula=formula))
        return Schema(measured, actions, self.controls).derive(derived)

    @property
    def n_actions(self) -> int:
        """Number of actions."""
        return len(self.actions)

    @property
    def action_values(self) -> tuple[tuple[float, ...], ...]:
        """The levels that each action sets: A tuples of K numbers, K = 0 without controls."""
        if not self.controls:
            return ((),) * self.n_actions
        return tuple(itertools.product(*(control.levels for control in self.controls)))

    def check_same(self, other: "Schema", what: str, *, of: str, either: bool = False) -> None:
        """Raise InvalidArgumentError unless ``other`` names the same features and actions.

        The levels of controls must be the same, too, where both have any. Units and bounds may
        differ: a decision does not depend on them. Features, or actions, that have numbers in place
        of names here are compared by their number; bounds of one feature must hold the other's.

        Args:
            other: The schema that was given.
            what: The argument it came with, for the message.
            of: The holder of this schema, for the message: "the environment", "CartPole-v1".
            either: Whether numbers in place of names there are compared so, too.
        """
        if not self._names_fit(other, either=either):
            hint = "; names of a file are given here, too, by --names, or kept by demos rename"
            alike = len(self.features) in (len(other.features), len(other.measured.features))
            hint = hint if self._bounds_fit(other) else "; without names, bounds tell them apart"
            mine, theirs = self.feature_names, other.feature_names
            if mine == theirs:  # what they stand for differs, or the actions do
                mine, theirs = _described(self.features), _described(other.features)
                alike = self.actions != other.actions
            raise InvalidArgumentError(
                f"{what} must have the features and actions of {of}, {list(mine)} and "
                f"{list(self.actions)}, got {list(theirs)} and {list(other.actions)}{hint * alike}"
            )

    def with_names_of(self, other: "Schema") -> "Schema":
        """Return this schema with the names, units and kinds of another, if it has none itself."""
        if not self._names_fit(other):
            return self
        features = tuple(
            replace(
                theirs if theirs.group or theirs.categories else mine,
                name=theirs.name,
                unit=theirs.unit or mine.unit,
                is_integer=mine.is_integer or theirs.is_integer,
                formula=theirs.formula,
            )
            for mine, theirs in zip(self.features, other.features, strict=True)
        )
        return Schema(features, other.actions, other.controls or self.controls)

    def with_kinds(self, kinds: Mapping[str, str | Sequence[str]]) -> "Schema":
        """Return this schema with kinds of features declared.

        Args:
            kinds: Of a feature by its name ``"flag"``, ``"integer"`` or the names of its values
                from its lower bound (else 0) on; of a one-hot group by a name of its own those of
                its features, or the part after "GROUP is" in them; of a known group new categories.

        Raises:
            InvalidArgumentError: A kind is none of these, or contradicts the bounds of a feature.
            UnknownNameError: A group names no feature.
        """
        features = list(self.features)
        numbers = {name: place for place, name in enumerate(self.feature_names)}
        for name, kind in kinds.items():
            if name in numbers:
                features[numbers[name]] = _of_kind(features[numbers[name]], kind)
                continue
            if isinstance(kind, str):
                raise UnknownNameError("feature", name, self.feature_names)
            for place, feature in self._grouped(name, kind):
                features[place] = feature
        return replace(self, features=tuple(features))

    def _grouped(self, group: str, categories: Sequence[str]) -> Iterator[tuple[int, Feature]]:
        """Yield place and form of the features of a group; see ``with_kinds``."""
        known = self.groups.get(group, ())
        is_renamed = {self.features[place].category for place in known} != set(categories)
        is_new = is_renamed and not set(self.feature_names) & set(categories)
        if len(known) == len(categories) and is_new:
            for place, category in zip(known, categories, strict=True):
                yield place, replace(self.features[place], name=f"{group} is {category}")
            return
        for category in categories:
            names = (category, *(f"{group}{mark}{category}" for mark in (" is ", " ", ".")))
            found = [place for place, name in enumerate(self.feature_names) if name in names]
            if not found:
                raise UnknownNameError("feature", category, self.feature_names)
            yield found[0], replace(_of_kind(self.features[found[0]], "flag"), group=group)

    def is_unnamed_form_of(self, named: "Schema") -> bool:
        """Return whether ``named`` differs from this by names, and units, that one has not."""
        alike = all(
            (mine.low, mine.high) == (theirs.low, theirs.high)
            and len({mine.unit, theirs.unit, ""}) < 3
            for mine, theirs in zip(self.features, named.features, strict=False)
        )
        return alike and self._names_fit(named)

    def _names_fit(self, other: "Schema", *, either: bool = False) -> bool:
        """Return whether the names that this schema has, or both have, are those of the other."""
        if self.controls and other.controls and self.action_values != other.action_values:
            return False
        named = self
        if self.groups and self.groups == other.groups:  # of codes that have names there
            features = (
                replace(a, name=b.name) if a.group and a.category.isdecimal() else a
                for a, b in zip(self.features, other.features, strict=False)
            )
            named = replace(self, features=tuple(features))
        return self._meanings_fit(other) and all(
            mine == theirs
            or (
                len(mine) == len(theirs)
                and any(map(say_nothing, (mine, theirs)[: 1 + either]))
                and len(self.derived) == len(other.derived)
                and (say_nothing is _are_numbered or self._bounds_fit(other))
            )
            for mine, theirs, say_nothing in (
                (named.feature_names, other.feature_names, _are_unnamed),
                (self.actions, other.actions, _are_numbered),
            )
        )

    def _meanings_fit(self, other: "Schema") -> bool:
        """Return whether codes have the same names, where both have any, and formulas are alike."""
        pairs = zip(self.features, other.features, strict=False)
        formulas = [
            [parse(f.formula, of.feature_names[:j]) for j, f in enumerate(of.features) if f.formula]
            for of in (self, other)
        ]
        is_alike = not all(formulas) or formulas[0] == formulas[1]
        return is_alike and all(mine.is_coded_as(theirs) for mine, theirs in pairs)

    def _bounds_fit(self, other: "Schema") -> bool:
        """Return whether the bounds of one feature are within the other's, but for rounding."""
        pairs = zip(self.features, other.features, strict=False)
        ends = ([[float(f"{x:.6g}") for x in (f.low, f.high)] for f in pair] for pair in pairs)
        return all([min(a[0], b[0]), max(a[1], b[1])] in (a, b) for a, b in ends)

    @classmethod
    def anonymous(cls, n_features: int, n_actions: int) -> "Schema":
        """Return a schema with features ``x0, x1, ...`` and actions ``action_0, action_1, ...``."""
        features = tuple(Feature(f"x{i}") for i in range(n_features))
        return cls(features, numbered_actions(n_actions))

    def with_history(self, steps: int, actions: int = 0) -> "Schema":
        """Return the schema of the features that a ``FeatureMap`` makes of an observation.

        Args:
            steps: Number of previous observations that follow it.
            actions: Number of previous actions that follow these, a 0 or 1 for each action.

        Raises:
            InvalidArgumentError: That would be more than ``MAX_FEATURES`` features.
        """
        for name, amount, size in (
            ("history", steps, self.n_features),
            ("past_actions", actions, self.n_actions),
        ):
            most = MAX_FEATURES // size - 1
            if not 0 <= check_integer(name, amount) <= most:
                raise InvalidArgumentError(
                    f"{name} must be from 0 to {most}, so that {size} amounts a step make at "
                    f"most {MAX_FEATURES:,}, got {shown(amount)}"
                )
        past = [
            replace(
                feature,
                name=f"{feature.name}, {k} ago",
                group=feature.group and f"{feature.group}, {k} ago",
                formula="",
            )
            for k in range(1, steps + 1)
            for feature in self.features
        ]
        past += [
            Feature(f"did {action}, {k} ago", low=0.0, high=1.0, is_integer=True)
            for k in range(1, actions + 1)
            for action in self.actions
        ]
        return Schema(self.features + tuple(past), self.actions, self.controls)


@dataclass(frozen=True)
class EnvironmentSpec:
    """How to make the environment again: ``gymnasium.make(id, **arguments)``.

    Attributes:
        id: Id in Gymnasium's registry.
        arguments: Keyword arguments of ``gymnasium.make``.
        from_file: Names of the arguments that a file chose and no user: with them an environment
            is made only if they are its own, and name no file or module.
    """

    id: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    from_file: frozenset[str] = field(default=frozenset(), compare=False, repr=False)

    def __post_init__(self) -> None:
        check_kind("id", self.id, str)
        check_kind("arguments", self.arguments, Mapping)  # type: ignore[type-abstract]  # of any kind

    def override(self, arguments: Mapping[str, Any]) -> "EnvironmentSpec":
        """Return the spec with some arguments replaced by a user's."""
        merged = {**self.arguments, **arguments}
        return EnvironmentSpec(self.id, merged, self.from_file - arguments.keys())

    def __str__(self) -> str:
        """Return the id and the arguments that differ from the environment's own defaults."""
        listing = ", ".join(f"{key}={value!r}" for key, value in sorted(self.arguments.items()))
        return f"{self.id}({listing})" if listing else self.id
