"""Transitions: further episodes, and what is known of the past."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from eutree.data import Episode
from eutree.world_model import Transitions
from eutree.world_model.transitions import earned_nothing, paid_for_places


def episode(*places, terminated):
    return Episode(
        observations=[[float(place)] for place in places],
        actions=[1] * (len(places) - 1),
        rewards=[2.0] * (len(places) - 1),
        terminated=terminated,
        truncated=not terminated,
    )


def transitions(memory=True):
    return Transitions(
        observations=np.array([[0.0], [1.0], [5.0]]),
        actions=np.array([0, 0, 0]),
        rewards=np.array([1.0, 1.0, 1.0]),
        next_observations=np.array([[1.0], [3.0], [6.0]]),
        terminated=np.array([False, True, False]),
        episodes=np.array([0, 0, 1]),
        n_actions=2,
        memory=memory,
    )


def test_further_episodes_follow_as_episodes_of_their_own():
    more = transitions().followed_by(
        [episode(7, 8, 9, terminated=True), episode(4, 4, terminated=False)]
    )
    assert more.observations[:, 0].tolist() == [0, 1, 5, 7, 8, 4]
    assert more.next_observations[:, 0].tolist() == [1, 3, 6, 8, 9, 4]
    assert more.actions.tolist() == [0, 0, 0, 1, 1, 1]
    assert more.terminated.tolist() == [False, True, False, False, True, False]
    assert more.episodes.tolist() == [0, 0, 1, 2, 2, 3]
    assert more.episode_returns.tolist() == [2.0, 1.0, 4.0, 2.0]
    assert transitions().followed_by([]).rewards.tolist() == [1.0, 1.0, 1.0]


def test_without_memory_no_displacement_came_before():
    assert transitions().previous_displacements[:, 0].tolist() == [0.0, 1.0, 0.0]
    assert not transitions(memory=False).previous_displacements.any()
    assert not transitions(memory=False).recent(2).memory


def test_of_many_transitions_half_are_of_the_last_episodes_and_half_of_all_before():
    """Twenty short episodes that failed, then four long ones: models have to know of both."""
    failed = [episode(100 + k, 101 + k, 102 + k, terminated=True) for k in range(20)]
    lasted = [episode(*range(200 + k, 211 + k), terminated=False) for k in range(4)]
    stored = transitions().until(0).followed_by([*failed, *lasted])
    kept = stored.spread(40)
    assert kept.rewards.size == 40
    starts = kept.observations[kept.first, 0].tolist()
    assert starts == [100, 104, 108, 112, 116, 200, 202, 203]  # of 22 before, every fourth
    assert kept.terminated.sum() == 5
    assert kept.episode_lengths.tolist() == [2] * 5 + [10] * 3
    assert not stored.recent(40).terminated.any()
    assert stored.spread(80) is stored


def test_where_one_early_episode_is_too_long_only_late_ones_are_kept():
    early, late = episode(*range(30), terminated=True), episode(1, 2, terminated=True)
    stored = transitions().until(0).followed_by([early, late])
    assert stored.spread(10).episode_lengths.tolist() == [1]


@pytest.mark.parametrize(
    ("rewards", "nothing"),
    [([-1.0, -1.0, -2.0], True), ([0.0, 0.0, 0.0], True), ([1.0, 1.0, 2.0], False),
     ([-1.0, -1.0, -1.0], False)],
)  # fmt: skip
def test_nothing_was_earned_where_all_episodes_earned_the_same_and_none_a_gain(rewards, nothing):
    known = replace(transitions(), rewards=np.array(rewards))
    assert earned_nothing(known) == nothing
    assert not earned_nothing(known.until(0))


@pytest.mark.parametrize("d", [1, 2, 4])
def test_each_place_pays_one_in_all_for_each_pair_of_features(d):
    generator = np.random.default_rng(d)
    places = generator.normal(size=(300, d))
    places[:, -1] = 3.0 if d > 2 else places[:, -1]  # one that never changes tells no places apart
    numbers = np.zeros(300, dtype=np.int64)
    known = Transitions(
        places, numbers, np.zeros(300), places, numbers.astype(np.bool_), numbers, 2
    )
    low, span = places.min(axis=0), places.max(axis=0) - places.min(axis=0)
    cells = [
        tuple(
            min(11, int(12 * (x - a) / b)) if b else 0 for x, a, b in zip(o, low, span, strict=True)
        )
        for o in places
    ]
    grids = [*combinations(range(d), 2)] or [(0,)]
    seen = [[tuple(cell[i] for i in grid) for cell in cells] for grid in grids]
    naive = [sum(1 / of_grid.count(of_grid[k]) for of_grid in seen) for k in range(300)]
    np.testing.assert_allclose(paid_for_places(known).rewards, naive)


def test_an_episode_that_somebody_stopped_early_is_no_time_limit():
    """Twenty whole episodes and three steps of another were planned for three steps ahead."""
    whole = [episode(*range(21), terminated=True) for _ in range(3)]
    stopped = episode(0, 1, 2, 3, terminated=False)
    limited = episode(*range(31), terminated=False)
    assert transitions().followed_by(whole).horizon() == 40
    assert transitions().followed_by([*whole, stopped]).horizon() == 40
    assert transitions().followed_by([*whole, stopped, limited]).horizon() == 30
    told = transitions().followed_by([*whole, stopped, limited]).stopped
    assert told.tolist() == [False, True, False, False, False, True, False]
