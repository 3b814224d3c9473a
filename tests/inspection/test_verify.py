"""Properties: proofs and counter-examples, against a lattice on which nothing can hide."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.inspection import verify
from eutree.inspection.properties import parse
from eutree.policies import TreePolicy
from eutree.schema import Control, Feature, Schema
from eutree.trees import DecisionTree
from tests.inspection.lattices import lattice_policy

seeds = st.integers(0, 2**32)
# Bounds and thresholds are whole, so whole numbers and halves meet every case there is.
HALVES = np.arange(0, 6.25, 0.5)


def points(n_features):
    return np.array(list(itertools.product(HALVES, repeat=n_features)))


@settings(max_examples=120, deadline=None)
@given(
    seed=seeds,
    kind=st.sampled_from(["never", "always"]),
    low=st.integers(0, 5),
    width=st.integers(1, 4),
    strict=st.booleans(),
)
def test_never_and_always_are_what_the_lattice_says(seed, kind, low, width, strict):
    policy = lattice_policy(np.random.default_rng(seed), 2)
    sign = "<" if strict else "<="
    found = verify(policy, f'{kind} "do 1" when {low} {sign} x0 {sign} {low + width} and x1 > 2')
    place = points(2)
    x0, x1 = place.T
    inside = (low < x0) & (x0 < low + width) if strict else (low <= x0) & (x0 <= low + width)
    asked = place[inside & (x1 > 2)]
    actions = policy.predict(asked)[0]
    breaks = actions == 1 if kind == "never" else actions != 1
    assert found.holds == (not breaks.any())
    for example in found.counter_examples:
        assert example.region.contains(example.point)
        assert policy.predict(example.point)[0] == example.action
        assert (example.action == 1) == (kind == "never")
    hit = np.array([any(e.region.contains(p) for e in found.counter_examples) for p in asked])
    assert hit.tolist() == breaks.tolist()


@settings(max_examples=120, deadline=None)
@given(seed=seeds, n_features=st.integers(1, 2), falls=st.booleans())
def test_monotonicity_is_what_the_lattice_says(seed, n_features, falls):
    policy = lattice_policy(np.random.default_rng(seed), n_features, n_actions=3)
    found = verify(policy, f'monotone "do 1" in {"falling " if falls else ""}x0')
    lines = policy.predict(points(n_features))[0].reshape(HALVES.size, -1)
    lines = lines[::-1] if falls else lines
    leaves_it = [
        bool((line[start:] != 1).any())
        for line in lines.T
        for start in range(HALVES.size)
        if line[start] == 1
    ]
    assert found.holds == (not any(leaves_it))
    for example in found.counter_examples:
        assert policy.predict(example.point)[0] == 1
        assert policy.predict(example.raised)[0] == example.action != 1
        change = example.raised - example.point
        assert (change[0] < 0) == falls
        assert not change[1:].any()


@settings(max_examples=60, deadline=None)
@given(seed=seeds, n_rows=st.integers(0, 30))
def test_dead_leaves_are_those_that_no_row_reaches(seed, n_rows):
    generator = np.random.default_rng(seed)
    policy = lattice_policy(generator, 2)
    rows = generator.random((n_rows, 2)) * 6
    found = verify(policy, "no dead leaves", observations=rows)
    dead = set(range(policy.n_leaves)) - set(policy.tree.leaf_index(rows).tolist())
    assert {example.leaf for example in found.counter_examples} == dead
    assert found.holds == (not dead)


def one_cut():
    schema = Schema((Feature("position", "m", 0.0, 30.0),), ("stop", "go"))
    return TreePolicy(DecisionTree.single_leaf(1).split(0, 0, 8.0), np.array([1, 0]), schema)


@pytest.mark.parametrize(
    ("question", "holds"),
    [
        ("never go when position > 8", True),
        ("never go when position >= 8", False),
        ("always go when position <= 8", True),
        ("always go when position < 8.000000000000002", True),
        ("always go when position <= 8.000000000000002", False),
        ("never stop when position = 8", True),
        ("always stop when 8 < position", True),
        ("monotone stop in position", True),
        ("monotone go in position", False),
        ("monotone go in falling position", True),
        ("monotone go in position when position <= 8", True),
    ],
)
def test_answers_are_exact_to_the_last_place(question, holds):
    assert verify(one_cut(), question).holds is holds


def test_one_leaf_is_a_leaf():
    found = verify(one_cut(), "always go when position <= 5")
    assert str(found).endswith("(1 leaf checked)"), str(found)
    alone = TreePolicy(DecisionTree.single_leaf(1), np.array([1]), one_cut().schema)
    assert str(verify(alone, "never go")) == "refuted: never go; go everywhere (leaf 0)"


def test_a_refutation_in_words():
    found = verify(one_cut(), "never go when position <= 10")
    assert str(found) == (
        "refuted: never go when position <= 10; go where position <= 8 m (leaf 0)"
    )
    assert found.share == pytest.approx(0.8)
    assert "proven" in str(verify(one_cut(), "never go when position > 8"))


def test_a_proof_says_that_nothing_asks_for_the_feature():
    """That discharge is monotone in price was proven for a tree that never asks for price."""
    schema = Schema((Feature("position", "m", 0.0, 30.0), Feature("price")), ("stop", "go"))
    policy = TreePolicy(DecisionTree.single_leaf(2).split(0, 0, 8.0), np.array([1, 0]), schema)
    assert "(2 leaves checked; no test asks for price)" in str(
        verify(policy, "monotone go in price")
    )
    near = verify(one_cut(), "monotone go in position when position <= 8")
    assert near.note == "no test there asks for position"
    assert verify(one_cut(), "monotone stop in position").note == ""


def test_bounds_of_the_features_count_unless_everywhere():
    policy = one_cut()
    assert verify(policy, "always stop when position > 8").holds
    with pytest.raises(InvalidArgumentError, match="must hold somewhere within the bounds"):
        verify(policy, "always go when position < -1")
    assert verify(policy, "always go when position < -1", everywhere=True).holds


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ("", "a property at its end"),
        ("newer go", "Did you mean 'never'"),
        ("never fly", "unknown action 'fly'"),
        ("never go when speed < 3", "unknown feature 'speed'"),
        ("never go when position", "a comparison at its end"),
        ("never go when position < x", "a number, got 'x'"),
        ("never go when 3 < position < 2", "conditions that some observation meets"),
        ("never go position", "its end, got 'position'"),
        ("monotone go position", "'in', got 'position'"),
        ("never go when position < nan", "a number, got 'nan'"),
        ("dead leaves", "dead leaves need recorded observations"),
    ],
)
def test_mistakes_are_named(question, message):
    with pytest.raises((InvalidArgumentError, UnknownNameError), match=message):
        verify(one_cut(), question)


@pytest.mark.parametrize(
    ("text", "action", "feature"),
    [
        ("never do it when turn rate <= 1", 1, 1),
        ("never do when turn rate, 1 ago <= 1", 0, 2),
        ("never do when turn <= 1", 0, 0),
        ('never "do it" when 0 < "turn rate" <= 1', 1, 1),
        ("monotone do it in falling turn rate when turn rate > 1", 1, 1),
    ],
)
def test_names_can_be_typed_as_they_are_printed(text, action, feature):
    """``never action 0 when turn rate > 1`` was refused: names with blanks needed inner quotes."""
    features = tuple(map(Feature, ("turn", "turn rate", "turn rate, 1 ago")))
    found = parse(text, Schema(features, ("do", "do it")))
    assert found.actions == {action}
    limited = np.isfinite(found.regions[0].high) | np.isfinite(found.regions[0].low)
    assert np.flatnonzero(limited).tolist() == [feature]


def test_names_with_blanks_stand_in_quotes():
    schema = Schema((Feature("when, 1 ago"), Feature('a "b"')), ("go on", "stop"))
    found = parse(r'never "go on" when 1 < "when, 1 ago" and "a \"b\"" <= 3', schema)
    assert (found.kind, found.actions) == ("never", {0})
    assert (found.regions[0].low.tolist(), found.regions[0].high.tolist()) == (
        [1.0, -np.inf],
        [np.inf, 3.0],
    )


def test_a_proof_about_a_masked_policy_says_what_it_takes_for_granted():
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.0)
    schema = Schema((Feature("x", "", -1.0, 1.0),), ("off", "on", "dump"))
    policy = TreePolicy(tree, np.array([0, 1]), schema, masked=True)
    answer = verify(policy, "never dump")
    assert answer.holds
    assert "where all actions are allowed: masks may choose another" in str(answer)
    assert int(policy.predict([0.5], action_masks=np.array([0, 0, 1], dtype=bool))[0]) == 2
    assert verify(replace(policy, masked=False), "never dump").note == ""


@pytest.mark.parametrize("bound", [np.inf, 1e200])
@pytest.mark.parametrize(
    ("formula", "threshold"),
    [
        ("min(a * a - a * a, 5)", 100.0),
        ("1 / (a * a - a * a)", 2e9),
        ("a * a * 0", 3.0),
        ("5 if a * a - a * a < 1 else 7", 6.0),
    ],
)
def test_what_is_no_number_takes_the_right_branch_in_proofs_too(formula, threshold, bound):
    """Squares overflow, and infinity less infinity is no number."""
    schema = Schema((Feature("a", "", -bound, bound),), ("go", "stop")).derive([f"d = {formula}"])
    tree = DecisionTree.single_leaf(2).split(0, 1, threshold)
    policy = TreePolicy(tree, np.array([0, 1]), schema)
    answer = verify(policy, "never stop")
    assert not answer.holds
    (example,) = answer.counter_examples
    assert example.occurs
    assert int(policy.predict(example.point[:1])[0]) == 1
    small = replace(policy, schema=Schema((Feature("a", "", -9.0, 9.0),), ("go", "stop")).derive(
        [f"d = {formula}"]
    ))  # fmt: skip
    assert verify(small, "never stop").holds


def test_all_comparisons_take_a_level_for_what_is_shown_of_it():
    levels = (0.0, 0.1 + 0.2, 50.0)
    names = ("valve 0 %", "valve 0.3 %", "valve 50 %")
    schema = Schema((Feature("level", "m", 0.0, 2.0),), names, (Control("valve", "%", levels),))
    policy = TreePolicy(DecisionTree.single_leaf(1).split(0, 0, 1.0), np.array([0, 1]), schema)
    for words in (
        "always valve = 0.3 when level > 1",
        "always valve <= 0.3",
        "never valve > 0.3",
        "always valve >= 0.3 when level > 1",
        "never valve < 0.3 when level > 1",
    ):
        assert verify(policy, words).holds, words


def test_categories_with_commas_stand_in_quotes():
    kinds = ("a,b", "c and d", "e")
    schema = Schema(
        (Feature("c", "", 0.0, 2.0, is_integer=True, categories=kinds),), ("go", "stop")
    )
    policy = TreePolicy(DecisionTree.single_leaf(1).split(0, 0, 0.5), np.array([0, 1]), schema)
    assert verify(policy, 'always go when c is "a,b"').holds
    assert verify(policy, 'always stop when c is "c and d",e').holds
    assert 'c is "a,b"' in str(verify(policy, "never go"))


def test_bounds_that_say_nothing_do_not_round_what_is_shown():
    end = float(np.finfo(np.float32).max)
    schema = Schema((Feature("x", "", -end, end),), ("go", "stop"))
    policy = TreePolicy(DecisionTree.single_leaf(1).split(0, 0, 0.5), np.array([0, 1]), schema)
    assert "stop where x > 0.5" in str(verify(policy, "never stop"))


@pytest.mark.filterwarnings("error")
def test_bounds_that_are_the_largest_doubles():
    end = float(np.finfo(np.float64).max)
    schema = Schema((Feature("x", "", -end, end),), ("go", "stop"))
    policy = TreePolicy(DecisionTree.single_leaf(1).split(0, 0, 0.0), np.array([0, 1]), schema)
    assert verify(policy, "never stop").share == pytest.approx(0.5)
