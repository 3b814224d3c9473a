"""Transitions: further episodes, and what is known of the past."""

import numpy as np

from eutree.data import Episode
from eutree.world_model import Transitions


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
