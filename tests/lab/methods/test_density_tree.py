"""The kd-tree by density cuts where there is much, and never looks at returns."""

import numpy as np
import pytest

from eutree.learners.u_tree import UTree
from eutree.splitting import LeafSample
from eutree_lab.density_tree import DensityTreeMethod
from tests.worlds import learned_to_walk


def sample_of(rows, returns=None):
    n = len(rows)
    returns = np.zeros(n) if returns is None else returns
    return LeafSample(rows, returns, np.zeros(n, dtype=np.int64))


@pytest.mark.parametrize("seed", range(5))
def test_a_full_leaf_is_halved_at_its_median_whatever_was_earned(seed):
    generator = np.random.default_rng(seed)
    rows = np.column_stack([generator.normal(size=201), generator.integers(3, size=201)])
    method = DensityTreeMethod(max_density=200)
    split = method.cut(sample_of(rows, generator.normal(size=201)), generator)
    assert (split.feature, split.n_left, split.n_right) == (0, 100, 101)
    assert split == method.cut(sample_of(rows), generator)
    again = method.cut(sample_of(rows * 8.0), generator)
    assert again.threshold == split.threshold * 8.0


def test_what_holds_little_or_cannot_be_told_apart_is_not_cut():
    method = DensityTreeMethod(max_density=5)
    generator = np.random.default_rng(0)
    assert method.cut(sample_of(np.arange(5.0)[:, None]), generator) is None
    assert method.cut(sample_of(np.ones((50, 2))), generator) is None
    mostly_one = np.array([0.0] * 1 + [1.0] * 20)[:, None]
    assert method.cut(sample_of(mostly_one), generator).n_left == 1


def test_no_leaf_is_left_with_more_after_enough_updates():
    learner = learned_to_walk(DensityTreeMethod(max_density=40), phases=6)
    assert isinstance(learner, UTree)
    for _ in range(8):
        learner.update(np.random.default_rng(0))
    assert learner.history.leaving.counts[: learner.tree.n_leaves].max() <= 40
    assert learner.tree.n_leaves >= learner.history.size / 40
