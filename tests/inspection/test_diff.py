"""What changed between two policies, against a count of lattice cells."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError
from eutree.inspection import diff
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from tests.frames import Frame
from tests.inspection.lattices import lattice, lattice_policy

seeds = st.integers(0, 2**32)


@settings(max_examples=100, deadline=None)
@given(seed=seeds, n_features=st.integers(1, 3), n_actions=st.integers(1, 3))
def test_share_and_boxes_are_what_the_cells_say(seed, n_features, n_actions):
    generator = np.random.default_rng(seed)
    one, two = (lattice_policy(generator, n_features, n_actions) for _ in range(2))
    found, points = diff(one, two), lattice(one)
    before, after = one.predict(points)[0], two.predict(points)[0]
    assert found.share == pytest.approx((before != after).mean(), abs=1e-12)
    assert sum(box.share for box in found.boxes) == pytest.approx(found.share)
    for point, was, now in zip(points, before, after, strict=True):
        here = [box for box in found.boxes if box.region.contains(point)]
        expected = [(was, now)] if was != now else []
        assert [(box.first, box.second) for box in here] == expected


@settings(max_examples=50, deadline=None)
@given(seed=seeds)
def test_the_largest_comes_first_and_no_two_could_be_one(seed):
    generator = np.random.default_rng(seed)
    boxes = diff(*(lattice_policy(generator, 1) for _ in range(2))).boxes
    shares = [box.share for box in boxes]
    assert shares == sorted(shares, reverse=True)
    ends = {(float(box.region.low[0]), box.first, box.second) for box in boxes}
    assert not [b for b in boxes if (float(b.region.high[0]), b.first, b.second) in ends]


def test_recorded_steps_in_a_frame_are_read_by_its_names():
    generator = np.random.default_rng(3)
    one, two = (lattice_policy(generator, 2) for _ in range(2))
    rows = lattice(one)[::3]
    turned = Frame(rows[:, ::-1], one.schema.feature_names[::-1])
    wanted = str(diff(one, two, observations=rows))
    assert str(diff(one, two, observations=turned)) == wanted
    assert str(diff(one, two, observations=rows[:, ::-1])) != wanted


def test_a_policy_differs_nowhere_from_itself():
    policy = lattice_policy(np.random.default_rng(5), 3)
    found = diff(policy, policy)
    assert (found.share, found.boxes, found.structure) == (0.0, (), ())


def test_all_that_differs_in_words():
    schema = Schema((Feature("speed", "m/s", 0.0, 10.0),), ("brake", "go"))
    one, two = (TreePolicy(DecisionTree.single_leaf(1), np.array([n]), schema) for n in (0, 1))
    assert diff(one, two).boxes[0].words == "brake became go everywhere"


def test_a_moved_threshold_in_words():
    schema = Schema((Feature("speed", "m/s", 0.0, 10.0),), ("brake", "go"))
    tree = DecisionTree.single_leaf(1).split(0, 0, 4.0)
    policy = TreePolicy(tree, np.array([1, 0]), schema)
    moved = replace(policy, tree=replace(tree, threshold=np.array([5.0, np.nan, np.nan])))
    found = diff(policy, moved)
    assert found.share == pytest.approx(0.1)
    assert found.boxes[0].words == "brake became go where 4 < speed <= 5 m/s"
    assert found.structure == ("node 0: speed <= 4 m/s ? became speed <= 5 m/s ? (node 0)",)
    assert "another action on 10.0000% of the box" in str(found)


def test_bounds_have_the_digits_that_matter():
    """They had all of them: 4.123456789 < speed <= 5.98765."""
    schema = Schema((Feature("speed", "m/s", 0.0, 10.0),), ("brake", "go"))
    tree = DecisionTree.single_leaf(1).split(0, 0, 4.123456789)
    policy = TreePolicy(tree, np.array([1, 0]), schema)
    moved = replace(policy, tree=replace(tree, threshold=np.array([5.98765, np.nan, np.nan])))
    (box,) = diff(policy, moved).boxes
    assert box.words == "brake became go where 4.12 < speed <= 5.98 m/s"
    near = replace(tree, threshold=np.array([4.123456789 + 1e-9, np.nan, np.nan]))
    assert diff(policy, replace(policy, tree=near)).boxes == ()
    assert diff(policy, replace(policy, tree=near)).structure == ()


def test_changed_actions_and_replaced_subtrees_in_words():
    schema = Schema.anonymous(2, 2)
    tree = DecisionTree.single_leaf(2).split(0, 0, 1.0)
    policy = TreePolicy(tree, np.array([0, 1]), schema)
    other = TreePolicy(tree.split(1, 1, 2.0), np.array([1, 1, 0]), schema)
    assert set(diff(policy, other).structure) == {
        "node 1: action_0 became action_1 (node 1)",
        "node 2: action_1 became x1 <= 2 ? (node 2)",
    }


def test_infinite_bounds_reach_a_tenth_beyond_the_thresholds():
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.0)
    other = DecisionTree.single_leaf(1).split(0, 0, 10.0)
    one, two = (TreePolicy(t, np.array([0, 1]), Schema.anonymous(1, 2)) for t in (tree, other))
    assert diff(one, two).share == pytest.approx(10 / 12)


def test_other_names_are_refused():
    one = lattice_policy(np.random.default_rng(0), 2)
    with pytest.raises(
        InvalidArgumentError, match="second policy must have the features and actions of the first"
    ):
        diff(one, replace(one, schema=Schema.anonymous(2, 2)))


@settings(max_examples=50, deadline=None)
@given(seed=seeds)
def test_recorded_observations_are_counted_where_they_differ(seed):
    generator = np.random.default_rng(seed)
    one, two = (lattice_policy(generator, 2) for _ in range(2))
    rows = generator.integers(0, 13, size=(40, 2)) / 2.0  # on thresholds and bounds too
    found = diff(one, two, observations=rows)
    assert found.visited == pytest.approx((one.predict(rows)[0] != two.predict(rows)[0]).mean())
    assert found.visited == pytest.approx(sum(box.visited for box in found.boxes))
    visits = [box.visited for box in found.boxes]
    assert visits == sorted(visits, reverse=True)
    assert {box.words for box in found.boxes} == {box.words for box in diff(one, two).boxes}
    assert all(box.visited is None for box in diff(one, two).boxes)


def test_observations_say_how_wide_an_unbounded_feature_is():
    """Thresholds 0.0 and 0.1, observations from -1 to 1: the box is 2.4 wide, not 0.12."""
    schema = Schema((Feature("x"),), ("left", "right"))
    one, two = (
        TreePolicy(DecisionTree.single_leaf(1).split(0, 0, cut), np.array([0, 1]), schema)
        for cut in (0.0, 0.1)
    )
    assert diff(one, two).share == pytest.approx(0.1 / 0.12)
    rows = [[-1.0], [0.05], [1.0], [0.5]]
    found = diff(one, two, observations=rows)
    assert found.share == pytest.approx(0.1 / 2.4)
    assert found.visited == 0.25


def test_boxes_that_no_observation_meets_are_no_difference():
    """The sum of two numbers from -1 to 1 is no 4."""
    features = Feature("a", "", -1.0, 1.0), Feature("b", "", -1.0, 1.0)
    schema = Schema(features, ("go", "stop")).derive(["e = a + b"])
    one, other, real = (
        TreePolicy(DecisionTree.single_leaf(3).split(0, 2, cut), np.array([0, 1]), schema)
        for cut in (3.5, 4.5, 1.5)
    )
    assert diff(one, other).share == 0.0
    assert not diff(one, other).boxes
    assert len(diff(one, real).boxes) == 1


def cut_at(cuts, actions, feature):
    """Return a policy that acts by which of some thresholds, in rising order, a number exceeds."""
    tree = DecisionTree.single_leaf(1)
    for leaf, cut in enumerate(cuts):
        tree = tree.split(leaf, 0, cut)
    return TreePolicy(tree, np.array(actions), Schema((feature,), ("a", "b", "c")))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "feature", [Feature("x"), Feature("x", low=0.0), Feature("x", low=-1.7e308, high=1.7e308)]
)
def test_thresholds_of_any_size_leave_no_difference_out(feature):
    """A range that overflowed was wider than any box: 0.0000 % of the box, and no box."""
    largest = float(np.finfo(np.float64).max)
    for outer in (1e308, largest):
        before = cut_at([-outer, 0.0, 5.0, outer], [0, 0, 1, 0, 0], feature)
        after = cut_at([-outer, 0.0, 5.0, outer], [0, 1, 0, 1, 0], feature)
        found = diff(before, after)
        assert 0.4 < found.share <= 1.0
        rows = np.array([[-1e308], [-1.0], [1.0], [5.0], [6.0], [1.6e308]])
        rows = rows[rows[:, 0] >= feature.low]
        differs = before.decide(rows) != after.decide(rows)
        held = [sum(box.region.contains(row) for box in found.boxes) for row in rows]
        assert held == differs.astype(int).tolist()
        assert np.isfinite([box.share for box in found.boxes]).all()


def test_near_thresholds_are_two_where_something_was_observed_between_them():
    feature = Feature("x", low=-10.0, high=10.0)
    one, two = (cut_at([cut], [0, 1], feature) for cut in (4.0, 4.0 + 1e-9))
    assert diff(one, two, observations=[[1.0], [4.0]]).boxes == ()
    found = diff(one, two, observations=[[1.0], [4.0 + 5e-10]])
    assert (len(found.boxes), found.visited) == (1, 0.5)
    assert "another action on 5e-09% of the box and 50.0% of the recorded steps" in str(found)
