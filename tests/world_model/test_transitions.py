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
