"""Contests of made-up returns: the episodes they ask for, and how often they are wrong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.contests import (
    Better,
    Halving,
    NextEpisodes,
    NotWorse,
    SmallestWithin,
    Verdict,
    bounds_of_change,
    hold,
    missing,
    new_table,
)
from eutree.contests.betting import log_wealth, log_wealth_path
from tests import naive_contests as naive
from tests.contests.following import follow, seeds, world


@settings(max_examples=25, deadline=None)
@given(
    seed=seeds,
    margin=st.sampled_from([0.0, 0.5]),
    known=st.sampled_from([None, (-9.0, 9.0)]),
    step=st.sampled_from([1e-6, 1.0]),
    most=st.sampled_from([7, 60, 150]),
)
def test_better_and_not_worse_say_what_their_twin_says(seed, margin, known, step, most):
    rule = NotWorse(margin=margin, most=most, known=known, blind=40)
    if margin == 0.0:
        rule = Better(most=most, known=known, blind=40)

    def twin(table):
        return naive.not_worse(table, margin=margin, error=0.05, most=most, known=known, blind=40)

    follow(rule, twin, 2, world(seed, 2, 0.7, step))


@settings(max_examples=25, deadline=None)
@given(
    seed=seeds,
    n_trees=st.integers(1, 9),
    step=st.sampled_from([1e-6, 1.0]),
    guessed=st.booleans(),
)
def test_halving_says_what_its_twin_says(seed, n_trees, step, guessed):
    prices = tuple(0.1 * k for k in range(n_trees))
    guesses = tuple(np.random.default_rng(seed).normal(size=n_trees)) if guessed else ()
    rule = Halving(first=4, most=20, prices=prices, guesses=guesses)

    def twin(table):
        return naive.halving(table, first=4, most=20, prices=prices, guesses=guesses)

    follow(rule, twin, n_trees, world(seed, n_trees, 0.3, step))


def test_a_guess_counts_for_some_episodes_and_is_overruled_by_more():
    """Ahead by 1 in every episode, behind by 3 as guessed: that is 192 episodes' worth."""
    for most, winner in ((64, 0), (256, 1)):
        table = np.zeros((2, most))
        table[1] = 1.0
        rule = Halving(first=most, most=most, guesses=(3.0, 0.0))
        assert rule.next(table).winner == winner


@settings(max_examples=25, deadline=None)
@given(seed=seeds, n_trees=st.integers(1, 6), episodes=st.sampled_from([20, 80]))
def test_the_smallest_near_the_best_is_what_its_twin_says(seed, n_trees, episodes):
    sizes = tuple(int(size) for size in np.random.default_rng(seed).integers(2, 9, n_trees))
    rule = SmallestWithin(sizes=sizes, episodes=episodes)

    def twin(table):
        return naive.smallest_near_best(table, sizes=sizes, episodes=episodes)

    follow(rule, twin, n_trees, world(seed, n_trees, 0.1, 1e-6))


def test_a_choice_is_the_smallest_near_the_best():
    luck = np.resize([-10.0, 10.0], 100)  # a standard error of 1
    table = np.stack([luck + mean for mean in (5.0, 4.5, 4.2, 0.0)])
    assert SmallestWithin(sizes=(20, 12, 9, 2), episodes=100).choice(table) == 2
    assert SmallestWithin(sizes=(2, 12, 9, 20), episodes=100).choice(table) == 0
    with pytest.raises(ValueError, match="100 returns of each tree"):
        SmallestWithin(sizes=(20, 12, 9, 2), episodes=100).choice(table[:, :90] * np.nan)


@settings(max_examples=30, deadline=None)
@given(seed=seeds, n=st.integers(1, 40))
def test_the_wealth_is_that_of_the_twin_after_every_value(seed, n):
    gains = np.random.default_rng(seed).uniform(-3.0, 3.0, n)
    path = log_wealth_path(gains, -0.5, -4.0)
    for k in range(n):
        assert path[k] == pytest.approx(naive.log_wealth(gains[: k + 1].tolist(), -0.5, -4.0))
    assert path[-1] == pytest.approx(log_wealth(gains, -0.5, -4.0))
    one_each = np.array([[-4.0], [-8.0]])
    both = log_wealth_path(np.array([gains, gains]), -0.5, one_each)
    assert np.allclose(both[0], path)


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_a_verdict_that_was_shown_in_a_known_range_stands_whatever_follows(seed):
    rule = Better(most=400, known=(-9.0, 9.0))
    table, draw = new_table(2, 400), world(seed, 2, 1.0, 1e-6)
    verdict = hold(rule, table, draw)
    if not verdict.shown:
        return
    for tree in (0, 1):  # a change for the worse, within what is known of the range
        table[tree] = np.maximum(draw(tree, range(400)) - 3.0 * tree, rule.known[0])
        known = verdict.starts.stop
        table[tree, :known] = draw(tree, range(known))
    assert rule.next(table) == verdict


