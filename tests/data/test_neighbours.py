"""Nearest neighbours in other episodes, against a case worked out by hand and a naive loop."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.data import Demonstrations, Episode
from eutree.data.neighbours import NEAR, compare_neighbours
from eutree.schema import Schema


def episode(observations, actions):
    rows = np.asarray([*observations, observations[-1]], dtype=float)
    return Episode(rows, actions, np.zeros(len(actions)), terminated=True, truncated=False)


def demos_of(*episodes):
    size = episodes[0].observations.shape[1]
    return Demonstrations(tuple(episodes), Schema.anonymous(size, 3))


def test_a_contradiction_between_two_episodes_has_its_places():
    first = episode([[0.0, 0.0], [50.0, 1.0], [100.0, 0.0]], [0, 1, 0])
    second = episode([[0.0, 0.0], [51.0, 1.0]], [0, 2])
    found = compare_neighbours(demos_of(first, second))
    # 100 is nearest to 51 (0.49 and 1.0 apart: the larger counts) or to 0 (1.0): ties go low.
    assert found.disagreement == 2 / 5
    (pair,) = found.contradictions
    assert pair.places == ((0, 1), (1, 1))
    assert pair.actions == (1, 2)
    assert abs(pair.distance - 0.01) < 1e-12
    assert found.n_near == 4
    assert found.near_disagreement == 0.5


def test_successive_steps_of_one_episode_are_no_neighbours():
    alone = episode([[0.0], [0.001], [1.0]], [0, 1, 0])
    assert compare_neighbours(demos_of(alone)).disagreement is None
    other = episode([[0.0], [1.0]], [0, 0])
    found = compare_neighbours(demos_of(alone, other))
    assert found.disagreement == 1 / 5  # 0.001 against 0.0; all others agree
    discarded = demos_of(alone, replace(other, kept=False))
    assert compare_neighbours(discarded).disagreement is None


@given(st.integers(0, 2**32), st.integers(1, 3), st.integers(2, 4))
@settings(deadline=None, max_examples=30)
def test_shares_equal_the_naive_loop(seed, d, n_episodes):
    rng = np.random.default_rng(seed)
    episodes = [
        episode(rng.random((n, d)), rng.integers(0, 3, n))
        for n in rng.integers(1, 9, n_episodes).tolist()
    ]
    found = compare_neighbours(demos_of(*episodes))
    rows = [
        (number, x, a)
        for number, one in enumerate(episodes)
        for x, a in zip(one.observations[:-1], one.actions, strict=True)
    ]
    points = np.array([x for _, x, _ in rows])
    width = np.ptp(points, axis=0)
    differing, near = [], []
    for e, x, a in rows:
        gaps = [(max(np.abs(x - y) / width), b) for f, y, b in rows if f != e]
        gap, b = min(gaps, key=lambda entry: entry[0])
        differing.append(a != b)
        near += [a != b] if gap <= NEAR else []
    assert found.disagreement == np.mean(differing)
    assert found.n_near == len(near)
