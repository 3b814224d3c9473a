"""Races are told returns that a test makes up: what they ask for, and how often they are wrong."""

import numpy as np
import pytest

from eutree.contests.betting import episodes_needed, log_wealth, lower_bound, tuned_stake
from eutree.policy_search.racing import (
    Demand,
    Heat,
    Returns,
    drive,
    halving,
    meeting,
    paired,
    smallest_within,
)

LOSS = 100.0


class RareFailures:
    """The input's returns are uniform on [0, noise]; the candidate loses LOSS with chance p."""

    def __init__(self, p, noise, generator):
        self.p, self.noise, self.generator = p, noise, generator
        self.inputs = {}
        self.asked = []

    def __call__(self, heat):
        self.asked.append(heat)
        n = len(heat.episodes)
        if heat.runner == 0:
            self.inputs[heat.block] = self.noise * self.generator.random(n)
            return self.inputs[heat.block]
        return self.inputs[heat.block] - LOSS * (self.generator.random(n) < self.p)


def accepted(p, demand, runs, noise=0.0):
    """Return how often the real race takes the candidate."""
    generator = np.random.default_rng(7)
    worlds = [RareFailures(p, noise, generator) for _ in range(runs)]
    return sum(drive(smallest_within(1, demand), world) is not None for world in worlds)


@pytest.mark.parametrize(
    ("p", "margin", "episodes"),
    [
        (1e-4, 0.009, 200),
        (5e-4, 0.04, 1000),  # Student's interval took it in 60 % of the races
        (5e-3, 0.25, 200),  # and here in 30 %
        (5e-3, 0.45, 1000),
        (2e-2, 1.9, 1000),
        (1e-1, 9.5, 200),
    ],
)
def test_a_tree_worse_than_the_margin_by_rare_failures_is_seldom_taken(p, margin, episodes):
    """The promise is an error of 0.05 at most, at every chance of the failure."""
    demand = Demand(margin=margin, error=0.05, episodes=episodes, known_range=(-LOSS, 0.0))
    runs = 80
    assert p * LOSS > margin
    assert accepted(p, demand, runs) <= 9  # more has a chance of 1 % at a rate of 0.05


def test_where_the_range_is_not_known_losses_within_the_blind_width_are_covered():
    demand = Demand(margin=1.0, error=0.05, episodes=1000)
    assert demand.blind_width > LOSS
    assert accepted(0.015, demand, 40, noise=10.0) <= 6


def test_equal_returns_show_nothing_of_losses_where_the_range_is_not_known():
    demand = Demand(margin=0.0, error=0.05, episodes=100)
    assert accepted(0.0, demand, 5) == 0


@pytest.mark.parametrize("p", [0.0, 1e-4, 1e-3])
def test_the_race_is_not_needlessly_strict(p):
    demand = Demand(margin=2.0, error=0.05, episodes=1000, known_range=(-LOSS, 0.0))
    assert accepted(p, demand, 20) >= 18


def test_too_few_episodes_for_any_tree_are_counted():
    assert episodes_needed(2.0, -270.0, 0.025) == pytest.approx(270 / 2 * np.log(80), rel=0.01)
    assert episodes_needed(2.0, -1.0, 0.025) == 0
    demand = Demand(margin=1.0, error=0.05, episodes=400, known_range=(-LOSS, 0.0))
    assert episodes_needed(1.0, -LOSS, 0.025) > 400
    assert accepted(0.0, demand, 3) == 0


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


def test_a_meeting_without_margin_runs_all_episodes_and_bounds_the_change():
    world = RareFailures(0.0, 0.0, np.random.default_rng(0))
    met = drive(meeting(0.05, 100, block=3, returns=Returns((-LOSS, 0.0))), world)
    assert met.before.size == met.after.size == 100
    assert met.low < 0 < met.high
    assert min(heat.block for heat in world.asked) == 3


def told(returns_of):
    """Return what runs heats of runners with a fixed return for each episode."""
    asked = []

    def run(heat):
        asked.append(heat)
        return np.array([returns_of(heat.runner, number) for number in heat.episodes])

    return asked, run


def test_halving_drops_the_worse_half_and_doubles_the_episodes():
    asked, run = told(lambda runner, number: float(runner))
    assert drive(halving([2, 2, 2, 2], leaf_price=0.0, first=4, block=5), run) == 3
    assert [(heat.runner, heat.episodes) for heat in asked] == [
        *((runner, range(4)) for runner in range(4)),
        (3, range(4, 12)),
        (2, range(4, 12)),
    ]
    assert {heat.block for heat in asked} == {5}


def test_halving_lets_leaves_pay():
    _, run = told(lambda runner, number: 1.0 + 0.1 * runner)
    assert drive(halving([2, 9], leaf_price=0.1, first=4, block=0), run) == 0


def test_halving_ends_with_the_best_of_the_round_when_the_budget_does():
    race = halving([2, 2, 2], leaf_price=0.0, first=1, block=0)
    assert next(race) == Heat(0, 0, range(1))
    race.send(np.array([1.0]))
    race.send(np.array([5.0]))
    with pytest.raises(StopIteration) as end:
        race.send(None)
    assert end.value.value == 1


@pytest.mark.parametrize(
    ("gain", "saved", "of_many", "wins", "episodes"),
    [
        (1.0, 0.0, False, True, 8),  # a lead that hardly chance can be, after few episodes
        (-1.0, 0.0, False, False, 4),
        (0.0, 0.5, False, True, 64),  # smaller and as good: only after many
        (0.0, 0.0, True, False, 4),  # of many challengers a tie is not looked into
        (0.3, -0.5, False, False, 4),  # more leaves than they earn
    ],
)
def test_a_challenger_wins_where_it_earns_clearly_more(gain, saved, of_many, wins, episodes):
    asked, run = told(lambda runner, number: number % 7 + gain * runner)
    assert drive(paired(saved, of_many=of_many, block=0), run) is wins
    assert asked[-1].episodes.stop == episodes


@pytest.mark.parametrize(("lead", "episodes"), [(2.5, 8), (1.2, 16), (0.5, 32)])
def test_the_clearer_a_lead_the_fewer_episodes_show_it(lead, episodes):
    spread = np.resize([-1.0, 1.0], 64)  # a standard deviation of about 1 in each block
    asked, run = told(lambda runner, number: (lead + spread[number]) * runner)
    assert drive(paired(0.0, of_many=False, block=0), run) is True
    assert asked[-1].episodes.stop == episodes


def test_few_episodes_hardly_ever_show_a_lead_where_there_is_none():
    generator = np.random.default_rng(5)
    n_races = 4000

    def wins_early():
        def run(heat):
            if heat.episodes.stop > 16:
                return None
            return generator.normal(size=len(heat.episodes))

        return drive(paired(0.0, of_many=True, block=0), run) is True

    # Student's t is exceeded once in 1,000 at each of two looks; five standard errors more.
    assert sum(wins_early() for _ in range(n_races)) <= 8 + 5 * np.sqrt(8)


def test_a_paired_race_that_runs_out_of_budget_ahead_does_not_know():
    def run(heat):
        if heat.episodes.stop > 8:
            return None
        return np.where(np.arange(len(heat.episodes)) == 1, 2.0, 0.0) * heat.runner

    assert drive(paired(0.0, of_many=False, block=0), run) is None
