"""Variants: within their limits, all kinds; advantages tell which of two ways gained more."""

import numpy as np

from eutree.policy_search.variation import Variation
from eutree.training.proposals import LAMBDA, Advantages, _add_what_follows
from eutree.world_model import Transitions
from eutree.world_model.action_trees import n_leaves, packed

TREE = packed((0, 0.5, 0, (1, 0.3, 1, 2)))


def test_variants_differ_and_keep_the_limit_of_leaves():
    visited = np.random.default_rng(0).random((200, 2))
    variation = Variation(3, 4, np.random.default_rng(1))
    made = [variation.of(TREE, visited) for _ in range(300)]
    kept = [tree for tree in made if tree is not None]
    assert {n_leaves(tree) for tree in kept} == {2, 3, 4}
    assert len({(*tree.feature, *tree.threshold, *tree.action) for tree in kept}) > 100
    variation = Variation(3, 4, np.random.default_rng(1))
    again = [tree for tree in (variation.of(TREE, visited) for _ in range(300)) if tree is not None]
    assert all(np.array_equal(*pair) for pair in zip(again[-1], kept[-1], strict=True))


def test_a_variant_that_comes_out_too_large_or_too_small_is_none():
    visited, stump = np.random.default_rng(0).random((200, 2)), packed((0, 0.5, 0, 1))

    def sizes(visited, most):
        variation = Variation(2, most, np.random.default_rng(1))
        made = [variation.of(stump, visited) for _ in range(300)]
        return {0 if tree is None else n_leaves(tree) for tree in made}

    assert sizes(visited, 2) == {0, 2}
    assert sizes(visited, 3) == {0, 2, 3}
    # Where all that was visited is one place, no box can be cut: nothing grows, a leaf can go.
    assert sizes(np.zeros((5, 2)), 9) == {0, 2}


def test_gains_add_up_what_follows_within_an_episode():
    gains = np.array([1.0, 2.0, 3.0, 4.0])
    _add_what_follows(gains, np.array([False, True, False, True]))
    assert np.allclose(gains, [1 + LAMBDA * 2, 2, 3 + LAMBDA * 4, 4])


def test_recorded_steps_speak_for_the_action_that_gained_more():
    rng = np.random.default_rng(2)
    n = 4000
    place, action = rng.random((n, 1)), rng.integers(0, 2, n)
    # Single steps: action 1 pays where the place is above 0.6, else action 0 does.
    reward = np.where((place[:, 0] > 0.6) == (action == 1), 1.0, 0.0) + rng.normal(0, 0.3, n)
    data = Transitions(place, action, reward, place, np.ones(n, dtype=bool), np.arange(n), 2)
    known = Advantages.of(data, rng)
    never, right, wrong = np.zeros(n, int), known.observations[:, 0] > 0.6, place[:, 0] < -1
    assert known.speak_for(never, right.astype(int)) > 5
    assert known.speak_for(right.astype(int), never) < -5
    assert known.speak_for(never, wrong.astype(int)) == 0.0
