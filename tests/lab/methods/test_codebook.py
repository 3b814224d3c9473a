"""The generalized Lloyd algorithm against its definition, Max's table, and trees."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.trees import DecisionTree
from eutree_lab.vqql import _kernels as kernels
from eutree_lab.vqql.codebook import Codebook, codebook_in_leaves, generalized_lloyd

# J. Max, "Quantizing for minimum distortion" (1960): mean squared error of the best quantizer of a
# standard normal number with N levels.
MAX_1960 = {1: 1.0, 2: 0.3634, 4: 0.1175, 8: 0.03454, 16: 0.009497}


@pytest.mark.parametrize("n_codewords", MAX_1960)
def test_the_distortion_of_a_normal_source_is_that_of_max(n_codewords):
    # Quantiles in place of draws: no sampling error, so 2 % is about the algorithm.
    from scipy.stats import norm

    points = norm.ppf((np.arange(40_000) + 0.5) / 40_000)[:, np.newaxis]
    codewords, distortion = generalized_lloyd(points, n_codewords)
    assert len(codewords) == n_codewords
    assert distortion == pytest.approx(MAX_1960[n_codewords], rel=0.02)


def naive_owners(points, codewords):
    return ((points[:, None] - codewords[None]) ** 2).sum(axis=-1).argmin(axis=1)


@given(st.integers(1, 60), st.integers(1, 4), st.integers(1, 12), st.integers(0, 999))
def test_owners_and_means_are_those_of_the_definition(n, d, n_codewords, seed):
    generator = np.random.default_rng(seed)
    points = np.round(generator.normal(size=(n, d)), 1)  # with ties
    codewords, distortion = generalized_lloyd(points, n_codewords)
    owners, squares = np.empty(n, dtype=np.int64), np.empty(n)
    kernels.nearest(points, codewords, owners, squares)
    np.testing.assert_array_equal(owners, naive_owners(points, codewords))
    assert distortion == pytest.approx(((points - codewords[owners]) ** 2).sum(axis=1).mean())
    distinct = len(np.unique(points, axis=0))
    assert len(codewords) == min(n_codewords, distinct)
    assert np.unique(owners).size == len(codewords)  # none is empty
    if len(codewords) == 1:
        np.testing.assert_allclose(codewords[0], points.mean(axis=0), atol=1e-12)
    if n_codewords >= distinct:
        assert distortion == pytest.approx(0.0, abs=1e-25)


def test_more_codewords_never_distort_more_and_scales_change_nothing():
    generator = np.random.default_rng(3)
    points = generator.normal(size=(2_000, 3)) * [1.0, 5.0, 0.2]
    distortions = [generalized_lloyd(points, n)[1] for n in (1, 2, 3, 5, 8, 13, 21)]
    assert distortions == sorted(distortions, reverse=True)
    codewords, distortion = generalized_lloyd(points, 21)
    twice, fourfold = generalized_lloyd(points * 2.0, 21)
    np.testing.assert_array_equal(twice, codewords * 2.0)
    assert fourfold == distortion * 4.0


def test_the_order_of_the_points_matters_only_by_rounding():
    generator = np.random.default_rng(4)
    points = generator.normal(size=(500, 2))
    one, first = generalized_lloyd(points, 16)
    other, second = generalized_lloyd(points[generator.permutation(500)], 16)
    assert first == pytest.approx(second, rel=1e-9)
    np.testing.assert_allclose(one, other, atol=1e-9)


def quarters():
    tree = DecisionTree.single_leaf(2).split(leaf=0, feature=0, threshold=0.0)
    return tree.split(leaf=1, feature=1, threshold=0.5)


def test_no_region_reaches_across_a_cut_of_the_tree():
    generator = np.random.default_rng(5)
    tree, rows = quarters(), generator.normal(size=(3_000, 2))
    book = codebook_in_leaves(tree, rows, 24, scale=np.array([1.0, 2.0]))
    assert book.n_regions == 24
    regions = book.regions(rows)
    np.testing.assert_array_equal(book.leaf[regions], tree.leaf_index(rows))
    for leaf in range(3):  # and inside a leaf the nearest codeword is the region
        inside = tree.leaf_index(rows) == leaf
        own = np.flatnonzero(book.leaf == leaf)
        wanted = own[naive_owners(rows[inside] / book.scale, book.codewords[own])]
        np.testing.assert_array_equal(regions[inside], wanted)
    assert (book.distances(rows) >= 0.0).all()
    np.testing.assert_allclose(book.distances(book.codewords[:1] * book.scale), 0.0, atol=1e-12)


def test_one_codeword_in_each_leaf_is_the_tree_itself():
    tree, rows = quarters(), np.random.default_rng(6).normal(size=(200, 2))
    book = codebook_in_leaves(tree, rows, 3, scale=np.ones(2))
    np.testing.assert_array_equal(book.regions(rows), tree.leaf_index(rows))


def test_leaves_without_observations_and_constant_ones_keep_one_codeword():
    tree = quarters()
    rows = np.full((50, 2), -1.0)  # all in leaf 0, all the same
    book = codebook_in_leaves(tree, rows, 10, scale=np.ones(2))
    assert isinstance(book, Codebook)
    assert book.n_regions == 3
    np.testing.assert_array_equal(book.regions(np.array([[9.0, 9.0], [9.0, -9.0]])), [2, 1])
