"""Certificates from episodes that were drawn, where no plant is known: plainly statistical.

They are wrong with a probability that is stated, and say nothing about any one start. They assume
that episodes are independent draws of one kind, as an environment's seeds make them.

References: C. J. Clopper, E. S. Pearson, *The use of confidence or fiducial limits*, Biometrika 26
(1934); S. S. Wilks, *Determination of sample sizes for setting tolerance limits*, Annals of
Mathematical Statistics 12 (1941); for means :mod:`eutree.contests.betting`.
"""

import math
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats
from eutree.contests.betting import lower_bound
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation, Interval
from eutree.evaluation.evaluation import check_confidence
from eutree.proof.certificate import PROVEN, REFUTED, STATISTICAL, UNDECIDED, Certificate
from eutree.proof.properties import EpisodeProperty, parse
from eutree.validation import check_integer

_SLACK = 1e-9  # of a probability: greatest error of the sums of its tails
_BISECTIONS = 60


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """The confidence of a statistical certificate, and the range of returns it takes for granted.

    Attributes:
        confidence: Probability with which both bounds hold together.
        returns: Lowest and highest return there can be; None where that is not known.
    """

    confidence: float = 0.99
    returns: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_confidence(self.confidence)
        if self.returns is not None and not self.returns[0] < self.returns[1]:
            raise InvalidArgumentError(
                f"range must be a lower and a higher return, got {list(self.returns)}"
            )

    @property
    def error(self) -> float:
        """Probability with which one of the two bounds is wrong."""
        return (1.0 - self.confidence) / 2.0


def certify_sample(
    evaluation: Evaluation,
    question: str | EpisodeProperty | None = None,
    *,
    environment: str,
    sampling: Sampling | None = None,
) -> Certificate:
    """Return the statistical certificate of a property from the episodes of a policy.

    - ``succeeds [with probability at least P]``: exact binomial bounds of its success.
    - ``returns at least R with probability at least P``: the same, of episodes that do.
    - ``returns at least R``: betting bounds of the mean return, which need its range.
    - none: bounds of the success where the environment reports it, of the mean return where its
      range is known, and the least share of episodes that return as much as the worst one here.

    Args:
        evaluation: Episodes of the policy, drawn without regard to their results.
        question: The property.
        environment: The environment, for the sentence.
        sampling: Confidence, and the range of returns.

    Raises:
        InvalidArgumentError: The text is no property, or the episodes cannot answer it.
    """
    sampling = sampling or Sampling()
    asked = asked_of_episodes(question, environment, sampling)
    n, successes = evaluation.episodes, evaluation.successes
    confident = f"with {100 * sampling.confidence:g} % confidence by {n:,} episodes"
    if asked is not None and asked.kind == "succeeds" and successes is None:
        raise InvalidArgumentError(
            f"{environment} reports no success (is_success in the info of a last step); ask for "
            "'returns at least R with probability at least P'"
        )
    if asked is None or (asked.kind == "succeeds" and asked.chance is None):
        bounds, words = _plain(evaluation, sampling)
        each = "each " if len(bounds) > 1 else ""
        sentence = f"in {environment}, {each}{confident}: {words}"
        return Certificate(sentence, STATISTICAL, PROVEN, bounds, work={"episodes": n})
    least = float(asked.least or 0.0)
    if asked.chance is None:
        name, found = "mean_return", mean_bounds(evaluation.returns, sampling)
    else:
        name, reached = "share", evaluation.returns >= least
        if asked.kind == "succeeds" and successes is not None:
            name, reached = "success", successes
        least = asked.chance
        found = binomial_bounds(int(np.sum(reached)), n, error=sampling.error)
    verdict = PROVEN if found.low >= least else REFUTED if found.high < least else UNDECIDED
    holds = {PROVEN: "holds", REFUTED: "does not hold", UNDECIDED: "is open"}[verdict]
    return Certificate(
        sentence=f"in {environment}, {confident}: '{asked.text}' {holds}; "
        f"{name.replace('_', ' ')} is in {_words(found)}",
        kind=STATISTICAL,
        verdict=verdict,
        bounds={name: found},
        undecided=1.0 if verdict == UNDECIDED else 0.0,
        work={"episodes": n},
    )


