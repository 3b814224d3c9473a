"""Derived features of earlier steps: they are made of what was measured then."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree import verify, why
from eutree.errors import InvalidArgumentError
from eutree.export import export
from eutree.features import Derivation, FeatureMap, formulas_of
from eutree.inspection import monotone_rules
from eutree.policies import TreePolicy
from eutree.report.tree_data import tree_data
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.text import definitions
from tests import naive_trees
from tests.random_formulas import formulas_of as random_formulas

NAMES = ("a", "b")
PAIR = Schema(tuple(Feature(name, low=0.0, high=2.0) for name in NAMES), ("stop", "go"))
WHOLE = Schema(
    tuple(Feature(name, low=-1.0, high=1.0, is_integer=True) for name in NAMES), ("go", "stop")
)


def asking(schema, name, cut, **past):
    """Return a policy that stops up to a cut of one feature."""
    tree = DecisionTree.single_leaf(schema.n_features)
    tree = tree.split(0, schema.feature_names.index(name), cut)
    return TreePolicy(tree, np.array([0, 1]), schema, **past)


def leading(cut):
    """Return a policy that stops up to a lead of one step ago."""
    return asking(PAIR.derive(["lead = a - b"]).with_history(1), "lead, 1 ago", cut, history=1)


def rows_of(schema, steps, measured):
    """Return the features of an episode, derived and past ones included, as a policy sees them."""
    seen = Derivation.of(schema).of_episode(np.array(measured, dtype=np.float64))
    stacked = FeatureMap(n_observed=schema.n_features, n_actions=2, observations=steps)
    return stacked.of_episode(seen, np.zeros(len(seen) - 1, dtype=np.int64))


@settings(max_examples=25, deadline=None)
@given(
    texts=st.lists(random_formulas(*NAMES, "2", "last(a)", "last(b)", most=6), min_size=1,
                   max_size=2),
    steps=st.integers(0, 3),
    seed=st.integers(0, 2**32),
)  # fmt: skip
def test_every_step_is_made_of_its_own_numbers(texts, steps, seed):
    """Of the first one, too, which stands for those before it."""
    declared = [f"f = {texts[0]}", f"g = f - last(f) + {texts[-1]}"]
    schema = PAIR.derive(declared)
    formulas = formulas_of(schema.with_history(steps))
    size = schema.n_features
    assert set(formulas) == {k * size + j for k in range(steps + 1) for j in (2, 3)}
    for row in rows_of(schema, steps, np.random.default_rng(seed).random((6, 2))).tolist():
        for j, formula in formulas.items():
            if formula.remembers:  # what was before the earliest step
                assert j >= steps * size
            else:
                assert formula.compute(row, row.__getitem__) == row[j]


@settings(max_examples=25, deadline=None)
@given(
    text=random_formulas(*NAMES, "2", "0.5", "last(a)", most=5),
    seed=st.integers(0, 2**32),
    question=st.sampled_from(
        ["never stop", "always go when b >= 0", 'never stop when "a, 1 ago"<1']
    ),
)
def test_answers_are_those_of_all_episodes(text, seed, question):
    known, generator = WHOLE.derive([f"f = {text}"]), np.random.default_rng(seed)
    schema = known.with_history(1)
    tree = naive_trees.random_tree(generator, int(generator.integers(2, 7)), 6, n_values=4)
    policy = TreePolicy(tree, generator.integers(0, 2, tree.n_leaves), schema, history=1)
    one = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=2)))
    derivation, before, rows = Derivation.of(known), None, []
    for place in np.indices((9, 9, 9)).reshape(3, -1):  # all episodes of three steps
        before = derivation.rows(one[place], before)
        last = policy.features.next(rows[-1], 0, before) if rows else policy.features.first(before)
        rows.append(last)
    rows = np.concatenate(rows)
    asked = {"never stop": rows[:, 0] < 2, "always go when b >= 0": rows[:, 1] >= 0}
    asked = rows[asked.get(question, rows[:, 3] < 1)]
    found = verify(policy, question)
    if found.holds:
        assert (policy.decide(asked) == 0).all()
    for example in found.counter_examples:
        assert example.occurs
        columns = slice(None, 5 if derivation.remembered else None)  # the last is free
        assert (asked == example.point)[:, columns].all(axis=1).any()
        assert policy.decide(example.point) == 1


def test_what_was_derived_a_step_ago_is_proven_and_refuted_as_it_was_derived():
    assert verify(leading(5.0), "never go").holds
    assert verify(leading(1.0), 'never go when "a, 1 ago" <= 1').holds
    (example,) = verify(leading(1.0), "never go").counter_examples
    a, b, lead = example.point[3:].tolist()
    assert example.occurs
    assert lead == a - b > 1.0
    assert example.point[2] == example.point[0] - example.point[1]


def test_a_last_value_is_that_of_the_step_among_the_features():
    schema = PAIR.derive(["turn = a - last(a)"]).with_history(1)
    policy = asking(schema, "turn", 0.5, history=1)
    assert verify(policy, "never go when a <= 0.5").holds
    (example,) = verify(policy, "never go").counter_examples
    assert example.point[2] == example.point[0] - example.point[3] > 0.5
    with pytest.raises(InvalidArgumentError, match=r"turn, which .* is made of a, 1 ago"):
        verify(policy, 'monotone stop in "a, 1 ago"')
    earliest = asking(schema, "turn, 1 ago", 5.0, history=1)
    assert not verify(earliest, "never go").holds  # the step before may have been anything


def test_nothing_is_proven_monotone_in_the_past_of_what_a_test_is_made_of():
    policy = leading(1.0)
    with pytest.raises(InvalidArgumentError, match=r"lead, 1 ago, which .* is made of a, 1 ago"):
        verify(policy, 'monotone go in "a, 1 ago"')
    with pytest.raises(InvalidArgumentError, match=r"lead, 1 ago, which .* is made of b, 1 ago"):
        monotone_rules(['stop in "b, 1 ago"'], policy.schema)
    assert verify(policy, "monotone go in a").holds
    assert verify(policy, 'monotone go in "lead, 1 ago"').holds


def test_rules_define_what_was_derived_a_step_ago():
    policy = leading(1.0)
    assert str(policy).splitlines()[-1] == "where lead = a - b"
    assert export(policy, "text").splitlines()[-1] == "where lead = a - b"
    twice = PAIR.derive(["lead = a - b", "far = abs(lead)", "sum = a + b"]).with_history(2)
    assert definitions(asking(twice, "far, 2 ago", 1.0).tree, twice) == [
        "where lead = a - b",
        "where far = abs(lead)",
    ]


def test_the_past_of_what_a_test_is_made_of_is_no_axis_of_the_slice():
    parts = [one["name"] for one in tree_data(leading(1.0), ())["features"] if one["isPart"]]
    assert parts == ["a, 1 ago", "b, 1 ago"]


def test_an_alternative_with_another_past_is_said_to_be_none():
    """`go from lead, 1 ago > 1 on`, with 1 and 1 one step ago."""
    (found,) = why(leading(1.0), [1.0, 1.0]).alternatives
    assert not found.occurs
    assert found.words.endswith("do not fit its measured ones)")


def test_what_is_made_of_a_remembered_feature_fits_it():
    """After -1 the policy itself makes of 0 what was said to be none."""
    schema = PAIR.derive(["turn = a - last(a)", "twice = 2 * turn"])
    policy = asking(schema, "a", 0.5)
    _, state = policy.predict([0.0, 0.0])
    _, state = policy.predict([1.0, 0.0], state)
    assert state.tolist() == [1.0, 0.0, 1.0, 2.0]
    (found,) = why(policy, state).alternatives
    assert found.occurs
    assert found.observation.tolist() == [0.5, 0.0, 1.0, 2.0]
    (found,) = why(asking(schema, "twice", 0.5), state).alternatives
    assert not found.occurs


@pytest.mark.parametrize("more", [["a, 1 ago"], ["a, 1 ago", "b, 1 ago", "lead before"]])
def test_what_is_named_otherwise_is_no_past(more):
    known = PAIR.derive(["lead = a - b"])
    schema = Schema((*known.features, *map(Feature, more)), known.actions)
    assert list(formulas_of(schema)) == [2]


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (0.0, 2.0), (0.0, 0.0)])
@pytest.mark.parametrize("formula", ["-1 / a", "a / a", "-1e308 * 100 * a", "min(-1 / a, b)"])
def test_a_leaf_is_reached_though_what_it_does_not_ask_for_is_infinite(formula, low, high):
    features = (Feature("a", low=low, high=high), Feature("b", low=0.0, high=1.0))
    schema = Schema(features, ("stop", "go")).derive([f"far = {formula}"])
    assert not verify(asking(schema, "b", 0.5), "never go").holds
