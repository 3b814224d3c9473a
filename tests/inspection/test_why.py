"""Why a policy decides as it does; the nearest other decision against a search of the lattice."""

import itertools
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree.inspection import why
from eutree.interaction import describe
from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from tests.frames import Row
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
        "  (a value is the return expected after an action: Q, or the mean of what followed)",
        "  2 demonstrated steps of 1 episode: 1 x stop, 1 x go",
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


def test_a_row_of_a_frame_is_read_by_its_names():
    names = crossing().schema.feature_names
    wanted = why(crossing(), [7.25, 2.4], scale=[1.0, 2.0])
    rows = {"observation": [2.4, 7.25], "scale": [2.0, 1.0]}
    turned = {name: Row(values, names[::-1]) for name, values in rows.items()}
    assert why(crossing(), **turned).text == wanted.text != why(crossing(), **rows).text
    with pytest.raises(InvalidArgumentError, match="observation must have the columns"):
        why(crossing(), Row([7.25, 2.4], [names[0], "other"]))
    summed = crossing().schema.derive(["both = position + gap"])
    tree = DecisionTree.single_leaf(3).split(0, 2, 9.0)
    policy = TreePolicy(tree, [0, 1], summed)
    for row in (Row([2.4, 7.25], names[::-1]), Row([9.65, 2.4, 7.25], ["both", *names[::-1]])):
        assert why(policy, row).text == why(policy, [7.25, 2.4]).text


def twelve(visits, values, n_actions=12):
    """Return a policy of two leaves and many actions."""
    schema = Schema((Feature("x", "", 0.0, 9.0),), tuple(f"a{k}" for k in range(n_actions)))
    known = LeafStatistics(visits, values, np.full(np.shape(values), np.nan))
    tree = DecisionTree.single_leaf(1).split(0, 0, 5.0)
    return TreePolicy(tree, [0, n_actions - 1], schema, leaves=known)


def statistics_of(policy):
    """Return what an explanation says of the visits and values of the left leaf."""
    return [line.strip() for line in why(policy, [1.0]).text.splitlines()[3:]]


def test_actions_that_were_never_tried_take_one_line():
    """Of twelve actions nine were "0 visits, no value", and a mean return passed for a Q."""
    visits, values = np.zeros((2, 12), int), np.full((2, 12), np.nan)
    visits[0, 0], values[0, 0] = 30, 2.5
    alone = statistics_of(twelve(visits, values))
    assert alone == [
        "a0: 30 visits, value 2.5",
        "never tried here: the other 11",
        "(a value is the mean return that followed; each leaf tried one action: no Q)",
    ]
    visits[0, 3], values[0, 3] = 1, -2.0
    assert statistics_of(twelve(visits, values))[1:3] == [
        "a3: 1 visit, value -2",
        "never tried here: the other 10",
    ]
    assert statistics_of(twelve(np.zeros((2, 12), int), np.full((2, 12), np.nan))) == [
        "never tried here: any of the 12 actions"
    ]
    counts = np.array([[4, 0], [1, 1]])
    assert statistics_of(twelve(counts, np.full((2, 2), np.nan), 2)) == [
        "a0: 4 visits",
        "never tried here: a1",
    ]


class Tariff(gymnasium.Env):
    """Three tariffs, the hour of the day and a temperature."""

    observation_space = gymnasium.spaces.Dict(
        {
            "tariff": gymnasium.spaces.Discrete(3),
            "hours": gymnasium.spaces.Box(0, 23, (1,), np.int32),
            "warm": gymnasium.spaces.Box(0.0, 1.0, (1,), np.float64),
        }
    )
    action_space = gymnasium.spaces.Discrete(3)


