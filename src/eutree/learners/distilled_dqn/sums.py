"""Weighted sums of features that a tree may ask for, where a network decides by them.

A network weighs features against each other; a tree that asks for one at a time copies that by a
staircase of tests. So sums are looked for where a tree that copies the teacher is large: at its
root and at its largest subtrees. A sum begins with a feature that tells the teacher's actions apart
there and takes one more at a time, with the weight at which its best test takes away most entropy.
Weights are rounded to two digits, for people read them. Of all sums found, that one is taken with
which trees of half of the labels lose least of what the teacher expects on the other half; the next
is looked for beside it. Nothing here is chance.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import best_reductions
from eutree.cart import grow_cart
from eutree.formulas import in_formula
from eutree.schema import Schema

LEAVES = 16  # of the trees that are compared, whatever size is allowed
LARGE, SUBTREES, STAIRCASE = 32, 5, 4  # leaves of the tree looked at, its subtrees, their leaves
LOOKED_AT = 4000  # labels in each place
BEGUN = 3  # features that a sum is begun with
TERMS = 4
ANGLES = 0.2 * np.arange(-7, 8)  # whose tangents are the weights tried, in units of the spreads
FACTORS = np.array([0.5, 0.7, 0.85, 1.2, 1.4, 2.0])  # by which a weight is changed
SWEEPS = 2  # over the weights of a sum, after each feature
BLOCK = 500  # neighbouring labels, mostly of one episode, that are on the same side
LESS, SURE = 0.02, 1.0  # share of the loss, and standard errors over blocks, that a sum must save
LEAST = 0.001  # of the mean weight of a label, too: where copies lose nothing, all is chance
DIGITS = 2


@dataclass(frozen=True, eq=False)
class Sums:
    """Weighted sums, which stand behind the features."""

    weights: Floats  # [K, d], of each feature in each sum

    def __len__(self) -> int:
        """Return their number K."""
        return len(self.weights)

    def behind(self, observations: Floats) -> Floats:
        """Return observations [..., d] with the sums behind them, [..., d + K].

        Products are added in the order of the features, as the formulas do, to the same bits.
        """
        total = np.zeros((*observations.shape[:-1], len(self)))
        for feature, weights in enumerate(self.weights.T):
            total += observations[..., feature, np.newaxis] * weights
        return np.concatenate([observations, total], axis=-1)

    def declarations(self, schema: Schema) -> tuple[str, ...]:
        """Return the sums as derived features of a schema."""
        names = [in_formula(name) for name in schema.feature_names]
        free = (f"sum {k}" for k in range(1, 10**6) if f"sum {k}" not in schema.feature_names)
        found = zip(free, self.weights, strict=False)
        return tuple(f"{name} = {_formula(weights, names)}" for name, weights in found)


@dataclass(frozen=True, eq=False)
class Labels:
    """What a teacher would do, and what it expects of every action."""

    columns: Floats  # [N, d + K], observations, and the sums found so far
    actions: Integers  # [N]
    values: Floats  # [N, A], its Q

    @property
    def weights(self) -> Floats:
        """How much each counts: max_a Q - min_a Q, as in VIPER, shape [N]."""
        gaps: Floats = np.ptp(self.values, axis=1)
        return gaps if gaps.any() else np.ones(len(gaps))

    def at(self, rows: Integers | Booleans) -> "Labels":
        """Return some of them."""
        return Labels(self.columns[rows], self.actions[rows], self.values[rows])

    def reductions(self, columns: Floats) -> Floats:
        """Return by how many bits the best test of each column tells actions apart."""
        return best_reductions(np.ascontiguousarray(columns), self.actions, self.weights)

    def losses(self, column: Floats | None = None) -> Floats:
        """Return what trees lose of the teacher's values, the mean of each block of labels.

        Each of two trees is fitted to every other block and decides in those between. They may ask
        for one more column, shape [N].
        """
        columns = self.columns if column is None else np.column_stack([self.columns, column])
        block = np.arange(len(columns)) // BLOCK
        gaps = np.zeros(len(columns))
        for half in (block % 2 == 0, block % 2 == 1):
            known, other = self.at(half), self.at(~half)
            tree, actions = grow_cart(
                columns[half], known.actions, n_classes=self.values.shape[1],
                max_leaves=LEAVES, weights=known.weights,
            )  # fmt: skip
            chosen = actions[tree.leaf_index(columns[~half])]
            rows = np.arange(chosen.size)
            gaps[~half] = other.values[rows, other.actions] - other.values[rows, chosen]
        gaps = np.maximum(gaps, 0.0)  # an action that a mask forbids gains nothing
        means: Floats = np.bincount(block, gaps) / np.bincount(block)
        return means


def found_sums(labels: Labels, most: int) -> Sums:
    """Return the sums of features that shorten trees of labels, at most so many.

    The labels have the features alone as columns, and are in the order in which they were met.
    """
    features = labels.columns
    sums = Sums(np.empty((0, features.shape[1])))
    if len(features) < 2 * BLOCK:
        return sums
    losses = labels.losses()
    while len(sums) < most:
        grown = [sum_ for place in _places(labels) for sum_ in _grown(place, features.shape[1])]
        tried = {
            weights: labels.losses(Sums(np.array([weights])).behind(features)[:, -1])
            for weights in dict.fromkeys(map(_rounded, grown))
        }
        best = min(tried, key=lambda weights: float(tried[weights].mean()), default=None)
        least = LEAST * float(labels.weights.mean())
        if best is None or not _saves(losses, tried[best], least):
            break
        losses = tried[best]
        sums = Sums(np.vstack([sums.weights, best]))
        labels = Labels(sums.behind(features), labels.actions, labels.values)
    return sums


def _saves(before: Floats, after: Floats, least: float) -> bool:
    """Return whether losses of blocks are smaller by enough.

    More certainty costs more than a sum too many, which no tree has to ask for: a few blocks hold
    most of a loss, so that two standard errors left half of the good ones out.
    """
    saved = before - after
    error = float(saved.std(ddof=1)) / math.sqrt(saved.size)
    return bool(saved.mean() > max(LESS * before.mean(), SURE * error, least))


def _places(labels: Labels) -> Iterator[Labels]:
    """Yield the labels at the root and at the largest subtrees of a tree, so many at most each."""
    tree, _ = grow_cart(
        labels.columns, labels.actions, n_classes=labels.values.shape[1],
        max_leaves=LARGE, weights=labels.weights,
    )  # fmt: skip
    leaf = tree.leaf_index(labels.columns)
    for below in tree.largest_subtrees(SUBTREES, least=STAIRCASE):
        rows = np.flatnonzero(below[leaf])
        yield labels.at(rows[:: -(-rows.size // LOOKED_AT)])


def _grown(place: Labels, n_features: int) -> list[Floats]:
    """Return the sums of two, three ... features up to the one that tells most, [d] each."""
    features = place.columns[:, :n_features]
    quantities = [j for j in range(n_features) if np.unique(features[:, j]).size > 2]
    alone = place.reductions(features)
    grown = [
        list(_growing(place, features, quantities, first))
        for first in sorted(quantities, key=lambda j: -alone[j])[:BEGUN]
    ]
    told = [sums for sums in grown if sums]
    return [weights for _, weights in max(told, key=lambda sums: sums[-1][0])] if told else []


def _growing(
    place: Labels, features: Floats, quantities: Sequence[int], first: int
) -> Iterator[tuple[float, Floats]]:
    """Yield what a sum tells, in bits, and its weights [d], with one feature more each time."""
    weights, spread = np.eye(features.shape[1])[first], features.std(axis=0)
    while np.count_nonzero(weights) < min(TERMS, len(quantities)):
        unit = float((features @ weights).std())
        tried = [
            weights + math.tan(angle) * unit / spread[j] * np.eye(weights.size)[j]
            for j in quantities
            if not weights[j]
            for angle in ANGLES
        ]
        before = np.count_nonzero(weights)
        told, weights = _best(place, features, tried)
        if np.count_nonzero(weights) == before:  # nothing more helps
            return
        for j in [j for j in quantities if weights[j] and j != first] * SWEEPS:
            changed = np.where(np.arange(weights.size) == j, FACTORS[:, np.newaxis], 1.0)
            told, weights = _best(place, features, [weights, *(weights * changed)])
        yield told, weights


def _best(place: Labels, features: Floats, tried: Sequence[Floats]) -> tuple[float, Floats]:
    """Return what the sum of the best weights tells, in bits, and these."""
    told = place.reductions(features @ np.array(tried).T)
    best = int(told.argmax())
    return float(told[best]), tried[best]


def _rounded(weights: Floats) -> tuple[float, ...]:
    """Return weights for people, the first one 1."""
    return tuple(float(f"{one:.{DIGITS}g}") for one in weights / weights[weights != 0.0][0])


def _formula(weights: Floats, names: Sequence[str]) -> str:
    terms = [
        (" - " if weight < 0.0 else " + ")
        + (name if abs(weight) == 1.0 else f"{abs(weight)!r} * {name}")
        for weight, name in zip(weights.tolist(), names, strict=True)
        if weight
    ]
    return "".join(terms).removeprefix(" + ")
