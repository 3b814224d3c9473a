"""The quick rules: whom they take, after how many episodes, and that they do as their twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.contests import Ahead, AheadApart, NextEpisodes, Verdict, hold, new_table, next_episode
from eutree.contests.rules import Lead
from tests import naive_contests as naive
from tests.contests.following import follow, seeds, world

VARIANT = Ahead(errors=2.0, final=2.0)
PATIENT = Ahead(looks=(8, 20, 40, 72, 136), errors=2.0, final=0.0, patient=True, rare_losses=False)


def told(rule, returns_of, n_trees=2):
    """Return the verdict where a tree's return from a start is made up, and the last start run."""
    table = new_table(n_trees, rule.most)

    def run(tree, starts):
        return np.array([returns_of(tree, start) for start in starts])

    return hold(rule, table, run), int((~np.isnan(table[0])).sum())


@settings(max_examples=60, deadline=None)
@given(
    seed=seeds,
    n_trees=st.integers(2, 9),
    patient=st.booleans(),
    rare_losses=st.booleans(),
    errors=st.sampled_from([1.0, 2.0]),
    final=st.sampled_from([0.0, 1.0]),
    step=st.sampled_from([1e-6, 1.0]),
    priced=st.booleans(),
    known=st.sampled_from([None, (-20.0, 20.0)]),
)
def test_ahead_says_what_its_twin_says(
    seed, n_trees, patient, rare_losses, errors, final, step, priced, known
):
    prices = tuple(0.3 * tree for tree in range(n_trees)) if priced else ()
    looks = PATIENT.looks if patient else Ahead().looks
    choices = {"looks": looks, "errors": errors, "final": final, "patient": patient}
    choices["rare_losses"] = rare_losses
    rule = Ahead(**choices, prices=prices, known=known)

    def twin(table):
        return naive.ahead(table, **choices, prices=prices, known=known)

    follow(rule, twin, n_trees, world(seed, n_trees, 1.0, step))


@pytest.mark.parametrize(
    ("gain", "saved", "rule", "wins", "episodes"),
    [
        (1.0, 0.0, Ahead(), True, 8),  # a lead that hardly chance can be, after few episodes
        (-1.0, 0.0, Ahead(), False, 4),
        (0.0, 0.5, Ahead(), True, 64),  # smaller and as good: only after many
        (0.0, 0.0, VARIANT, False, 4),  # a tie is not looked into
        (0.3, -0.5, Ahead(), False, 4),  # more leaves than they earn
    ],
)
def test_a_challenger_wins_where_it_earns_clearly_more(gain, saved, rule, wins, episodes):
    priced = Ahead(errors=rule.errors, final=rule.final, prices=(saved, 0.0))
    found, ran = told(priced, lambda tree, start: start % 7 + gain * tree)
    assert (found.winner, found.shown) == (int(wins), wins)
    assert ran == episodes


@pytest.mark.parametrize(("lead", "episodes"), [(2.5, 8), (1.2, 16), (0.5, 32)])
def test_the_clearer_a_lead_the_fewer_episodes_show_it(lead, episodes):
    spread = np.resize([-1.0, 1.0], 64)  # a standard deviation of about 1
    found, ran = told(Ahead(), lambda tree, start: (lead + spread[start]) * tree)
    assert (found.winner, ran) == (1, episodes)


def test_a_small_lead_says_nothing_where_more_may_be_lost_than_it_gains():
    """A tree that is ahead by 1 in every episode may lose 100 in one that was not seen."""
    found, _ = told(Ahead(known=(-100.0, 0.0)), lambda tree, start: float(tree))
    assert (found.winner, found.shown) == (0, False)
    found, ran = told(Ahead(known=(-20.0, 0.0)), lambda tree, start: float(tree))
    assert (found.winner, ran) == (1, 32)


