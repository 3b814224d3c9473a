"""Trees cut to a limit of leaves in imagination, and model trees that predict."""

import numpy as np

from eutree.policy_search.improvement import CYCLES, Improvement
from eutree.world_model.action_trees import n_leaves, packed
from eutree.world_model.dynamics import fit_model_tree
from tests.world_model.walks import GO, STAY, mean_return, rollouts_of, walks

# Waits before the pit while it is open; all other tests do harm or nothing.
WAITS = (0, 3.1, (0, 1.0, GO, (1, 0.9, GO, STAY)), (0, 4.9, (1, 0.0, STAY, GO), GO))


def test_a_tree_is_cut_where_that_costs_least():
    data = walks(400, 0)
    tree = packed(WAITS)
    small = Improvement(max_leaves=4, deviations=500)
    found = list(small.shrunk(rollouts_of(data), tree, 100.0))
    assert len(found) == CYCLES
    for cut in found:
        assert n_leaves(tree) > 4 >= n_leaves(cut) > 1
        assert mean_return(cut) >= mean_return(tree) - 1.0


def test_leaves_move_to_where_they_earn_most():
    """What is left of a tree by cutting alone need not be where leaves earn; growing mends it."""
    data = walks(400, 0)
    # Three tests that split hairs above the one that matters, which cutting alone keeps last.
    tree = packed((0, 4.0, (0, 3.9, (0, 3.8, GO, STAY), GO), (1, 0.5, GO, GO)))
    first, *_, last = Improvement(max_leaves=3, deviations=500).shrunk(
        rollouts_of(data), tree, 100.0
    )
    assert n_leaves(last) <= 3
    assert mean_return(last) >= mean_return(first)


def test_a_model_tree_predicts_within_what_its_leaves_have_seen():
    X = np.random.default_rng(0).random((2000, 2))
    y = np.where(X[:, 0] < 0.5, 3.0 * X[:, 1], 1.0 - X[:, 0])
    tree = fit_model_tree(X, y, max_leaves=8, min_leaf=10)
    assert np.abs(tree.predict(X) - y).mean() < 0.05
    assert tree.predict(np.array([[0.2, 100.0]])).max() <= 3.0 + 1e-9
