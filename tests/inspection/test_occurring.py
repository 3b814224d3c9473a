"""Boxes of derived features: what no observation meets is no counter-example."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.features import Derivation
from eutree.formulas import ON_RANGES, parse
from eutree.inspection import occurring, verify
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from tests import naive_trees
from tests.random_formulas import formulas_of

NAMES = ("a", "b", "c")
WHOLE = Schema(
    tuple(Feature(name, low=-1.0, high=2.0, is_integer=True) for name in NAMES), ("go", "stop")
)
VALUES = np.arange(-1.0, 3.0)
PARTS = (*NAMES, "2", "0.5")


@settings(max_examples=100, deadline=None)
@given(
    text=formulas_of(*PARTS, most=6),
    seed=st.integers(0, 2**32),
    question=st.sampled_from(["never stop when f > -1 and a < 2", "always go when b >= 1"]),
)
def test_what_is_derived_counts_only_as_it_is_derived(text, seed, question):
    schema, generator = WHOLE.derive([f"f = {text}"]), np.random.default_rng(seed)
    tree = naive_trees.random_tree(generator, int(generator.integers(1, 9)), 4, n_values=4)
    policy = TreePolicy(tree, generator.integers(0, 2, tree.n_leaves), schema)
    rows = Derivation.of(schema).rows(np.array(list(itertools.product(VALUES, repeat=3))))
    a, b, _, f = rows.T
    asked = rows[(f > -1) & (a < 2) if question.startswith("never") else b >= 1]
    if not len(asked):
        with pytest.raises(ValueError, match="must hold somewhere"):
            verify(policy, question)
        return
    found = verify(policy, question)
    assert found.holds == (policy.predict(asked)[0] == 0).all()
    for example in found.counter_examples:
        assert example.occurs
        assert (rows == example.point).all(axis=1).any()
        assert policy.predict(example.point)[0] == example.action == 1


@settings(max_examples=100, deadline=None)
@given(
    text=formulas_of(*PARTS, "last(a)", "last(c)"),
    ends=st.lists(st.floats(-9, 9), min_size=6, max_size=6),
    seed=st.integers(0),
)
def test_ranges_hold_what_formulas_give(text, ends, seed):
    low, high = np.sort(np.reshape(ends, (2, 3)), axis=0)
    known = parse(text, NAMES)
    least, most = known.compute(
        list(zip(low, high, strict=True)), lambda j: (low[j], high[j]), ON_RANGES
    )
    generator = np.random.default_rng(seed)
    for shares in np.round(generator.random((50, 2, 3)) * 4) / 4:  # corners and middles, too
        now, before = np.clip(low + shares * (high - low), low, high)
        assert least <= known.compute(now, before.__getitem__) <= most


@pytest.mark.parametrize("text", ["a - 2 * b + 0.3 * c", "a / b", "abs(a) - max(b, c)"])
def test_ranges_are_no_wider_where_each_feature_is_named_once(text):
    low, middle, high = np.array([[-1.0, 0.5, 2.0], [0.0, 1.0, 2.0], [3.0, 2.5, 2.0]])
    known = parse(text, NAMES)
    ranges = known.compute(list(zip(low, high, strict=True)), None, ON_RANGES)
    ends = [
        known.compute(one, None) for one in itertools.product(*zip(low, middle, high, strict=True))
    ]
    assert ranges == (min(ends), max(ends))


def leaning(low, high):
    """Return a policy of doubles that stops where a weighted sum is above 1."""
    schema = Schema(tuple(Feature(name, low=low, high=high) for name in NAMES), ("go", "stop"))
    schema = schema.derive(["lean = a - 0.7 * b + 2.1 * c"])
    tree = DecisionTree.single_leaf(4).split(0, 3, 1.0)
    return TreePolicy(tree, np.array([0, 1]), schema)


@pytest.mark.parametrize("end", [5.0, np.inf])
def test_a_sum_is_proven_and_refuted_by_what_is_measured(end):
    policy = leaning(-end, end)
    assert verify(policy, "never stop when a <= 0.4 and b >= -0.2 and 0 <= c <= 0.2").holds
    assert verify(policy, "always stop when a > 3 and b < 1 and c >= 0").holds
    found = verify(policy, "never stop when a <= 0.5 and b >= -0.2 and 0 <= c <= 0.2")
    (example,) = found.counter_examples
    assert example.occurs
    assert policy.predict(example.point[:3])[0] == example.action == 1
    assert (example.point == policy.derivation.rows(example.point[:3])).all()
    assert example.point[0] <= 0.5
    assert example.point[1] >= -0.2


def test_the_very_last_double_counts():
    policy = leaning(-5.0, 5.0)
    when = "when b = 0 and c = 0"
    assert verify(policy, f"never stop {when} and a <= 1").holds
    beyond = float(np.nextafter(1.0, 2.0))
    (example,) = verify(policy, f"never stop {when} and a <= {beyond!r}").counter_examples
    assert example.point.tolist() == [beyond, 0.0, 0.0, beyond]


def test_one_category_of_a_group_is_chosen():
    kinds = [
        Feature(f"kind is {one}", low=0, high=1, is_integer=True, group="kind") for one in "xyz"
    ]
    schema = Schema((*kinds, Feature("load", low=0.0, high=4.0)), ("go", "stop"))
    schema = schema.derive(['pull = load if "kind is y" > 0.5 else load / 2'])
    tree = DecisionTree.single_leaf(5).split(0, 4, 2.0)
    policy = TreePolicy(tree, np.array([0, 1]), schema)
    assert verify(policy, "never stop when kind is x, z").holds
    (example,) = verify(policy, "never stop when load < 3").counter_examples
    assert example.point[:3].tolist() == [0.0, 1.0, 0.0]
    assert 2.0 < example.point[3] == example.point[4] < 3.0


def test_raising_a_feature_switches_only_where_something_is_observed():
    features = [Feature("d", low=0.0, high=9.0), *(Feature(n, low=-5.0, high=5.0) for n in "bc")]
    schema = Schema(tuple(features), ("go", "stop")).derive(["far = b - c"])
    tree = DecisionTree.single_leaf(4).split(0, 3, 8.0).split(1, 0, 3.0)
    policy = TreePolicy(tree, np.array([0, 0, 1]), schema)
    assert verify(policy, "monotone go in d when b <= 2").holds
    (example,) = verify(policy, "monotone go in d when b > 4").counter_examples
    assert example.point[0] <= 3.0 < example.raised[0]
    assert example.point[3] == example.point[1] - example.point[2] > 8.0


def test_what_came_before_may_have_been_anything():
    schema = WHOLE.derive(["turn = a - last(a)", "both = turn + b"])
    tree = DecisionTree.single_leaf(5).split(0, 4, 8.5)
    policy = TreePolicy(tree, np.array([0, 1]), schema)
    assert verify(policy, "never stop when turn <= 6").holds
    (example,) = verify(policy, "never stop").counter_examples
    assert example.point[4] == example.point[3] + example.point[1] > 8.5


@pytest.mark.parametrize("end", [6.0, np.inf])
def test_where_nothing_is_derived_a_point_is_the_middle_of_its_box(end):
    schema = Schema((Feature("a", low=-end, high=end), Feature("b", low=0.0)), ("go", "stop"))
    tree = DecisionTree.single_leaf(2).split(0, 0, 1.0).split(1, 1, 100.0)
    policy = TreePolicy(tree, np.array([0, 1, 1]), schema)
    for everywhere in (False, True):
        for example in verify(policy, "never stop", everywhere=everywhere).counter_examples:
            assert example.occurs
            assert example.point.tolist() == example.region.point(schema).tolist()
    largest = float(np.finfo(np.float64).max)
    with np.errstate(over="ignore"):  # the next double is infinite
        assert not verify(policy, f"never stop when b > {largest!r}", everywhere=True).holds


def test_everywhere_means_all_doubles():
    schema = WHOLE.derive(["f = a + b"])
    tree = DecisionTree.single_leaf(4).split(0, 3, 0.25).split(1, 3, 0.75)
    policy = TreePolicy(tree, np.array([0, 1, 0]), schema)
    assert verify(policy, "never stop").holds
    (example,) = verify(policy, "never stop", everywhere=True).counter_examples
    assert 0.25 < example.point[0] + example.point[1] == example.point[3] <= 0.75


def test_what_is_not_found_out_is_said(monkeypatch):
    monkeypatch.setattr(occurring, "MOST_PARTS", 0)
    found = verify(leaning(-5.0, 5.0), "never stop when a <= 0.4 and b >= -0.2 and 0 <= c <= 0.2")
    (example,) = found.counter_examples
    assert not example.occurs
    assert str(found).endswith("(leaf 1); no such observation was found, nor that there is none")


def test_nought_times_infinity_is_reckoned_with():
    """It takes the right branch; among the ends of a range that holds 0 it is not."""
    features = tuple(Feature(name, low=-1.0, high=1.0) for name in "ab")
    schema = Schema(features, ("go", "stop")).derive(["d = min(a * 1e308 * 1000 * b, 5)"])
    policy = TreePolicy(DecisionTree.single_leaf(3).split(0, 2, 5.0), np.array([0, 1]), schema)
    assert policy.decide(policy.derivation.rows(np.array([[1.0, 0.0]]))) == 1
    assert not verify(policy, "always go").holds
