"""Would more demonstrations help? The learning curve of the expert tree, and where it leads.

For each size k the expert tree is fitted to k of the n episodes and asked about all others: the
accuracy of an episode is the share of its steps at which the tree chose what is to be imitated.
The subsets are runs of k neighbours around random circles of the episodes, so at each size all
episodes are held out about equally often. Episodes, not steps, are the units of the interval.

The errors are fitted by a power law a + b k^-c with a, b >= 0, the points weighted by k, because
the first ones often lie off it (Figueroa et al., *Predicting sample size required for
classification performance*, BMC Medical Informatics and Decision Making 12, 2012), and the law is
extended to n + 5. The interval of the gain is a bootstrap over episodes. It knows nothing of other
kinds of demonstration: it answers for more of the same.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats
from eutree.c45 import C45Settings
from eutree.data import Demonstrations
from eutree.data.demonstrations import lessons
from eutree.data.episode import CUT
from eutree.evaluation.evaluation import Interval, mean_interval
from eutree.learners import fit_expert_tree

MIN_EPISODES = 4
FITS = 30  # trees of each size
MORE = 5  # episodes that the gain is asked for
_SIZES = 8
_BOOTSTRAPS = 400
_EXPONENTS = np.linspace(0.1, 2.0, 39)
_SAME = 1e-15  # of squared errors
_POINT = 0.01
_MUCH = 0.05  # error that is worth a remark


@dataclass(frozen=True)
class PowerLaw:
    """An error of a + b k^-c after k episodes."""

    floor: float
    scale: float
    exponent: float

    def error(self, k: float) -> float:
        """Return the error after ``k`` episodes."""
        return float(self.floor + self.scale * k**-self.exponent)


@dataclass(frozen=True)
class ExpertCurvePoint:
    """Accuracy on held-out episodes of trees fitted to ``k`` episodes, with its 95 % interval."""

    k: int
    accuracy: float
    interval: Interval


@dataclass(frozen=True)
class ExpertCurve:
    """How well the expert tree foretells the demonstrator, by number of episodes."""

    points: tuple[ExpertCurvePoint, ...]  # the measured accuracies, for ascending k
    law: PowerLaw  # the fitted power law of the error
    n_episodes: int  # how many episodes there are
    # Share of the steps with the most frequent action: the accuracy of a tree that knows nothing
    most_frequent: float
    more: int  # how many more the gain is for
    gain: float  # accuracy that ``more`` episodes would likely add, by the law
    gain_interval: Interval  # its 95 % interval

    @property
    def advice(self) -> str:
        """One or two sentences for the person who demonstrates."""
        if self.points[-1].interval.low <= self.most_frequent:
            return (
                f"Nothing can be said yet: the tree's accuracy, {self.points[-1].accuracy:.0%}, is "
                f"not clearly above that of the most frequent action, {self.most_frequent:.0%}."
            )
        low, high = self.gain_interval.percent
        if self.gain < _POINT / 2 and self.gain_interval.high < _POINT:
            return (
                f"More of the same will not help: {self.more} more episodes would likely gain "
                "less than 1 point of accuracy." + self._doubt
            )
        points = f"{100 * self.gain:.1f}".removesuffix(".0")
        return (
            f"{self.more} more episodes would likely gain about {points} "
            f"{'point' if points == '1' else 'points'} of accuracy on average "
            f"(95 % interval {low:.1f} to {high:.1f})."
        )

    @property
    def _doubt(self) -> str:
        """The likely cause where more episodes do not help and the tree still errs; else ""."""
        error = 1.0 - self.points[-1].accuracy
        if error < _MUCH:
            return ""
        return (
            f" The tree still errs in {error:.0%} of the steps: similar situations were answered "
            "differently, or what decides is not observed."
        )


def expert_curve(demonstrations: Demonstrations) -> ExpertCurve | None:
    """Return the learning curve of the expert tree, or None with fewer than four episodes.

    They are of one demonstrator; those of which nothing is imitated are left out: discarded ones,
    empty ones, and those that are cut altogether.
    """
    taught = [e.kept and e.weights[e.taught != CUT].any() for e in demonstrations.episodes]
    episodes = np.flatnonzero(taught).tolist()
    n = len(episodes)
    if n < MIN_EPISODES:
        return None
    generator = np.random.default_rng(np.random.SeedSequence((0, n)))
    sizes = np.unique(np.geomspace(1, n - 1, _SIZES).round().astype(int))
    accuracies = np.array([_accuracies(demonstrations, episodes, int(k), generator) for k in sizes])
    _, actions = lessons(demonstrations)
    drawn = generator.integers(n, size=(_BOOTSTRAPS, n))
    laws = [fit_power_law(sizes, 1.0 - _mean(accuracies[:, rows])) for rows in drawn]
    gains = [law.error(n) - law.error(n + MORE) for law in laws]
    law = fit_power_law(sizes, 1.0 - _mean(accuracies))
    return ExpertCurve(
        points=tuple(_point(int(k), row) for k, row in zip(sizes, accuracies, strict=True)),
        law=law,
        n_episodes=n,
        most_frequent=float(np.bincount(actions).max() / len(actions)),
        more=MORE,
        gain=law.error(n) - law.error(n + MORE),
        gain_interval=Interval(*np.quantile(gains, [0.025, 0.975]).tolist()),
    )


def fit_power_law(sizes: Floats, errors: Floats) -> PowerLaw:
    """Return the law of least squares through ``errors`` [S] at ``sizes`` [S], weighted by size."""
    weights = np.asarray(sizes, dtype=float)
    x = weights ** -_EXPONENTS[:, np.newaxis]  # [K, S]
    x_mean, y_mean = x @ weights / weights.sum(), float(np.average(errors, weights=weights))
    centred = x - x_mean[:, np.newaxis]
    spread = centred**2 @ weights
    slope = np.divide(centred * errors @ weights, spread, where=spread > 0.0, out=0.0 * spread)
    through_origin = x * errors @ weights / (x * x @ weights)
    # For each exponent the best line a + b x, the best without a, and the best without b, [K, 3].
    floors = np.stack([y_mean - slope * x_mean, 0.0 * slope, y_mean + 0.0 * slope], axis=1)
    scales = np.stack([slope, through_origin, 0.0 * slope], axis=1)
    lines = floors[..., np.newaxis] + scales[..., np.newaxis] * x[:, np.newaxis]
    missed = np.where((floors < 0.0) | (scales < 0.0), np.inf, (lines - errors) ** 2 @ weights)
    best = int((missed <= missed.min() + _SAME).argmax())  # the first: no digit chooses
    exponent = float(_EXPONENTS[best // missed.shape[1]])
    return PowerLaw(float(floors.flat[best]), float(scales.flat[best]), exponent)


def _accuracies(
    demonstrations: Demonstrations, episodes: list[int], k: int, generator: np.random.Generator
) -> Floats:
    """Return each episode's mean accuracy under trees of ``k`` others; NaN if never held out."""
    n = len(episodes)
    total, count = np.zeros(n), np.zeros(n)
    for subset in _subsets(n, k, generator):
        chosen = tuple(demonstrations.episodes[episodes[i]] for i in subset)
        part = Demonstrations(chosen, demonstrations.schema, demonstrations.environment)
        tree = fit_expert_tree(part, settings=C45Settings())
        for i in sorted(set(range(n)) - set(subset)):
            episode = demonstrations.episodes[episodes[i]]
            decided = tree.decide(episode.observations[:-1], episode.allowed)
            worth = episode.weights * (episode.taught != CUT)
            total[i] += float(np.average(decided == episode.taught, weights=worth))
            count[i] += 1
    accuracy = np.full(n, np.nan)
    accuracy[count > 0] = total[count > 0] / count[count > 0]
    return accuracy


def _subsets(n: int, k: int, generator: np.random.Generator) -> list[list[int]]:
    """Return ``FITS`` subsets of k of n episodes: runs around random circles, evenly spaced."""
    subsets: list[list[int]] = []
    while len(subsets) < FITS:
        circle = generator.permutation(n)
        missing = min(n, FITS - len(subsets))
        for first in (np.arange(missing) * n // missing).tolist():
            subsets.append(np.roll(circle, -first)[:k].tolist())
    return subsets


def _mean(accuracies: Floats) -> Floats:
    """Return the mean over episodes, shape [S]; where none of them was held out, that of the rest.

    A bootstrap sample of few episodes may hold none that was held out at the largest size.
    """
    known = ~np.isnan(accuracies)
    rows = known.any(axis=1)
    means = np.full(len(accuracies), np.nan)
    means[rows] = np.nanmean(accuracies[rows], axis=1)
    means[~rows] = np.nanmean(accuracies)
    return means


def _point(k: int, accuracies: Floats) -> ExpertCurvePoint:
    known = accuracies[~np.isnan(accuracies)]
    low, high = mean_interval(known)
    return ExpertCurvePoint(k, float(known.mean()), Interval(max(low, 0.0), min(high, 1.0)))
