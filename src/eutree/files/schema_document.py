"""Schema and environment as parts of documents; a bound of null means unbounded."""

import itertools
import math
from dataclasses import astuple
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from eutree.controls import Control
from eutree.errors import FormatError, InvalidArgumentError, blamed, shown
from eutree.schema import EnvironmentSpec, Feature, Schema, combined_actions

_MAX_NESTING = 40  # of arguments of others; leaves room for the document around it

Index = Annotated[int, msgspec.Meta(ge=0, lt=2**31)]


class FeatureDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A feature; ``low`` and ``high`` are null where unbounded, ``integer`` where it is whole.

    ``categories`` name its values from ``low`` on; ``group`` is the choice of which it is one
    category, 1 in exactly one of the features of that group.
    A derived feature has a ``formula``.
    """

    name: str
    unit: str
    low: float | None
    high: float | None
    integer: bool = False
    categories: list[str] | None = None
    group: str = ""
    formula: str = ""


class ControlDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A quantity that the actions set, and its levels."""

    name: str
    unit: str
    levels: list[float]


class SchemaDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Features and names of actions, in index order; the controls that actions set, if any."""

    features: list[FeatureDocument]
    actions: list[str]
    controls: list[ControlDocument] | None = None


class EnvironmentDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Id and arguments for ``gymnasium.make``."""

    id: str
    arguments: dict[str, Any]


def schema_to_document(schema: Schema) -> SchemaDocument:
    """Return the schema as part of a document."""
    features = []
    for feature in schema.features:
        name, unit, low, high, is_integer, categories, *more = astuple(feature)
        bounds = (float(bound) if math.isfinite(bound) else None for bound in (low, high))
        parts = (name, unit, *bounds, is_integer, list(categories) or None, *more)
        features.append(FeatureDocument(*parts))
    controls = [
        ControlDocument(control.name, control.unit, list(control.levels))
        for control in schema.controls
    ]
    return SchemaDocument(features, list(schema.actions), controls or None)


def schema_from_document(document: SchemaDocument, path: str | Path) -> Schema:
    """Return the schema; ``path`` is for the messages."""
    with blamed(path, "schema"):
        features = tuple(map(_feature, document.features))
        controls = tuple(
            Control(control.name, control.unit, tuple(control.levels))
            for control in document.controls or ()
        )
        actions = tuple(document.actions)
        if controls and actions == _names_up_to_0_2(controls):
            actions = combined_actions(controls)
        return Schema(features, actions, controls)


def _feature(document: FeatureDocument) -> Feature:
    name, unit, low, high, is_integer, categories, *more = msgspec.structs.astuple(document)
    bounds = -math.inf if low is None else low, math.inf if high is None else high
    return Feature(name, unit, *bounds, is_integer, tuple(categories or ()), *more)


def _names_up_to_0_2(controls: tuple[Control, ...]) -> tuple[str, ...]:
    """Return the names of actions as releases up to 0.2 wrote them: levels with all digits."""

    def text(level: float) -> str:
        return f"{level:g}" if float(f"{level:g}") == level else repr(level)

    words = (
        [f"{control.name} {text(level)} {control.unit}".rstrip() for level in control.levels]
        for control in controls
    )
    return tuple(", ".join(parts) for parts in itertools.product(*words))


def environment_to_document(spec: EnvironmentSpec | None) -> EnvironmentDocument | None:
    """Return the environment as part of a document, its arguments in sorted order."""
    if spec is None:
        return None
    if ":" in spec.id:
        raise InvalidArgumentError(f"an environment's id must name no module, got {spec.id!r}")
    return EnvironmentDocument(spec.id, plain_json(spec.arguments, f"arguments of {spec.id}"))


def environment_from_document(
    document: EnvironmentDocument | None, path: str | Path
) -> EnvironmentSpec | None:
    """Return how to make the environment; ``path`` is for the messages.

    Gymnasium imports the module before the colon in an id. No file may make us import anything,
    so such an id is refused; and none may open a window.
    """
    if document is None:
        return None
    if ":" in document.id:
        raise FormatError(path, "environment.id", f"must name no module, got {document.id!r}")
    if "render_mode" in document.arguments:
        raise FormatError(path, "environment.arguments", "must not choose a render_mode")
    return EnvironmentSpec(document.id, document.arguments, frozenset(document.arguments))


def plain_json(value: Any, name: str, *, depth: int = 0) -> Any:
    """Return ``value`` in JSON's own types, keys sorted; NumPy numbers and arrays become plain.

    Raises:
        InvalidArgumentError: Something in it is none of these types, or not finite, or it is
            nested too deeply to be read again.
    """
    if depth > _MAX_NESTING:
        raise InvalidArgumentError(
            f"{name[:60]}... must be nested at most {_MAX_NESTING} deep to be written"
        )
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float) and math.isfinite(value):
        return value
    if isinstance(value, list | tuple):
        return [plain_json(item, f"{name}[{i}]", depth=depth + 1) for i, item in enumerate(value)]
    if hasattr(value, "items") and all(isinstance(key, str) for key in value):
        return {
            key: plain_json(value[key], f"{name}[{key!r}]", depth=depth + 1)
            for key in sorted(value)
        }
    raise InvalidArgumentError(
        f"{name} must be made of finite numbers, strings, lists and dicts to be written, "
        f"got {shown(value)}"
    )