def asked_of_episodes(
    question: str | EpisodeProperty | None, environment: str, sampling: Sampling
) -> EpisodeProperty | None:
    """Return the property that is asked for; refuse one that no number of episodes answers.

    Raises:
        InvalidArgumentError: It is none, needs a plant, or a range of returns.
    """
    asked = parse(question, None) if isinstance(question, str) else question
    if asked is not None and asked.kind not in ("succeeds", "returns"):
        raise InvalidArgumentError(
            f"property {asked.text!r} needs a plant, which says how the states move; episodes of "
            f"{environment}, asked with --sampled or where none is known, answer 'succeeds with "
            "probability at least P', 'returns at least R [with probability at least P]'"
        )
    if asked is not None and asked.kind == "returns" and asked.chance is None:
        _range(sampling)
    return asked


def binomial_bounds(successes: int, n: int, *, error: float) -> Interval:
    """Return Clopper and Pearson's bounds of a probability, each wrong with ``error`` at most."""
    n = check_integer("n", n, low=1)
    successes = check_integer("successes", successes, high=n)
    low = 0.0 if successes == 0 else _quantile(successes, n, error)
    high = 1.0 if successes == n else 1.0 - _quantile(n - successes, n, error)
    return Interval(max(low - _SLACK, 0.0), min(high + _SLACK, 1.0))


def mean_bounds(returns: Floats, sampling: Sampling) -> Interval:
    """Return betting bounds of the mean of returns whose range is known, shape [E]."""
    worst, best = _range(sampling)
    if returns.min() < worst or returns.max() > best:
        raise InvalidArgumentError(
            f"range must hold every return, got {[worst, best]} and returns from "
            f"{returns.min():g} to {returns.max():g}"
        )
    low = lower_bound(returns, worst, sampling.error)
    return Interval(low, -lower_bound(-returns, -best, sampling.error))


def _range(sampling: Sampling) -> tuple[float, float]:
    """Return the lowest and the highest return, without which there are no bounds of a mean."""
    if sampling.returns is None:
        raise InvalidArgumentError(
            "bounds of a mean return need the lowest and the highest return there can be "
            "(--range LOW HIGH): without a range no number of episodes rules out a rare disaster"
        )
    return sampling.returns


def _plain(evaluation: Evaluation, sampling: Sampling) -> tuple[dict[str, Interval], str]:
    """Return all bounds that the episodes allow, with nothing to be proven, and in words."""
    worst = float(evaluation.returns.min())
    # Wilks: a return that all of n draws reach is reached by one more with this probability at
    # least.
    reaching = (1.0 - sampling.confidence) ** (1.0 / evaluation.episodes) - _SLACK
    bounds = {"share_at_least_worst_seen": Interval(reaching, 1.0)}
    parts = [f"an episode returns at least {worst:g} with probability at least {reaching:.4g}"]
    if evaluation.successes is not None:
        successes, n = int(np.sum(evaluation.successes)), evaluation.episodes
        bounds["success"] = binomial_bounds(successes, n, error=sampling.error)
        parts.append(f"it succeeds with probability in {_words(bounds['success'])}")
    if sampling.returns is not None:
        bounds["mean_return"] = mean_bounds(evaluation.returns, sampling)
        parts.append(f"the mean return is in {_words(bounds['mean_return'])}")
    return bounds, "; ".join(parts)


def _quantile(successes: int, n: int, error: float) -> float:
    """Return the largest p at which so many successes or more have at most this probability."""
    low, high = 0.0, successes / n
    for _ in range(_BISECTIONS):
        between = low + (high - low) * 0.5
        if _tail(successes, n, between) <= error:
            low = between
        else:
            high = between
    return low


def _tail(successes: int, n: int, p: float) -> float:
    """Return P(X >= successes) of a binomial number X of n trials."""
    if p <= 0.0:
        return 0.0
    k = np.arange(successes, n + 1)
    # log of n over k, from the ratios of neighbours
    first = math.lgamma(n + 1) - math.lgamma(successes + 1) - math.lgamma(n - successes + 1)
    steps = np.log((n - k[:-1]) / (k[:-1] + 1.0))
    logs = first + np.concatenate([[0.0], np.cumsum(steps)])
    logs = logs + k * math.log(p) + (n - k) * math.log1p(-p)
    return float(np.exp(np.logaddexp.reduce(logs)))


def _words(found: Interval) -> str:
    return f"[{found.low:.4g}, {found.high:.4g}]"
