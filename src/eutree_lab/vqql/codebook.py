"""Vector quantization: the generalized Lloyd algorithm, alone and inside each leaf of a tree.

A codebook stands for a set of points by N of them, its *codewords*; a point belongs to the nearest
one. Linde, Buzo and Gray (1980) begin with the mean, split each codeword in two, and improve them
(Lloyd): every point goes to its nearest codeword, every codeword to the mean of its points, until
the distortion, the mean squared distance, falls no more. VQQL (Fernandez & Borrajo 2000) takes the
cells of such a codebook as the states of a continuous task.

Nearness depends on units, so points are divided by a scale first. There is no chance in it: ties go
to the lower number, and a codeword without points takes the point that is furthest from its own.
"""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.trees import DecisionTree
from eutree_lab.vqql import _kernels as kernels

TOLERANCE = 1e-4  # relative fall of the distortion below which Lloyd's iteration ends
APART = 0.1  # standard deviations between the halves of a split codeword
MOST_ITERATIONS = 200


@dataclass(frozen=True, eq=False)
class Codebook:
    """Codewords inside the leaves of a tree; its *regions* are pairs of a leaf and a codeword.

    Regions are numbered leaf by leaf. A tree of one leaf is an ordinary codebook; one codeword in
    each leaf is the tree itself.

    Attributes:
        tree: The outer partition: no region reaches across a cut of it.
        codewords: In units of the scale.
        first: First region of each leaf, and their number at the end.
        scale: Unit of each feature.
    """

    tree: DecisionTree
    codewords: Floats  # [R, d]
    first: Integers  # [L + 1]
    scale: Floats  # [d]

    @property
    def n_regions(self) -> int:
        """Number of regions R."""
        return len(self.codewords)

    @property
    def leaf(self) -> Integers:
        """The leaf of each region, shape [R]."""
        return np.repeat(np.arange(self.tree.n_leaves), np.diff(self.first))

    def regions(self, observations: Floats) -> Integers:
        """Return the region of each observation [N, d], shape [N]."""
        leaves = self.tree.leaf_index(observations).astype(np.int64)
        regions = np.empty(len(observations), dtype=np.int64)
        kernels.nearest_in_leaf(
            observations / self.scale, leaves, self.codewords, self.first, regions
        )
        return regions

    def distances(self, observations: Floats) -> Floats:
        """Return how far each observation is from its codeword, in units of the scale, shape [N].

        Further than any that the codebook was made of is a place that it does not know.
        """
        offsets = observations / self.scale - self.codewords[self.regions(observations)]
        distances: Floats = np.sqrt((offsets**2).sum(axis=1))
        return distances


def generalized_lloyd(points: Floats, n_codewords: int) -> tuple[Floats, float]:
    """Return a codebook of points, and its distortion.

    Args:
        points: Shape [N, d], at least one.
        n_codewords: How many; fewer come back where there are fewer distinct points.

    Returns:
        Codewords of shape [at most n_codewords, d], and the mean squared distance to them.
    """
    n_codewords = min(n_codewords, len(np.unique(points, axis=0)))
    codewords = points.mean(axis=0, keepdims=True)
    codewords, owners, distortion = _improved(points, codewords)
    while len(codewords) < n_codewords:
        codewords = _split(points, codewords, owners, n_codewords)
        codewords, owners, distortion = _improved(points, codewords)
    return codewords, distortion


def codebook_in_leaves(
    tree: DecisionTree, observations: Floats, n_regions: int, *, scale: Floats
) -> Codebook:
    """Return a codebook inside each leaf of a tree, of ``n_regions`` in all.

    Begins with one codeword in each leaf, and doubles those of the leaf with the largest total
    distortion as long as there is room. A leaf without observations keeps a single codeword, which
    all of it belongs to wherever that lies.

    Args:
        tree: The outer partition.
        observations: Observations to quantize, shape [N, d].
        n_regions: Regions in all; at least one for each leaf.
        scale: Unit of each feature, shape [d].
    """
    points = observations / scale
    leaves = tree.leaf_index(observations)
    inside = [points[leaves == leaf] for leaf in range(tree.n_leaves)]
    words = [
        generalized_lloyd(own, 1) if len(own) else (np.zeros((1, tree.n_features)), 0.0)
        for own in inside
    ]
    full = np.array([not len(own) for own in inside])  # [L] no more codewords to be had
    while not full.all():
        totals = np.array([found[1] * len(own) for found, own in zip(words, inside, strict=True)])
        leaf = int(np.where(full, -1.0, totals).argmax())
        room = n_regions - sum(len(found) for found, _ in words)
        before = len(words[leaf][0])
        if room <= 0 or totals[leaf] <= 0.0:
            break
        words[leaf] = generalized_lloyd(inside[leaf], before + min(before, room))
        full[leaf] = len(words[leaf][0]) == before
    sizes = [len(found) for found, _ in words]
    return Codebook(
        tree=tree,
        codewords=np.concatenate([found for found, _ in words]),
        first=np.concatenate([[0], np.cumsum(sizes)]),
        scale=scale,
    )


def _improved(points: Floats, codewords: Floats) -> tuple[Floats, Integers, float]:
    """Return codewords after Lloyd's iteration, the owner of each point, and the distortion."""
    codewords = codewords.copy()
    owners = np.empty(len(points), dtype=np.int64)
    squares = np.empty(len(points))
    before = np.inf
    for _ in range(MOST_ITERATIONS):
        kernels.nearest(points, codewords, owners, squares)
        empty = np.flatnonzero(np.bincount(owners, minlength=len(codewords)) == 0)
        if empty.size:  # one at a time: the furthest point is another one after each
            codewords[empty[0]] = points[int(squares.argmax())]
            continue
        distortion = float(squares.mean())
        if before - distortion <= TOLERANCE * distortion:
            return codewords, owners, distortion
        before = distortion
        kernels.centroids(points, owners, codewords)
    return codewords, owners, float(squares.mean())


def _split(points: Floats, codewords: Floats, owners: Integers, n_codewords: int) -> Floats:
    """Return the codewords with some of them in two: all, or the most distorted if room is short.

    The halves lie along the feature in which the codeword's points vary most.
    """
    n = len(codewords)
    counts = np.bincount(owners, minlength=n)
    spreads = np.empty_like(codewords)
    for j in range(points.shape[1]):
        squares = (points[:, j] - codewords[owners, j]) ** 2
        spreads[:, j] = np.bincount(owners, squares, minlength=n)
    totals = spreads.sum(axis=1)  # [n]
    chosen = np.argsort(-totals, kind="stable")[: n_codewords - n]
    chosen = np.sort(chosen[totals[chosen] > 0.0])
    axes = spreads[chosen].argmax(axis=1)
    offsets = np.zeros((len(chosen), points.shape[1]))
    widths = np.sqrt(spreads[chosen, axes] / counts[chosen])
    offsets[np.arange(len(chosen)), axes] = APART * widths
    halves = codewords.copy()
    halves[chosen] -= offsets
    return np.concatenate([halves, codewords[chosen] + offsets])
