"""What actions set, for exports that return quantities: names, and a constant for each level."""

import re

from eutree.export._identifiers import identifiers
from eutree.schema import Schema


def action_identifiers(schema: Schema, *, reserved: tuple[str, ...] = ()) -> list[str]:
    """Return an identifier for each action; signs and points of levels are spelled."""
    names = list(schema.actions)
    if schema.controls:
        names = [_spelled(name) for name in names]
    return identifiers(names, reserved=reserved, prefix="action")


def control_identifiers(schema: Schema, *, reserved: frozenset[str]) -> list[str]:
    """Return an identifier for each control."""
    names = [control.name for control in schema.controls]
    return identifiers(names, reserved=reserved, prefix="control")


def _spelled(name: str) -> str:
    """Return a name with "minus" for the sign of a number and "p" for its point."""
    name = re.sub(r"(?<![\w.])-(?=\d)", "minus ", name)
    return re.sub(r"(?<=\d)\.(?=\d)", "p", name)
