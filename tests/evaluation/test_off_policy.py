"""Which of two trees is believed to be the better, by episodes that neither was fitted to."""

import numpy as np
import pytest

from eutree.data import Episode
from eutree.evaluation import off_policy
from eutree.evaluation.off_policy import FEWEST_HELD_OUT, compare_off_policy, hold_out
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from tests.worlds import ROOM, room_episode

SEEDS = range(6)


def heats_below(threshold):
    tree = DecisionTree.single_leaf(2).split(0, 0, threshold)
    return TreePolicy(tree=tree, actions=np.array([1, 0]), schema=ROOM)


OPERATOR = heats_below(22.0)  # what the log shows, with one action in ten at random


def compared(policy, seed, n_episodes=24):
    generator = np.random.default_rng(seed)
    log = [room_episode(generator, OPERATOR.act, random=0.1) for _ in range(n_episodes)]
    known, held_out = hold_out(log, generator)
    return compare_off_policy(policy, OPERATOR, known, held_out, discount=0.99, generator=generator)


@pytest.mark.parametrize("threshold", [22.5, 25.0])
def test_a_worse_tree_is_not_believed(threshold):
    found = [compared(heats_below(threshold), seed) for seed in SEEDS]
    assert not any(one.believed for one in found)
    assert np.mean([one.gain for one in found]) < 0.0


def test_a_better_tree_is_believed_where_the_log_is_long_enough():
    found = [compared(heats_below(20.5), seed, n_episodes=90) for seed in SEEDS]
    believed = [one for one in found if one.believed]
    assert len(believed) >= 3
    assert "believed to beat fit: return +" in believed[0].describe()


def test_deviations_that_gain_one_by_one_are_not_enough():
    """Never to heat pays at 22 degrees, but ends in the cold, which the world model predicts."""
    found = [compared(heats_below(15.0), seed) for seed in SEEDS]
    assert np.mean([one.gain for one in found]) > 0.0
    assert all(one.predicted < 0.0 for one in found[:3])
    assert sum(one.believed for one in found) <= 1


def test_the_same_tree_gains_nothing():
    found = compared(heats_below(22.0), 0)
    assert (found.gain, found.low, found.predicted, found.believed) == (0.0, 0.0, 0.0, False)
    assert "this is the tree of fit" in found.describe()


def test_too_few_episodes_decide_nothing():
    generator = np.random.default_rng(0)
    log = [room_episode(generator, OPERATOR.act) for _ in range(3 * FEWEST_HELD_OUT - 1)]
    known, held_out = hold_out(log, generator)
    assert (len(known), held_out) == (len(log), ())
    found = compare_off_policy(
        heats_below(20.0), OPERATOR, known, held_out, discount=0.99, generator=generator
    )
    assert not found.believed
    assert found.facts() == {
        "gain": None,
        "low": None,
        "predicted": None,
        "n_held_out": 0,
        "believed": False,
    }
    assert "0 episodes could be held out" in found.describe()


def test_one_deviation_is_estimated_without_bias():
    """One step, two actions of chances 3/4 and 1/4 that earn 1 and 3: the other one gains 2."""
    generator = np.random.default_rng(1)
    one, two = (
        TreePolicy(tree=DecisionTree.single_leaf(1), actions=np.array([a]),
                   schema=Schema.anonymous(1, 2))
        for a in (1, 0)
    )  # fmt: skip

    def episode():
        action = int(generator.random() < 0.25)
        reward = 3.0 if action else 1.0
        return Episode(generator.random((2, 1)), [action], [reward], True, False)

    found = compare_off_policy(
        one,
        two,
        [episode() for _ in range(4000)],
        [episode() for _ in range(4000)],
        discount=1.0,
        generator=generator,
    )
    error = (found.gain - found.low) / 1.645
    assert abs(found.gain - 2.0) < 3 * error
    assert error < 0.1


def test_held_out_episodes_are_a_third_and_nothing_is_in_both():
    log = [room_episode(np.random.default_rng(k), OPERATOR.act, steps=2) for k in range(20)]
    known, held_out = hold_out(log, np.random.default_rng(3))
    assert (len(known), len(held_out)) == (14, 6)
    assert {id(e) for e in known} | {id(e) for e in held_out} == {id(e) for e in log}
    assert pytest.approx(1 / 3) == off_policy.HELD_OUT
