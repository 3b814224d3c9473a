"""The methods by name, and how one is written to a file and read back."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, cast

import msgspec

from eutree.errors import InvalidArgumentError
from eutree.learners.adaptive_q import AdaptiveQMethod
from eutree.learners.density_tree import DensityTreeMethod
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.history_u_tree import HistoryUTreeMethod
from eutree.learners.learner import Method
from eutree.learners.model_planning import PlanningMethod
from eutree.learners.parti_game import PartiGameMethod
from eutree.learners.presets import PRESETS
from eutree.learners.u_tree import UTreeMethod
from eutree.learners.variable_resolution import VariableResolutionMethod
from eutree.learners.vector_quantization import VectorQuantizationMethod
from eutree.validation import check_choice

METHODS: dict[str, type[Method]] = {
    kind.name: kind
    for kind in (
        PlanningMethod,
        UTreeMethod,
        VectorQuantizationMethod,
        AdaptiveQMethod,
        DensityTreeMethod,
        DistilledDQN,
        HistoryUTreeMethod,
        VariableResolutionMethod,
        PartiGameMethod,
    )
}


def method(name: str) -> Method:
    """Return a method by its own name or that of a preset.

    Raises:
        UnknownNameError: There is no such method or preset.
    """
    check_choice("method", name, [*METHODS, *PRESETS])
    return PRESETS[name] if name in PRESETS else METHODS[name]()


def preset(name: str) -> Method:
    """Return the method of a preset."""
    return PRESETS[check_choice("preset", name, PRESETS)]


def to_document(chosen: Method) -> dict[str, Any]:
    """Return a method in JSON's types: its name and all its choices."""
    choices: dict[str, Any] = msgspec.to_builtins(chosen)
    return {"name": chosen.name, **choices}


def _filled(chosen: Any) -> Any:
    """Return a method or a part of one with its defaults among its attributes.

    msgspec leaves them to the class, and does not see them there when it writes.
    """
    parts = {field.name: getattr(chosen, field.name) for field in fields(chosen) if field.init}
    return replace(
        chosen, **{name: _filled(part) for name, part in parts.items() if is_dataclass(part)}
    )


def from_document(document: dict[str, Any]) -> Method:
    """Return the method that ``to_document`` wrote; what is missing has its default.

    Raises:
        InvalidArgumentError: The document is of no known method, or a choice is not one of its.
    """
    choices = dict(document)
    kind = METHODS[check_choice("method", choices.pop("name", ""), METHODS)]
    unknown = sorted(choices.keys() - {field.name for field in fields(cast(Any, kind))})
    if unknown:
        raise InvalidArgumentError(f"method {kind.name!r} has no choice {unknown[0]!r}")
    try:
        return cast(Method, _filled(msgspec.convert(choices, kind)))
    except (msgspec.ValidationError, ValueError) as error:
        raise InvalidArgumentError(f"method {kind.name!r}: {error}") from None
