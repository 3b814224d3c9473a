"""A grafted tree decides by one tree in the kept leaves and by the other elsewhere."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.trees.edit import graft
from tests import naive_trees


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32), n_features=st.integers(1, 3))
def test_each_point_is_decided_by_the_tree_it_belongs_to(seed, n_features):
    generator = np.random.default_rng(seed)
    trees = [
        naive_trees.random_tree(generator, int(generator.integers(1, 12)), n_features)
        for _ in range(2)
    ]
    stock, scion = trees
    labels = generator.integers(0, 3, scion.n_leaves)
    chosen = generator.permutation(stock.n_leaves)[: int(generator.integers(1, 4))]
    kept = {int(leaf): 7 + int(leaf) for leaf in chosen}
    tree, answers, marked = graft(stock, kept, scion, labels)
    lattice = np.concatenate([np.arange(-1, 7), np.arange(-1, 7) + 0.5, [np.nan, np.inf, -np.inf]])
    points = generator.choice(lattice, (300, n_features))
    expected = [
        kept.get(leaf, int(labels[other]))
        for leaf, other in zip(
            stock.leaf_index(points).tolist(), scion.leaf_index(points).tolist(), strict=True
        )
    ]
    leaves = tree.leaf_index(points)
    assert answers[leaves].tolist() == expected
    assert {leaf for leaf in range(tree.n_leaves) if answers[leaf] >= 7} == set(marked)
