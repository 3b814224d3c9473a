"""A guard against losing the speed of the search; the figures come from benchmarks/splitting.py."""

import time

import numpy as np
import pytest

from eutree import compiled
from eutree.splitting import best_split


@pytest.mark.skipif(not compiled.ENABLED, reason="there is no speed without compilation")
@pytest.mark.parametrize("score", ["scaled", "distance"])
def test_a_split_costs_less_than_that_of_a_regression_tree(score):
    """Measured: about 0.3; the median of pairs must stay below 0.9 on a busy machine too."""
    tree = pytest.importorskip("sklearn.tree")
    best_split(np.arange(40.0)[:, None], np.arange(40.0))
    ratios = []
    for seed in range(7):
        generator = np.random.default_rng(seed)
        x, q = generator.normal(size=(20_000, 4)), generator.normal(size=20_000)
        start = time.thread_time()
        tree.DecisionTreeRegressor(max_depth=1).fit(x, q)
        middle = time.thread_time()
        best_split(x, q, score=score)
        ratios.append((time.thread_time() - middle) / (middle - start))
    assert np.median(ratios) < 0.9
