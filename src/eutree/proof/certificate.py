"""What is certified of a policy, in a sentence that a reviewer can sign."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eutree.arrays import Floats, Integers, frozen
from eutree.display import Displayed

PROVEN, REFUTED, UNDECIDED = "proven", "refuted", "undecided"
PROOF, STATISTICAL = "proof", "statistical"
KNOWN, OPEN, FAILS, EMPTY = range(4)  # of a picture's cells
NEVER = 2**31 - 1  # number of steps after which nothing has happened


@dataclass(frozen=True, eq=False)
class Pieces:
    """The boxes of starts that a proof has cut, and when each ends.

    Attributes:
        names: Names of the numbers of a state.
        low: Lower bounds.
        high: Upper bounds.
        first: No state of the piece ends before so many steps; ``NEVER`` where none does.
        last: All states of the piece end within so many; ``NEVER`` where that is not known.
    """

    names: tuple[str, ...]
    low: Floats  # [N, d]
    high: Floats  # [N, d]
    first: Integers  # [N]
    last: Integers  # [N]

    def __post_init__(self) -> None:
        for name in ("low", "high", "first", "last"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True, eq=False)
class Starts:
    """Boxes of states from which a property fails, or is not decided.

    Attributes:
        names: Names of the numbers of a state.
        low: Lower bounds.
        high: Upper bounds.
    """

    names: tuple[str, ...]
    low: Floats  # [N, d]
    high: Floats  # [N, d]

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def draw(self, generator: np.random.Generator) -> Floats:
        """Return a state [d] of one of the boxes, all of them equally likely."""
        box = int(generator.integers(len(self.low)))
        state: Floats = generator.uniform(self.low[box], self.high[box])
        return state


@dataclass(frozen=True, eq=False)
class Picture:
    """Cells of one number or of two.

    Attributes:
        title: What is drawn.
        names: Names of the numbers.
        low: Where the cells begin, of each number.
        high: Where they end.
        values: What is known of a cell: the higher, the darker.
        marks: ``KNOWN``, ``OPEN``, ``FAILS``, or ``EMPTY`` where nothing is drawn.
        legend: What the colours mean.
    """

    title: str
    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    values: Floats  # [I, J]; J is 1 for one number
    marks: Integers  # [I, J]
    legend: str

    def __post_init__(self) -> None:
        for name in ("values", "marks"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True, eq=False)
class Certificate(Displayed):
    """The answer of a proof or of a sample.

    Attributes:
        sentence: What holds, or what was refuted, or how far it came.
        kind: ``"proof"``, for every start, or ``"statistical"``, from episodes that were drawn.
        verdict: ``"proven"``, ``"refuted"`` or ``"undecided"``.
        bounds: What lies between which two numbers: ``{"steps": (83, 104)}``.
        undecided: Share of the starts that is not decided.
        worst_start: The start that takes longest, by the names of the state; None if not known.
        counterexample: A start from which the real environment breaks the property; None if none.
        starts: Where episodes may begin to learn more: where it fails or is undecided; None where
            it does nowhere, or where no place can be named.
        pieces: What the starts were cut into; None where they were not.
        pictures: What is known of the starts, or of all states that are reached.
        work: What it took: pieces, steps of boxes, cells, episodes.
    """

    sentence: str
    kind: str
    verdict: str
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    undecided: float = 0.0
    worst_start: Mapping[str, float] | None = None
    counterexample: Mapping[str, Any] | None = None
    starts: Starts | None = None
    pieces: Pieces | None = None
    pictures: tuple[Picture, ...] = ()
    work: Mapping[str, float] = field(default_factory=dict)

    @property
    def proven(self) -> bool:
        """Whether the property holds; a statistical one: at its confidence."""
        return self.verdict == PROVEN

    def figures(self) -> dict[str, Any]:
        """Return all but the pieces, as ``eutree prove --json`` prints it."""
        return {
            "proven": self.proven,
            "verdict": self.verdict,
            "kind": self.kind,
            "sentence": self.sentence,
            "bounds": {name: list(ends) for name, ends in self.bounds.items()},
            "undecided": self.undecided,
            "worst_start": self.worst_start,
            "counterexample": self.counterexample,
            "work": dict(self.work),
        }

    def __str__(self) -> str:
        """Return the verdict and the sentence."""
        return f"{self.verdict} ({self.kind}): {self.sentence}"
