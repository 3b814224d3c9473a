"""Climbing in a world model moves thresholds together, pays for leaves, and mixes trees."""

import numpy as np
import pytest

from eutree.policy_search.climbing import annealed, annealed_together, climbed
from eutree.policy_search.improvement import Improvement
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


def two_goals(n_episodes, seed):
    """A ball as above; where it has to be, -1 or 1, is told by its second number."""
    generator = np.random.default_rng(seed)
    rows = []
    for episode in range(n_episodes):
        place, goal = generator.uniform(-2, 2), float(generator.choice((-1, 1)))
        for _ in range(20):
            action = int(generator.integers(2))
            there = float(np.clip(place + 0.2 * (2 * action - 1), -2, 2))
            rows.append(([place, goal], action, -abs(there - goal), [there, goal], episode))
            place = there
    o, a, r, later, episodes = (np.array(c, dtype=float) for c in zip(*rows, strict=True))
    return Transitions(o, a.astype(int), r, later, np.zeros(len(r), bool), episodes.astype(int), 2)


LEFT, RIGHT = (0, -1.0, 1, 0), (0, 1.0, 1, 0)  # what to do for either goal
FAR_LEFT, FAR_RIGHT = (0, -1.5, 0, (0, -1.2, 1, 0)), (0, 1.2, 1, (0, 1.5, 0, 1))


@pytest.mark.parametrize("seed", range(3))
def test_trees_annealed_together_are_cut_to_size_and_earn_more_than_trees_that_are_cut(seed):
    """Each of two knows what to do for one goal, and no tree that is cut from them knows both."""
    model = fit_world_models(two_goals(150, 0), [0.5])[0].without_noise()
    generator, size = np.random.default_rng(seed), Improvement(max_leaves=4)
    herd = [PairedRollouts(model, 100, 1.0, generator) for _ in range(8)]
    cut = PairedRollouts(model, 100, 1.0, generator)
    for k, one in enumerate(herd):
        one.run(packed((1, 0.0, *((LEFT, FAR_LEFT), (FAR_RIGHT, RIGHT))[k % 2])))
    alone = []
    for one in herd[:2]:
        cut.run(one.policy)
        size.cut(cut)
        alone.append(cut.policy)
    found = annealed_together(herd, size, scale=20.0, changes=200)
    assert all(n_leaves(tree) <= 4 for tree in found)
    cut.run(packed((1, 0.0, LEFT, RIGHT)))
    lost = [[-cut.gain(tree).mean for tree in trees] for trees in (found, alone)]
    assert min(lost[0]) < 0.5 < 2.0 < min(lost[1])


def test_a_variant_takes_over_a_branch_of_its_mate_now_and_then():
    tree, mate = packed((0, 0.0, 0, 1)), packed((0, 5.5, 1, (1, 7.5, 0, 1)))
    variation = Variation(2, 4, np.random.default_rng(0))
    visited = np.random.default_rng(1).uniform(-1, 1, (50, 2))
    alone = [variation.of(tree, visited) for _ in range(300)]
    mated = [variation.of(tree, visited, mate) for _ in range(300)]

    def taken(variants):
        return sum(7.5 in variant.threshold for variant in variants if variant is not None)

    assert taken(alone) == 0
    assert 3 <= taken(mated) <= 30  # of the 10 % with a branch, two in five have that test
