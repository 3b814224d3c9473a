"""Trees to begin from again imitate the episodes that earned most, and no others."""

import numpy as np
import pytest

from eutree.policy_search.climbing import restarts
from eutree.world_model import Transitions
from eutree.world_model.action_trees import n_leaves, nested


def two_actors(n_episodes, seed):
    """Every other episode pushes a ball to the middle and earns; the others push it away."""
    generator = np.random.default_rng(seed)
    rows = []
    for episode in range(n_episodes):
        place = generator.uniform(-2, 2)
        for _ in range(20):
            action = int(place < 0.0) ^ episode % 2
            there = float(np.clip(place + 0.2 * (2 * action - 1), -2, 2))
            rows.append(([place], action, -abs(there), [there], episode))
            place = there
    o, a, r, later, episodes = (np.array(c, dtype=float) for c in zip(*rows, strict=True))
    return Transitions(o, a.astype(int), r, later, np.zeros(len(r), bool), episodes.astype(int), 2)


@pytest.mark.parametrize("seed", range(3))
def test_they_do_what_the_better_actor_did(seed):
    trees = list(restarts(two_actors(60, seed), max_leaves=8))
    assert len(trees) == 4
    for tree in trees:
        feature, threshold, below, above = nested(tree)
        assert (feature, below, above) == (0, 1, 0)
        assert abs(threshold) < 0.2


def test_they_are_as_small_as_asked_for():
    """Actions at random can be told apart by many leaves alone."""
    data = two_actors(60, 0)
    noisy = np.random.default_rng(0).integers(2, size=data.actions.size)
    data = Transitions(
        data.observations, noisy, data.rewards, data.next_observations, data.terminated,
        data.episodes, 2,
    )  # fmt: skip
    assert all(n_leaves(tree) <= 5 for tree in restarts(data, max_leaves=5))


def test_where_all_earn_the_same_the_best_are_all():
    data = two_actors(8, 0)
    data = Transitions(
        data.observations, data.actions, 0.0 * data.rewards, data.next_observations,
        data.terminated, data.episodes, 2,
    )  # fmt: skip
    assert len(list(restarts(data, max_leaves=5))) == 1
