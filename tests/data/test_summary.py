"""Statistics of demonstrations against naive loops and hand-made cases."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.data import Demonstrations
from eutree.data.summary import BINS, summarize
from eutree.schema import Feature, Schema
from tests.data.strategies import three_episodes


def demos_of(observations, actions, schema=None):
    observations = np.asarray(observations, dtype=float)
    return Demonstrations.from_arrays(
        observations,
        actions,
        starts=np.arange(len(actions)) % 4 == 0,
        next_observations=_next(observations),
        schema=schema,
    )


def _next(observations):
    return np.concatenate([observations[1:], observations[-1:]])


def naive_disagreement(observations, actions):
    low, high = observations.min(axis=0), observations.max(axis=0)
    groups = {}
    for x, action in zip(observations, actions, strict=True):
        key = []
        for value, a, b in zip(x, low, high, strict=True):
            share = (value / 2 - a / 2) / (b / 2 - a / 2) if b > a else 0.0
            key.append(min(int(share * BINS), BINS - 1))
        groups.setdefault(tuple(key), []).append(int(action))
    return sum(len(g) - max(map(g.count, g)) for g in groups.values()) / len(actions)


@given(st.integers(1, 60), st.integers(1, 3), st.integers(0, 2**32))
@settings(deadline=None, max_examples=50)
def test_disagreement_equals_the_naive_count(n, d, seed):
    rng = np.random.default_rng(seed)
    observations = rng.integers(0, 4, (n, d)) + rng.choice([0.0, 1e-6], (n, d))
    actions = rng.integers(0, 3, n)
    found = summarize(demos_of(observations, actions))
    assert found.disagreement == naive_disagreement(observations, actions)
    assert (found.n_conflicts > 0) == (found.disagreement > 0)


def test_a_contradiction_is_shown_with_its_places():
    observations = [[0.0], [5.0], [10.0], [20.0], [5.01], [5.0]]
    found = summarize(demos_of(observations, [0, 1, 0, 0, 0, 0]))
    assert found.n_conflicts == 1
    assert found.disagreement == 1 / 6
    (conflict,) = found.conflicts
    assert conflict.counts == (2, 1)
    assert conflict.places == ((1, 0), (0, 1))
    assert abs(conflict.observation[0] - 5.0) < 0.01


def test_coverage_counts_the_bins_between_the_bounds():
    schema = Schema((Feature("bounded", low=0, high=10), Feature("open")), ("a", "b"))
    found = summarize(demos_of([[0.5, 3.0], [1.5, 3.0], [1.7, 3.0]], [0, 1, 0], schema))
    assert [c.share for c in found.coverage] == [0.2, 0.1]
    assert found.joint_cells == 2
    assert (found.coverage[0].low, found.coverage[0].high) == (0.5, 1.7)


def test_discarded_episodes_do_not_count():
    assert [e.kept for e in three_episodes().episodes] == [True, True, False]
    assert summarize(three_episodes()).success_rate == 0.5
    assert summarize(Demonstrations((), Schema.anonymous(2, 2))).disagreement == 0.0
