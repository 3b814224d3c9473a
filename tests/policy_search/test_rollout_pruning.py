"""Pruning by imagined returns, and whether a model orders trees."""

import numpy as np
import pytest
from scipy import stats

from eutree.policy_search.model_trust import rank_correlation, ranks
from eutree.world_model import Transitions
from eutree.world_model.action_trees import n_leaves, nested, packed
from eutree.world_model.ensemble import EnsembleSettings, fit_ensemble
from eutree.world_model.ensemble_rollouts import EnsembleRollouts, pruned_by_rollouts


def slopes(n_episodes, seed):
    """A ball between walls at -2 and 2, pushed left or right; it earns by being near the middle."""
    generator = np.random.default_rng(seed)
    rows = []
    for episode in range(n_episodes):
        place = generator.uniform(-1, 1)
        for step in range(20):
            action = int(generator.integers(2))
            there = float(np.clip(place + 0.4 * (2 * action - 1), -2, 2))
            rows.append(((place, step % 2), action, -abs(there), (there, 1 - step % 2), episode))
            place = there
    o, a, r, later, episodes = (np.array(c, dtype=float) for c in zip(*rows, strict=True))
    ended = np.zeros(len(r), bool)
    return Transitions(o, a.astype(int), r, later, ended, episodes.astype(int), 2)


@pytest.fixture(scope="module")
def ensemble():
    settings = EnsembleSettings(members=2, hidden=24, batch=64, updates=800, rate=3e-3)
    return fit_ensemble(slopes(150, 0), settings, np.random.default_rng(1))


# Only the first test matters; the others split hairs where the action makes little difference.
LARGE = packed(
    (0, 0.0, (1, 0.5, 1, (0, -1.9, 0, 1)), (1, 0.5, (0, 1.8, 0, 1), (0, 0.05, 1, (0, 1.7, 0, 1))))
)


@pytest.mark.parametrize("seed", range(5))
def test_pruning_keeps_what_earns(ensemble, seed):
    """The tree of two leaves that is left is the one that pushes to the middle."""
    generator = np.random.default_rng(seed)
    rollouts = EnsembleRollouts(ensemble, 20, generator)
    pruned, score = pruned_by_rollouts(LARGE, rollouts, 2, generator)
    feature, threshold, below, above = nested(pruned)
    assert (feature, below, above) == (0, 1, 0)
    assert abs(threshold) < 0.1
    assert score == pytest.approx(rollouts.score(rollouts.returns))


def test_a_tree_that_is_small_enough_stays(ensemble):
    generator = np.random.default_rng(0)
    rollouts = EnsembleRollouts(ensemble, 5, generator)
    pruned, _ = pruned_by_rollouts(LARGE, rollouts, 20, generator)
    assert nested(pruned) == nested(LARGE)


def test_the_limit_is_kept_by_as_few_cuts_as_possible(ensemble):
    generator = np.random.default_rng(0)
    rollouts = EnsembleRollouts(ensemble, 10, generator)
    pruned, _ = pruned_by_rollouts(LARGE, rollouts, 5, generator)
    assert 2 <= n_leaves(pruned) <= 5


@pytest.mark.parametrize("seed", range(5))
def test_rank_correlation_is_spearmans(seed):
    generator = np.random.default_rng(seed)
    real = generator.integers(0, 6, 15).astype(float)  # with ties
    imagined = real + 2.0 * generator.standard_normal(15)
    found = rank_correlation(imagined, real)
    assert found.value == pytest.approx(stats.spearmanr(imagined, real).statistic)
    assert found.low < found.value < found.high
    assert ranks(real).tolist() == stats.rankdata(real).tolist()


def test_the_interval_of_a_rank_correlation_covers_it():
    """Of 300 samples of 20 pairs about one in twenty misses; three standard errors are 4 points."""
    generator = np.random.default_rng(0)
    rho = 0.6
    # Spearman's correlation of a normal pair with Pearson's rho (Kruskal 1958).
    exact = 6.0 / np.pi * np.arcsin(rho / 2.0)
    covered = 0
    for _ in range(300):
        x = generator.standard_normal(20)
        y = rho * x + np.sqrt(1 - rho**2) * generator.standard_normal(20)
        found = rank_correlation(x, y)
        covered += found.low <= exact <= found.high
    assert covered / 300 == pytest.approx(0.95, abs=0.04)


@pytest.mark.parametrize("n", [5, 6, 7, 8])
@pytest.mark.parametrize("truth", [-0.95, 0.0, 0.8, 0.95])
def test_the_interval_covers_where_few_trees_are_in_perfect_order(n, truth):
    """Of a true 0.95 it covered 60 % at n = 5, 89 % at n = 8: a perfect order was [1, 1]."""
    generator, runs = np.random.default_rng(n), 1000
    rho = 2.0 * np.sin(np.pi * truth / 6.0)  # Pearson's, of a normal pair (Kruskal 1958)
    covered = 0
    for _ in range(runs):
        x = generator.standard_normal(n)
        y = rho * x + np.sqrt(1.0 - rho**2) * generator.standard_normal(n)
        found = rank_correlation(x, y)
        covered += found.low <= truth <= found.high
    error = np.sqrt(0.93 * 0.07 / runs)
    assert covered / runs >= 0.93 - 2 * error


def test_a_perfect_order_of_five_is_not_a_perfect_model():
    found = rank_correlation(np.arange(5.0), np.arange(5.0) ** 3)
    assert (found.value, found.high) == (1.0, 1.0)
    assert found.low == pytest.approx(0.134, abs=0.001)
    assert found.better_than_chance  # by luck once in 120 times
    turned = rank_correlation(np.arange(5.0), -np.arange(5.0))
    assert (turned.value, turned.low, turned.high) == (-1.0, -1.0, -found.low)
    assert turned.worse_than_chance


def test_too_few_trees_say_nothing():
    found = rank_correlation(np.array([1.0, 2.0]), np.array([1.0, 2.0]))
    assert np.isnan(found.value)
    assert not found.better_than_chance
    equal = rank_correlation(np.ones(9), np.arange(9.0))
    assert not equal.better_than_chance
