"""Quantities that actions set, such as the opening of a valve, and the names of their levels."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from eutree.display import told_apart
from eutree.errors import InvalidArgumentError

_LABEL = re.compile(r"(?P<name>.*?)(?: \[(?P<unit>[^\]]*)\])?", re.DOTALL)


def name_and_unit(label: str) -> tuple[str, str]:
    """Return the parts of a name with its unit in brackets: ``"position [m]"``."""
    match = _LABEL.fullmatch(label)
    return (match["name"], match["unit"] or "") if match else (label, "")


@dataclass(frozen=True)
class Control:
    """One quantity that the actions set, such as the opening of a valve.

    Attributes:
        name: Its name, for example ``"valve"``.
        unit: Its unit, for example ``"%"``; empty for a pure number.
        levels: The distinct numbers that it can be set to.
    """

    name: str
    unit: str
    levels: tuple[float, ...]

    @classmethod
    def from_label(cls, label: str, levels: tuple[float, ...]) -> "Control":
        """Return a quantity from its name with its unit in brackets: ``"valve [%]"``."""
        return cls(*name_and_unit(label), levels)

    def __post_init__(self) -> None:
        if not self.name:
            raise InvalidArgumentError("a control must have a name, got an empty one")
        distinct = len(set(self.levels)) == len(self.levels) > 0
        object.__setattr__(self, "levels", tuple(map(float, self.levels)))
        if not (distinct and all(map(math.isfinite, self.levels))):
            raise InvalidArgumentError(
                f"control {self.name!r} must have at least one level, all distinct and finite, "
                f"got {list(self.levels)}"
            )

    @property
    def label(self) -> str:
        """Its name with its unit in brackets."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def names(self) -> tuple[str, ...]:
        """Return each level in words, in the digits that tell it from the others: "valve 25 %"."""
        width = max(self.levels) - min(self.levels) or max(abs(self.levels[0]), 1.0)
        texts = told_apart(self.levels, width)
        if len(set(texts.values())) < len(texts):  # some are one, but for a millionth
            texts = {level: repr(level) for level in self.levels}
        return tuple(f"{self.name} {texts[level]} {self.unit}".rstrip() for level in self.levels)


def n_combinations(controls: Iterable[Control]) -> int:
    """Return the number of combinations of levels."""
    return math.prod(len(control.levels) for control in controls)