def test_few_episodes_hardly_ever_show_a_lead_where_there_is_none():
    generator, n_contests = np.random.default_rng(5), 4000

    def wins_early():
        def run(tree, starts):
            return None if starts[-1] >= 16 else generator.normal(size=len(starts))

        return hold(VARIANT, new_table(2, VARIANT.most), run).shown

    # Student's t is exceeded once in 1,000 at each of two looks; five standard errors more.
    assert sum(wins_early() for _ in range(n_contests)) <= 8 + 5 * np.sqrt(8)


def test_a_challenger_that_is_ahead_when_the_steps_end_has_not_been_shown():
    def run(tree, starts):
        if starts[-1] >= 8:
            return None
        return np.array(starts) % 2 * 2.0 * tree

    found = hold(Ahead(), new_table(2, 64), run)
    assert (found.winner, found.shown) == (1, False)


def test_steps_that_end_a_patient_contest_early_want_a_standard_error():
    table = new_table(2, PATIENT.most)
    table[:, :3] = [[0.0, 0.0, 4.0], [1.0, 9.0, 0.0]]
    assert PATIENT.stopped(table).winner == 0  # 2 ahead, with a standard error of 3.8
    table[:, 3:8] = [[0.0] * 5, [8.0] * 5]
    assert PATIENT.stopped(table).winner == 1


def episodes(rule, means, seed, spread=10.0):
    """Hold a contest episode by episode; return its winner and how many were run."""
    generator = np.random.default_rng(seed)
    luck = spread * generator.standard_normal((len(means), rule.most))
    table, n = new_table(len(means), rule.most), 0
    while (asked := next_episode(rule, table)) is not None:
        assert np.isnan(table[asked])
        table[asked] = means[asked[0]] + luck[asked]
        n += 1
    return rule.stopped(table).winner, n


def test_the_best_challenger_of_many_wins_nearly_always():
    means = [0.0, -5.0, 8.0, 2.0, -20.0, 1.0]
    won = [episodes(PATIENT, means, seed)[0] for seed in range(60)]
    assert won.count(2) > 48


def test_an_incumbent_that_is_better_stays():
    won = [episodes(PATIENT, [10.0, 0.0, 1.0, -5.0], seed)[0] for seed in range(40)]
    assert won.count(0) == 40


def test_no_challenger_of_a_patient_contest_is_judged_on_fewer_than_32_pairs():
    _, n = episodes(PATIENT, [0.0, -1000.0], 0)
    assert n >= 2 * 32


def test_episodes_of_a_contest_are_asked_for_start_by_start():
    table = new_table(3, 136)
    asked = []
    for _ in range(5):
        asked.append(next_episode(PATIENT, table))
        table[asked[-1]] = 0.0
    assert asked == [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1)]


def apart(own, other):
    table = new_table(2, max(len(own), len(other)))
    table[0, : len(own)], table[1, : len(other)] = own, other
    return AheadApart().next(table)


@pytest.mark.parametrize(
    ("own", "other", "wins"),
    [
        ([0.0, 1.0] * 20, [0.5, 0.7] * 15, True),  # on 30 episodes the mean decides
        ([0.0, 1.0] * 20, [0.4, 0.5] * 15, False),
        ([0.0, 1.0] * 20, [0.5, 0.7] * 3, False),  # on few it must be far ahead
        ([0.0, 1.0] * 20, [2.0, 2.2] * 3, True),
        ([0.0, 1.0] * 20, [2.0] * 4, False),  # and 4 say nothing
        ([], [2.0] * 40, False),
    ],
)
def test_trees_that_ran_apart_are_compared_by_their_means(own, other, wins):
    found = apart(own, other)
    assert isinstance(found, Verdict if wins else NextEpisodes)


def test_a_lead_is_the_mean_gain_and_its_standard_error():
    lead = Lead.of(np.array([1.0, 2.0, 3.0, 6.0]))
    assert (lead.mean, lead.pairs) == (3.0, 4)
    assert lead.error == pytest.approx(np.sqrt(14 / 3 / 4))
    assert Lead.of(np.array([1.0])).error == np.inf
