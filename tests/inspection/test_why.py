"""Why a policy decides as it does; the nearest other decision against a search of the lattice."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree.inspection import why
from eutree.policies import LeafStatistics
from tests.inspection.crossings import crossing
from tests.inspection.lattices import lattice_policy


@settings(max_examples=120, deadline=None)
@given(seed=st.integers(0, 2**32), n_features=st.integers(1, 2), n_actions=st.integers(1, 3))
def test_the_nearest_other_action_is_the_nearest_of_the_lattice(seed, n_features, n_actions):
    generator = np.random.default_rng(seed)
    policy = lattice_policy(generator, n_features, n_actions)
    observation = generator.integers(0, 7, n_features).astype(float)
    # Every box ends at a whole number, or begins just above one.
    axis = np.unique([v for k in range(7) for v in (k, np.nextafter(k, 9))])
    axis = axis[axis <= 6]
    place = np.array(list(itertools.product(axis, repeat=n_features)))
    actions = policy.predict(place)[0]
    distance = np.abs(place - observation).max(axis=1) / 6
    found = why(policy, observation)
    own = policy.predict(observation)[0]
    assert found.action == own
    assert {a.action for a in found.alternatives} == set(actions.tolist()) - {own}
    for alternative in found.alternatives:
        assert policy.predict(alternative.observation)[0] == alternative.action
        assert alternative.distance == distance[actions == alternative.action].min()
    assert [a.distance for a in found.alternatives] == sorted(
        a.distance for a in found.alternatives
    )


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_the_path_leads_to_the_leaf(seed):
    generator = np.random.default_rng(seed)
    policy = lattice_policy(generator, 2)
    observation = generator.random(2) * 6
    found = why(policy, observation)
    node = 0
    for step in found.path:
        assert step.node == node
        assert step.is_true == (observation[step.feature] <= step.threshold)
        assert step.distance == abs(observation[step.feature] - step.threshold)
        node = int((policy.tree.left if step.is_true else policy.tree.right)[node])
    assert policy.tree.leaf[node] == found.leaf


def test_an_explanation_in_words():
    visits = np.array([[30, 2], [0, 9], [4, 4]])
    values = np.array([[1.5, -3.0], [np.nan, 7.0], [0.0, 1.0]])
    known = LeafStatistics(visits, values, np.full((3, 2), 0.25))
    shown = Demonstrations.from_arrays(
        [[7.0, 1.0], [7.5, 2.0], [9.0, 1.0]], [0, 1, 1], starts=[True, False, False],
        next_observations=[[7.5, 2.0], [9.0, 1.0], [10.0, 1.0]], schema=crossing().schema,
    )  # fmt: skip
    found = why(crossing(known), [7.25, 1.5], demonstrations=shown)
    assert found.text.splitlines() == [
        "stop, by leaf 0: position <= 8 m and gap <= 2.5 s",
        "  position <= 8 m ? yes: 7.25, by 0.75 m",
        "  gap <= 2.5 s ? yes: 1.5, by 1 s",
        "  go from position > 8 m (by 0.75) on",
        "  stop: 30 visits, value 1.5 +- 0.25",
        "  go: 2 visits, value -3 +- 0.25",
        "  2 demonstrated steps of 1 episodes: 1 x stop, 1 x go",
    ]
    assert [(s.episode, s.step, s.action) for s in found.support] == [(0, 0, 0), (0, 1, 1)]


def test_the_scale_decides_what_is_near():
    by_width = why(crossing(), [7.25, 2.4])
    by_metre = why(crossing(), [7.25, 2.4], scale=[1.0, 1.0])
    assert by_width.alternatives[0].observation[0] > 8.0
    assert by_metre.alternatives[0].observation.tolist() == [7.25, np.nextafter(2.5, 3)]
    assert by_metre.alternatives[0].words == "go from gap > 2.5 s (by 0.1) on"


def test_bad_observations_are_named():
    with pytest.raises(InvalidArgumentError, match="observation must have 2 entries, got 3"):
        why(crossing(), [1.0, 2.0, 3.0])
    with pytest.raises(InvalidArgumentError, match="observation must be finite"):
        why(crossing(), [1.0, np.nan])
