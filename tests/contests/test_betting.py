"""Bounds by betting hold at every look, however rare a loss is."""

import numpy as np
import pytest

from eutree.compression.episodes import Demand
from eutree.contests import SmallestWithin, hold, new_table
from eutree.contests.betting import episodes_needed, log_wealth, lower_bound, tuned_stake
from eutree.contests.table import bounds_of_change

LOSS = 100.0


def accepted(p, margin, episodes, runs, noise=0.0, known=(-LOSS, 0.0)):
    """Return how often a tree that loses LOSS with chance p is taken for the input."""
    generator = np.random.default_rng(7)
    rule = SmallestWithin(sizes=(2, 1), margin=margin, episodes=episodes, known=known)
    taken = 0
    for _ in range(runs):
        inputs = noise * generator.random(rule.most)

        def run(tree, starts, inputs=inputs):
            return inputs[starts] - tree * LOSS * (generator.random(len(starts)) < p)

        taken += hold(rule, new_table(2, rule.most), run).winner
    return taken


@pytest.mark.parametrize(
    ("p", "margin", "episodes"),
    [
        (1e-4, 0.009, 200),
        (5e-4, 0.04, 1000),  # Student's interval took it in 60 % of the contests
        (5e-3, 0.25, 200),  # and here in 30 %
        (5e-3, 0.45, 1000),
        (2e-2, 1.9, 1000),
        (1e-1, 9.5, 200),
    ],
)
def test_a_tree_worse_than_the_margin_by_rare_failures_is_seldom_taken(p, margin, episodes):
    """The promise is an error of 0.05 at most, at every chance of the failure."""
    assert p * LOSS > margin
    # More than 9 of 80 has a chance of 1 % at a rate of 0.05.
    assert accepted(p, margin, episodes, 80) <= 9


def test_where_the_range_is_not_known_losses_within_the_blind_width_are_covered():
    assert Demand(margin=1.0, error=0.05, episodes=1000).blind_width > LOSS
    assert accepted(0.015, 1.0, 1000, 40, noise=10.0, known=None) <= 6


def test_equal_returns_show_nothing_of_losses_where_the_range_is_not_known():
    assert accepted(0.0, 0.0, 100, 5, known=None) == 0


@pytest.mark.parametrize("p", [0.0, 1e-4, 1e-3])
def test_the_contest_is_not_needlessly_strict(p):
    assert accepted(p, 2.0, 1000, 20) >= 18


def test_too_few_episodes_for_any_tree_are_counted():
    assert episodes_needed(2.0, -270.0, 0.025) == pytest.approx(270 / 2 * np.log(80), rel=0.01)
    assert episodes_needed(2.0, -1.0, 0.025) == 0
    assert episodes_needed(1.0, -LOSS, 0.025) > 400
    assert accepted(0.0, 1.0, 400, 3) == 0


@pytest.mark.parametrize("share", [0.002, 0.05, 0.5])
def test_the_lower_bound_holds_at_every_look(share):
    """Naive twin: all looks after each value; a bound above the mean at any of them is an error."""
    generator = np.random.default_rng(3)
    mean, wrong, runs = 1.0 - share, 0, 60
    for _ in range(runs):
        values = (generator.random(120) >= share).astype(float)
        wealth = [log_wealth(values[:n], mean, 0.0) for n in range(1, 121)]
        wrong += max(wealth) >= -np.log(0.1)
    assert wrong <= 13  # more has a chance of 1 % at a rate of a tenth


def test_the_lower_bound_of_equal_values_is_the_rule_of_three():
    values = np.zeros(1000)
    low = lower_bound(values, -100.0, 0.05)
    assert -100 * 3 / 1000 * 2.2 < low < -100 * 3 / 1000
    tuned = tuned_stake(values, -0.5, -100.0)[0]
    assert low < lower_bound(values, -100.0, 0.05, tuned) < -100 * 3 / 1000


def test_the_lower_bound_is_the_mean_that_wealth_just_rules_out():
    values = np.random.default_rng(0).random(200)
    low = lower_bound(values, 0.0, 0.05)
    assert 0.35 < low < values.mean()
    assert log_wealth(values, low, 0.0) == pytest.approx(-np.log(0.05), abs=1e-6)
    assert lower_bound(np.zeros(0), -1.0, 0.05) == -1.0


def test_a_range_that_was_seen_to_be_wrong_is_not_known():
    """Returns of 9 to 20 in a "known" range of 0 to 5: the condition was left out."""
    table = np.array([[9.0, 12.0, 11.0], [15.0, 20.0, 14.0]])
    assert bounds_of_change(table, known=(0.0, 25.0)).condition() == ""
    assert bounds_of_change(table, known=(9.0, 20.0 - 1e-9)).condition() == ""
    said = bounds_of_change(table, known=(0.0, 5.0)).condition()
    assert said.startswith("if no episode returns less than 0 or more than 20")
