"""Races are told returns that a test makes up: what they ask for, and how often they are wrong."""

import numpy as np
import pytest

from eutree.policy_search.racing import Heat, drive, halving, paired


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
