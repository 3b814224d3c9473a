"""The expert tree's learning curve: the law's fit, what it is asked about, what it advises."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.data import Demonstrations, Episode
from eutree.evaluation.expert_curve import expert_curve, fit_power_law
from eutree.schema import Schema


def episode(observations, actions):
    rows = np.asarray([*observations, observations[-1]], dtype=float)
    return Episode(rows, actions, np.zeros(len(actions)), terminated=True, truncated=False)


def demos_of(n, rule, *, steps=30, seed=0):
    """``n`` episodes of random places in [0, 1]^2, acted upon by ``rule(rng, places)``."""
    rng = np.random.default_rng(seed)
    episodes = []
    for _ in range(n):
        places = rng.random((steps, 2))
        episodes.append(episode(places, rule(rng, places)))
    return Demonstrations(tuple(episodes), Schema.anonymous(2, 2))


def simple(rng, places):
    return (places[:, 0] > 0.5).astype(int)


def winding(rng, places):
    return (places[:, 1] > 0.5 + 0.4 * np.sin(9 * places[:, 0])).astype(int)


def checkered(rng, places):
    return ((places * 4).astype(int).sum(axis=1) % 2).astype(int)


@pytest.mark.parametrize(
    ("floor", "scale", "exponent"), [(0.05, 0.4, 0.7), (0.0, 0.3, 1.0), (0.2, 0.0, 1.0)]
)
def test_an_exact_law_is_found_again(floor, scale, exponent):
    k = np.array([1, 2, 3, 5, 8, 13])
    law = fit_power_law(k, floor + scale * k**-exponent)
    assert law.error(20) == pytest.approx(floor + scale * 20**-exponent, abs=1e-3)
    assert law.floor == pytest.approx(floor, abs=0.02)


def test_an_error_that_grows_is_taken_as_level():
    k = np.array([1, 2, 4, 8])
    law = fit_power_law(k, 0.1 + 0.01 * k)
    assert law.scale == 0.0
    assert law.error(100) == law.error(1)


def test_a_simple_rule_needs_no_more_episodes():
    curve = expert_curve(demos_of(12, simple, steps=120))
    assert curve.points[-1].k == 11
    assert curve.points[-1].accuracy > 0.97
    assert curve.advice.startswith("More of the same will not help")
    assert "still errs" not in curve.advice


def test_what_is_cut_altogether_is_left_out():
    """A subset of one such episode could not be fitted."""
    demos = demos_of(6, simple)
    whole = demos.episodes[1]
    cut = whole.teaching_in(0, len(whole), None)
    driven = replace(whole, is_success=False, steps={"by_hand": np.zeros(len(whole), bool)})
    light = replace(
        driven,
        observations=driven.observations[:3],
        actions=driven.actions[:2],
        rewards=driven.rewards[:2],
        steps={"by_hand": np.zeros(2, bool)},
    )  # a failure of two steps that a tree drove: neither is imitated
    curve = expert_curve(replace(demos, episodes=(cut, light, *demos.episodes)))
    assert curve.n_episodes == 6
    assert expert_curve(replace(demos, episodes=(cut, *demos.episodes[:3]))) is None
    assert expert_curve(replace(demos, episodes=(driven, *demos.episodes))).n_episodes == 7


def test_a_person_who_contradicts_themself_gains_nothing_and_is_told():
    def fickle(rng, places):
        return np.where(rng.random(len(places)) < 0.2, 1, simple(rng, places))

    curve = expert_curve(demos_of(12, fickle, steps=200))
    assert curve.advice.startswith("More of the same will not help")
    assert "The tree still errs in 1" in curve.advice


def test_a_winding_rule_gains_about_what_was_foretold():
    """Whether it foretells well on average: benchmarks/demonstrations_needed.py."""
    curve = expert_curve(demos_of(10, winding))
    assert curve.gain_interval.low > 0.0
    assert "5 more episodes would likely gain about" in curve.advice
    law = curve.law
    assert curve.gain == law.error(10) - law.error(15)
    assert law.error(9) == pytest.approx(1 - curve.points[-1].accuracy, abs=0.02)


def test_a_rule_that_c45_has_not_grasped_says_nothing_of_more_episodes():
    """A chessboard looks flat to a greedy tree until it has seen a lot: no reason to give up."""
    curve = expert_curve(demos_of(10, checkered, steps=20))
    assert curve.advice.startswith("Nothing can be said yet")


def test_held_out_episodes_are_never_seen():
    """Each episode has a place of its own and a random action: only those seen are known."""
    episodes = [episode([[float(i), 0.0]] * 6, [i % 2] * 6) for i in (0, 1, 0, 1, 0, 1, 0, 1)]
    same = Demonstrations(tuple(episodes), Schema.anonymous(2, 2))
    assert expert_curve(same).points[-1].accuracy == 1.0
    rng = np.random.default_rng(3)
    places = rng.permutation(40).astype(float)
    lonely = [episode([[p, 0.0]] * 6, [int(rng.integers(2))] * 6) for p in places]
    assert expert_curve(Demonstrations(tuple(lonely), same.schema)).points[-1].accuracy < 0.75


def test_too_few_discarded_and_empty_episodes():
    demonstrations = demos_of(5, simple)
    first, second, *rest = demonstrations.episodes
    assert expert_curve(replace(demonstrations, episodes=(first, second, rest[0]))) is None
    dropped = replace(demonstrations, episodes=(replace(first, kept=False), second, *rest))
    assert expert_curve(dropped).n_episodes == 4
    still = Episode([[0.0, 0.0]], [], [], terminated=False, truncated=False)
    assert expert_curve(replace(demonstrations, episodes=(still, *rest))) is None
    assert expert_curve(demonstrations) == expert_curve(demonstrations)