def test_whole_features_change_by_whole_numbers(tmp_path):
    """`tariff > 1.0 (by 2.22045e-16)`: there is no such tariff."""
    schema = describe(Tariff())
    assert [f.is_integer for f in schema.features] == [True, True, False]  # hours, tariff, warm
    tree = DecisionTree.single_leaf(3).split(0, 1, 1.0).split(0, 0, 6.5).split(2, 0, 6.9)
    policy = TreePolicy(tree, [0, 1, 2, 1], schema)
    policy.save(tmp_path / "tree.json")
    found = why(TreePolicy.load(tmp_path / "tree.json"), [5.0, 1.0, 0.5])
    lines = [line.strip() for line in found.text.splitlines()]
    assert [step.distance for step in found.path] == [1.0, 2.0]
    assert lines[1].endswith("yes: 1, by 1")
    assert lines[-1].endswith("from hours >= 7 (by 2) on")
    assert {a.action: a.observation.tolist() for a in found.alternatives} == {1: [7.0, 1.0, 0.5]}
    up = why(policy, [7.0, 2.0, 0.5])
    assert [a.words for a in up.alternatives] == [
        "action_0 from hours <= 6 (by 1) and tariff <= 1 (by 1) on"
    ]


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 2**32), n_features=st.integers(1, 2))
def test_the_nearest_whole_observation_of_another_action(seed, n_features):
    generator = np.random.default_rng(seed)
    policy = lattice_policy(generator, n_features, 3)
    features = tuple(replace(f, is_integer=True) for f in policy.schema.features)
    tree = replace(policy.tree, threshold=policy.tree.threshold + generator.choice([0, 0.5]))
    policy = replace(policy, tree=tree, schema=Schema(features, policy.schema.actions))
    observation = generator.integers(0, 7, n_features).astype(float)
    place = np.array(list(itertools.product(range(7), repeat=n_features)), dtype=float)
    actions = policy.predict(place)[0]
    distance = np.abs(place - observation).max(axis=1) / 6
    found = why(policy, observation)
    assert {a.action for a in found.alternatives} == set(actions.tolist()) - {found.action}
    for alternative in found.alternatives:
        assert policy.predict(alternative.observation)[0] == alternative.action
        assert alternative.distance == distance[actions == alternative.action].min()
    for step in found.path:
        moved = observation[step.feature] + (step.distance if step.is_true else -step.distance)
        assert (moved <= step.threshold) != step.is_true
        assert step.distance >= 1.0


def test_a_small_margin_is_not_called_none():
    """`room <= 17.99 ? no: 18, by 0`: it was 0.002."""
    words = [step.words for step in why(crossing(), [8.002, 2.0]).path]
    assert words[0].endswith("no: 8.002, by 0.002 m")
    assert why(crossing(), [7.998, 2.0]).alternatives[0].words.endswith("> 8 m (by 0.002) on")
    assert why(crossing(), [8.0, 2.0]).path[0].words.endswith("yes: 8, by 0 m")


def test_an_alternative_whose_derived_features_do_not_fit_is_said_to_be_none():
    """Its measured numbers alone are those of the observation, which gets the old action."""
    schema = Schema((Feature("a"), Feature("b")), ("off", "on")).derive(["sum = a + b"])
    policy = TreePolicy(DecisionTree.single_leaf(3).split(0, 2, 1.0), [0, 1], schema)
    (made,) = why(policy, [0.25, 0.5]).alternatives
    assert made.observation[:2].tolist() == [0.25, 0.5]
    assert not made.occurs
    assert made.words.endswith(
        "(the derived features of that observation do not fit its measured ones)"
    )
    tested = replace(policy, tree=DecisionTree.single_leaf(3).split(0, 0, 1.0))
    assert not why(tested, [0.25, 0.5]).alternatives[0].occurs  # a alone changes, not the sum
    plain = TreePolicy(DecisionTree.single_leaf(2).split(0, 0, 1.0), [0, 1], schema.measured)
    assert why(plain, [0.25, 0.5]).alternatives[0].occurs


def test_a_scale_is_positive():
    with pytest.raises(InvalidArgumentError, match="each of scale must be a number in"):
        why(crossing(), [8.0, 2.0], scale=[1.0, 0.0])


def test_measured_features_alone_are_those_of_a_first_step():
    """With what is derived of them and the past, which is then the present."""
    schema = Schema.anonymous(2, 2).derive(["gap = x0 - x1"]).with_history(1)
    tree = DecisionTree.single_leaf(schema.n_features).split(0, 2, 0.5)
    policy = TreePolicy(tree, np.array([0, 1]), schema, history=1)
    assert why(policy, [3.0, 1.0]).action == 1
    with pytest.raises(InvalidArgumentError, match=r"observation must have 6 entries, got 3"):
        why(policy, [3.0, 1.0, 2.0])


@settings(max_examples=60, deadline=None)
@given(
    cut=st.floats(-2.0, 2.0), value=st.floats(-2.0, 2.0), width=st.sampled_from([2.0, 40.0, 9e4])
)
def test_a_change_by_the_distance_that_is_shown_is_enough(cut, value, width):
    """Distances were rounded down: of 0.0013 it said 0.0012, which changes nothing."""
    schema = Schema((Feature("speed", "", -width, width),), ("left", "right"))
    policy = TreePolicy(DecisionTree.single_leaf(1).split(0, 0, cut), [0, 1], schema)
    found = why(policy, [value])
    far = float(found.path[0].words.rpartition("by ")[2])
    assert far <= 1.2 * abs(cut - value) + 1e-5 * width
    nearest = 2.1e-6 * width  # of the range, within which numbers look the same
    moved = value + (far + nearest) * (1 if value <= cut else -1)
    assert policy.predict([moved])[0] != found.action
