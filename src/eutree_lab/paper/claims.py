"""Claims of the paper that can be checked, beside our figures: computed, never written by hand."""

import tomllib
from dataclasses import dataclass
from importlib import resources

import numpy as np

from eutree.evaluation import Estimate

HOLDS, FAILS, OPEN = "holds", "does not hold", "cannot be told"
SMOKE_RUN = (
    "A smoke run: a few tiny runs, to see that everything works. Its verdicts say nothing of the "
    "paper or of any method."
)


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper beside our figure.

    Attributes:
        id: Names the claim for ever, for example ``"figure-2/half-the-trials"``.
        sentence: The claim of the paper.
        paper: The paper's number, as text.
        ours: Our number.
        interval: Its 95 % interval.
        holds: ``"holds"``, ``"does not hold"`` or ``"cannot be told"``.
        rule: Condition on our number.
        unit: Unit of our number, for people to read.
        preset: Settings under which ours was found.
        times: How many times as many runs would tell, about, if our number stayed the same and the
            interval shrank with the root of the runs; None where that is told, or where our number
            lies on the bound itself.
        is_inside: Whether our number itself is as the rule wants it.
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
    times: float | None = None
    is_inside: bool = True


_CLAIMS = tomllib.loads((resources.files(__package__) / "claims.toml").read_text(encoding="utf-8"))


def claimed(name: str, estimate: Estimate, *, key: str = "", **words: object) -> Claim:
    """Return a claim of the paper, judged.

    Args:
        name: Its id, the last part of which is its name in ``claims.toml``.
        estimate: Our number.
        key: Its name there where it is another one.
        **words: Words of its sentence and of its rule.
    """
    known = _CLAIMS[key or name.rpartition("/")[2]]
    said = {part: known[part].format(**words) for part in ("sentence", "rule")}
    return judged(name, estimate=estimate, **{**known, **said})


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
        times=None if verdict != OPEN else _times(estimate.value, (lower, upper), (low, high)),
        is_inside=low <= estimate.value <= high,
    )


def _times(
    value: float, interval: tuple[float, float], allowed: tuple[float, float]
) -> float | None:
    """Return how many times as many runs would tell: intervals shrink with the root of the runs."""
    across = [end for end in allowed if interval[0] <= end <= interval[1]]
    if not allowed[0] <= value <= allowed[1]:
        across = [min(across, key=lambda end: abs(end - value))]
    if value in across:
        return None
    return max(((interval[int(end > value)] - value) / (end - value)) ** 2 for end in across)


def close_to(
    name: str, sentence: str, *, number: float, estimate: Estimate, tolerance: float, unit: str = ""
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