RULES = {"better": Better(most=300, known=(-60.0, 1.0)), "seen": Better(most=300)}


def wins(rule, draw, n):
    return sum(hold(rule, new_table(2, rule.most), draw(seed)).winner for seed in range(n))


def rare_loss(seed, p=0.02, gain=0.1):
    """Return episodes of which the challenger's earn more, but lose 59 with a small chance."""
    generator = np.random.default_rng(seed)

    def draw(tree, starts):
        returns = np.full(len(starts), 0.9 + gain * tree)
        return returns - 59.0 * tree * (generator.random(len(starts)) < p)

    return draw


def test_rare_losses_are_no_improvement():
    """The challenger's mean is lower by 1.08; of 200, more than 16 at 5 % has a chance of 2 %."""
    assert wins(RULES["better"], rare_loss, 200) <= 16
    assert wins(RULES["seen"], rare_loss, 200) <= 16


def test_few_pairs_show_nothing_where_the_range_is_not_known():
    """A rule that looks at the range seen alone is taken in by what has not happened yet."""
    rule = Better(most=300, blind=1)
    assert wins(rule, rare_loss, 100) >= 50


def test_a_gain_is_taken():
    def draw(seed):
        generator = np.random.default_rng(seed)
        return lambda tree, starts: 0.5 * tree + generator.uniform(-2.0, 2.0, len(starts))

    rule = Better(most=600, known=(-3.0, 3.0))
    assert wins(rule, draw, 50) >= 45


def test_equal_returns_show_nothing_of_losses_where_the_range_is_not_known():
    rule = Better(most=50)
    verdict = hold(rule, new_table(2, 50), lambda tree, starts: np.zeros(len(starts)))
    assert (verdict.winner, verdict.shown) == (0, False)


def test_a_known_range_within_the_margin_needs_one_pair():
    rule = NotWorse(margin=2.0, known=(0.0, 1.0))
    table = np.full((2, 1000), np.nan)
    table[:, 0] = 0.5, 0.0
    assert rule.next(table) == Verdict(1, True, range(1))


def test_a_budget_that_ends_leaves_the_incumbent_and_the_best_of_the_last_round():
    def out(tree, starts):
        return None

    assert hold(Better(), new_table(2, 1000), out).winner == 0
    table = new_table(3, 512)
    table[:, :8] = np.array([1.0, 3.0, 2.0])[:, None]
    assert hold(Halving(), table, out) == Verdict(1, False, range(8))
    assert hold(SmallestWithin(sizes=(3, 2)), new_table(2, 4000), out).winner == 0


def test_what_the_table_holds_is_not_run_again():
    table = new_table(2, 512)
    table[1, 2] = 5.0
    asked = missing(table, NextEpisodes((0, 1), range(4)))
    assert asked == [(0, [0, 1, 2, 3]), (1, [0, 1, 3])]


@pytest.mark.parametrize(("margin", "least"), [(0.3, 0), (2.0, 18)])
def test_the_smallest_within_a_margin_keeps_it(margin, least):
    """A tree that is worse by 0.5: at a margin of 0.3 it wins once in twenty at most."""
    won = 0
    for seed in range(20):
        generator = np.random.default_rng(seed)
        rule = SmallestWithin(sizes=(9, 2), margin=margin, episodes=600, known=(-4.0, 4.0))
        noise = {0: -0.0, 1: 0.5}

        def draw(tree, starts, generator=generator, noise=noise):
            return generator.uniform(-2.0, 2.0, len(starts)) - noise[tree]

        won += hold(rule, new_table(2, rule.most), draw).winner
    assert least <= won <= (20 if least else 4)


def test_bounds_hold_as_often_as_they_say_where_a_loss_is_rare():
    """Student's interval of no difference has no width; this one holds the truth."""
    held, runs = 0, 200
    for seed in range(runs):
        table = np.zeros((2, 100))
        table[1] -= np.random.default_rng(seed).random(100) < 0.001
        found = bounds_of_change(table, known=(-1.0, 0.0))
        held += found.low <= -0.001 <= found.high
        assert found.low < 0.0 <= found.high
        assert found.condition() == ""
    assert held >= 0.93 * runs
    seen = bounds_of_change(np.array([[0.0, -12.4], [3.0, 1.0]]))
    assert "-12.4" in seen.condition()
