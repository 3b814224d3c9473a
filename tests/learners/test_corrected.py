"""The corrected Continuous U-Tree: its tests keep their level, and still find what is there."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.learners import CORRECTED, PRESETS, Problem, Start
from eutree.schema import Schema
from eutree.splitting import Maximal, Naive, Permutation
from tests.worlds import FEW_DRAWS, clustered_noise, learned_to_walk

LEVEL, RUNS = 0.05, 40
NOISE = Problem(Schema.anonymous(3, 2))


def share_of_false_splits(significance, runs=RUNS):
    """Return the share of logs of noise on which the first update splits the only leaf."""
    method = replace(CORRECTED, significance=significance)
    split = 0
    for seed in range(runs):
        generator = np.random.default_rng(seed)
        learner = method.start(NOISE, Start(episodes=clustered_noise(generator)))
        split += bool(learner.update(generator).splits)
    return split / runs


def test_its_test_keeps_its_level_where_returns_are_clustered():
    """Learning from a log split on 51 to 100 % of noise at a nominal 1 %."""
    error = np.sqrt(LEVEL * (1 - LEVEL) / RUNS)
    test = Permutation(alpha=LEVEL, n_permutations=99, by_episode=True)
    assert share_of_false_splits(test) <= LEVEL + 3 * error


@pytest.mark.parametrize(
    "significance", [Naive(), Maximal(), Permutation(n_permutations=99)], ids=repr
)
def test_tests_that_take_steps_for_independent_do_not(significance):
    """The control: at a level of 1 % they split on a third of it and more."""
    assert share_of_false_splits(significance, runs=20) >= 0.3


def test_it_owns_the_permutation_test_by_episode():
    assert PRESETS["corrected"] is CORRECTED
    assert CORRECTED.significance == Permutation(alpha=0.01, by_episode=True)


def test_it_finds_what_is_there():
    """Episodes of one length, in which time tells the place: rotation, not order, shows it."""
    sizes = [learned_to_walk(FEW_DRAWS, seed, phases=4).tree.n_leaves for seed in range(5)]
    assert np.mean(sizes) > 2
