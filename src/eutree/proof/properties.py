"""The language of properties that ``prove`` answers.

Its grammar::

    property = "arrives" ["within" N "steps"]
             | "stays in" CONDITIONS [HORIZON] | "avoids" CONDITIONS [HORIZON]
             | "succeeds" [CHANCE]
             | "returns at least" R [CHANCE]
    HORIZON  = "for" N "steps" | "for ever"
    CHANCE   = "with probability at least" P

Conditions are those of ``eutree verify``, on the numbers of the plant's state. Without a horizon a
property is about an episode: up to its time limit, for ever where there is none.
"""

import re
from dataclasses import dataclass

from eutree.errors import InvalidArgumentError
from eutree.inspection import Region
from eutree.inspection.properties import conditions, finite
from eutree.schema import Schema

KINDS = ("arrives", "stays", "avoids", "succeeds", "returns")
EVER = -1  # a horizon without an end
_MOST_STEPS = 1_000_000

_HORIZON = r"(?:\s+for\s+(?:(?P<steps>\d+)\s+steps?|(?P<ever>ever)))?"
_CHANCE = r"(?:\s+with\s+probability\s+at\s+least\s+(?P<chance>\S+))"
_FORMS = {
    "arrives": re.compile(r"arrives(?:\s+within\s+(?P<steps>\d+)\s+steps?)?"),
    "stays": re.compile(rf"stays\s+in\s+(?P<conditions>.+?){_HORIZON}"),
    "avoids": re.compile(rf"avoids\s+(?P<conditions>.+?){_HORIZON}"),
    "succeeds": re.compile(rf"succeeds{_CHANCE}?"),
    "returns": re.compile(rf"returns\s+at\s+least\s+(?P<least>\S+){_CHANCE}?"),
}


@dataclass(frozen=True)
class EpisodeProperty:
    """A statement about all episodes of a policy."""

    kind: str  # one of ``KINDS``
    text: str  # the statement as it was given
    region: Region | None = None  # where the conditions hold; None without any
    horizon: int | None = None  # of so many steps; ``EVER`` without an end; None for an episode
    chance: float | None = None  # the probability that is asked for, if any
    least: float | None = None  # the return that is asked for, if any


def parse(text: str, schema: Schema | None) -> EpisodeProperty:
    """Return the property that a text describes, such as ``"arrives within 200 steps"``.

    The schema names the numbers of the plant's state; None where no plant is known.

    Raises:
        InvalidArgumentError: The text is no property.
        UnknownNameError: It names no number of the state; names the nearest.
    """
    for kind, form in _FORMS.items():
        found = form.fullmatch(text.strip())
        if found:
            return _property(kind, text.strip(), found.groupdict(), schema)
    raise InvalidArgumentError(
        "property must be 'arrives [within N steps]', 'stays in CONDITIONS [for N steps|for "
        "ever]', 'avoids CONDITIONS [for N steps|for ever]', 'succeeds with probability at least "
        f"P' or 'returns at least R [with probability at least P]', got {text!r}"
    )


def _property(
    kind: str, text: str, parts: dict[str, str | None], schema: Schema | None
) -> EpisodeProperty:
    region, horizon = None, None
    if parts.get("conditions") is not None:
        if schema is None:
            raise InvalidArgumentError(
                f"property {text!r} needs a plant, which says how the states move; none is known "
                "for this environment"
            )
        region = conditions(str(parts["conditions"]), schema)
    if parts.get("steps") is not None:
        horizon = int(str(parts["steps"]))
        if not 1 <= horizon <= _MOST_STEPS:
            raise InvalidArgumentError(
                f"property {text!r} must be about 1 to {_MOST_STEPS:,} steps, got {horizon}"
            )
    elif parts.get("ever"):
        horizon = EVER
    chance = _number(text, "a probability", parts.get("chance"))
    if chance is not None and not 0 < chance < 1:
        raise InvalidArgumentError(
            f"property {text!r} must have a probability between 0 and 1, got {chance}"
        )
    least = _number(text, "a return", parts.get("least"))
    return EpisodeProperty(kind, text, region, horizon, chance, least)


def _number(text: str, meaning: str, word: str | None) -> float | None:
    if word is not None and (number := finite(word)) is None:
        raise InvalidArgumentError(
            f"property {text!r} must have {meaning} in digits, a finite number, got {word!r}"
        )
    return None if word is None else number
