"""Climbing in a world model moves thresholds together, and pays for leaves."""

import numpy as np
import pytest

from eutree.policy_search.climbing import annealed, climbed
from eutree.policy_search.variation import Variation
from eutree.world_model import PairedRollouts, Transitions, fit_world_models
from eutree.world_model.action_trees import n_leaves, nested, packed


def ball(n_episodes, seed):
    """A ball between walls, pushed left or right; it earns by being between 0.5 and 0.9."""
    generator = np.random.default_rng(seed)
    rows = []
    for episode in range(n_episodes):
        place = generator.uniform(-2, 2)
        for _ in range(20):
            action = int(generator.integers(2))
            there = float(np.clip(place + 0.2 * (2 * action - 1), -2, 2))
            rows.append(([place], action, -abs(there - 0.7), [there], episode))
            place = there
    o, a, r, later, episodes = (np.array(c, dtype=float) for c in zip(*rows, strict=True))
    return Transitions(o, a.astype(int), r, later, np.zeros(len(r), bool), episodes.astype(int), 2)


@pytest.fixture(scope="module")
def model():
    return fit_world_models(ball(100, 0), [0.5])[0].without_noise()


def climb(model, tree, price, seed):
    generator = np.random.default_rng(seed)
    rollouts = PairedRollouts(model, 100, 1.0, generator)
    return climbed(rollouts, tree, Variation(2, 4, generator), price=price), rollouts


@pytest.mark.parametrize("seed", range(3))
def test_the_threshold_goes_to_the_middle(model, seed):
    tree, rollouts = climb(model, packed((0, -1.5, 1, 0)), 0.5, seed)
    feature, threshold, below, above = nested(tree)
    assert (feature, below, above) == (0, 1, 0)
    assert abs(threshold - 0.7) < 0.15
    rollouts.run(packed((0, 0.7, 1, 0)))
    assert rollouts.gain(tree).mean > -0.1


def test_leaves_that_earn_nothing_go(model):
    useless = packed((0, 0.7, (0, -1.99, 0, 1), (0, 1.99, 0, 1)))
    tree, _ = climb(model, useless, 0.5, 0)
    assert n_leaves(tree) == 2


@pytest.mark.parametrize("seed", range(3))
def test_annealing_leaves_a_tree_that_no_single_change_improves(model, seed):
    """All actions are wrong: a label turned alone loses, and so does no other change of it."""
    generator = np.random.default_rng(seed)
    rollouts = PairedRollouts(model, 100, 1.0, generator)
    variation = Variation(2, 4, generator)
    tree = annealed(rollouts, packed((0, 0.7, 0, 1)), variation, price=0.2, scale=20.0)
    rollouts.redraw()
    rollouts.run(packed((0, 0.7, 1, 0)))
    assert rollouts.gain(tree).mean > -0.5
