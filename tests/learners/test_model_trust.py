"""What is said of a world model whose order of trees was compared with their real returns."""

import numpy as np

from eutree.policy_search.model_trust import ModelTrust


def trust(real):
    real = np.array(real, dtype=float)
    return ModelTrust(np.arange(float(real.size)), real, np.full(real.size, 20))


def test_five_trees_in_perfect_order_are_no_perfect_model():
    assert "rank correlation 1.00 [0.13, 1.00]" in trust([1, 2, 3, 4, 5]).describe()
    assert trust([1, 2, 3, 4, 5]).better_than_chance


def test_an_order_that_is_turned_round_is_worse_than_chance():
    """An interval wholly below zero was called no better than chance."""
    turned = trust([7, 6, 5, 4, 3, 2, 1])
    assert not turned.better_than_chance
    assert "worse than chance; only trees that were clearly better" in turned.describe()
    assert "no better than chance" in trust([2, 5, 1, 4, 3]).describe()
