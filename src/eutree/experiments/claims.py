"""What the paper says that can be checked, and what we found: computed, never written by hand."""

from dataclasses import dataclass

import numpy as np

from eutree.evaluation import Estimate

HOLDS, FAILS, OPEN = "holds", "does not hold", "cannot be told"


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper beside our figure.

    Attributes:
        id: Names the claim for ever, for example ``"figure-2/half-the-trials"``.
        sentence: What the paper says.
        paper: The paper's number, as text.
        ours: Our number.
        interval: Its 95 % interval.
        holds: ``"holds"``, ``"does not hold"`` or ``"cannot be told"``.
        rule: What had to be true of our number.
        unit: Unit of our number, for people to read.
        preset: Settings under which ours was found.
    """

    id: str
    sentence: str
    paper: str
    ours: float
    interval: tuple[float, float]
    holds: str
    rule: str
    unit: str = ""
    preset: str = ""


def judged(
    name: str,
    sentence: str,
    *,
    paper: str,
    estimate: Estimate,
    low: float = -np.inf,
    high: float = np.inf,
    rule: str,
    unit: str = "",
) -> Claim:
    """Return the claim that the true value lies between ``low`` and ``high``.

    It holds if the whole interval lies there, does not hold if none of it does, and cannot be
    told from these runs otherwise.
    """
    lower, upper = (float(end) for end in estimate.interval)
    if low <= lower and upper <= high:
        verdict = HOLDS
    elif upper < low or lower > high:
        verdict = FAILS
    else:
        verdict = OPEN
    return Claim(
        id=name,
        sentence=sentence,
        paper=paper,
        ours=float(estimate.value),
        interval=(lower, upper),
        holds=verdict,
        rule=rule,
        unit=unit,
    )


def close_to(
    name: str,
    sentence: str,
    *,
    number: float,
    estimate: Estimate,
    tolerance: float,
    unit: str = "",
) -> Claim:
    """Return the claim that the true value is the paper's number, give or take ``tolerance``."""
    return judged(
        name,
        sentence,
        paper=f"{number:g}",
        estimate=estimate,
        low=number - tolerance,
        high=number + tolerance,
        rule=f"within {tolerance:g} of {number:g}",
        unit=unit,
    )
