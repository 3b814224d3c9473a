"""Trees that keep monotone rules: always, at the least cost, and no more than that."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.inspection import keep_monotone, monotone_rules, verify
from eutree.policies import TreePolicy
from eutree.policies.leaf_statistics import LeafStatistics
from eutree.schema import Control, Feature, Schema, combined_actions
from eutree.trees import DecisionTree

NAMES = ("stop", "wait", "go")


def random_policy(seed, n_leaves, n_actions=3, n_features=3):
    rng = np.random.default_rng(seed)
    tree = DecisionTree.single_leaf(n_features)
    while tree.n_leaves < n_leaves:
        feature, cut = int(rng.integers(n_features)), float(rng.integers(1, 9))
        tree = tree.split(int(rng.integers(tree.n_leaves)), feature, cut)
    features = tuple(Feature(f"f{j}", "m", 0.0, 10.0) for j in range(n_features))
    schema = Schema(features, NAMES[:n_actions])
    return TreePolicy(tree, rng.integers(n_actions, size=n_leaves), schema)


RULES = st.lists(
    st.sampled_from(
        ["stop in f0", "stop in falling f1", "go in f2", "stop in f2 when f0 > 4", "wait in f1"]
    ),
    min_size=1,
    max_size=3,
    unique=True,
)


@settings(deadline=None, max_examples=80)
@given(st.integers(0, 10_000), st.integers(1, 14), RULES)
def test_every_result_passes_verify(seed, n_leaves, texts):
    policy = random_policy(seed, n_leaves)
    rules = monotone_rules(texts, policy.schema)
    kept = keep_monotone(policy, rules)
    for text in texts:
        assert verify(kept, f"monotone {text}").holds
        assert verify(kept, f"monotone {text}", everywhere=True).holds
    assert keep_monotone(kept, rules) is kept
    if all(verify(policy, f"monotone {text}", everywhere=True).holds for text in texts):
        assert kept is policy


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 10_000),
    st.integers(1, 12),
    st.lists(
        st.sampled_from(["valve in f0", "valve in falling f1", "fan in f0 when f2 > 4"]),
        min_size=1,
        unique=True,
    ),
)
def test_quantities_do_not_fall(seed, n_leaves, texts):
    controls = (Control("valve", "l/s", (0.0, 0.5, 1.0)), Control("fan", "", (0.0, 1.0)))
    policy = random_policy(seed, n_leaves)
    schema = Schema(policy.schema.features, combined_actions(controls), controls)
    actions = np.random.default_rng(seed).integers(6, size=n_leaves)
    policy = TreePolicy(policy.tree, actions, schema)
    rules = monotone_rules(texts, schema)
    kept = keep_monotone(policy, rules)
    for text in texts:
        assert verify(kept, f"monotone {text}", everywhere=True).holds
    assert keep_monotone(kept, rules) is kept
    if all(verify(policy, f"monotone {text}", everywhere=True).holds for text in texts):
        assert kept is policy


def test_of_a_quantity_no_more_leaves_change_than_must():
    valve = (Control("valve", "", (0.0, 1.0, 2.0, 3.0)),)
    tree = DecisionTree.single_leaf(1)
    for cut in (1.0, 2.0, 3.0, 4.0):
        tree = tree.split(tree.n_leaves - 1, 0, cut)
    schema = Schema((Feature("f0", "m", 0.0, 10.0),), combined_actions(valve), valve)
    policy = TreePolicy(tree, np.array([0, 1, 3, 2, 3]), schema)
    weights = np.ones((5, 4)) + 9.0 * np.eye(4)[policy.actions]
    weights[2, 2] = 5.0
    kept = keep_monotone(policy, monotone_rules(["valve in f0"], schema), weights)
    assert [kept.predict(np.array([x]))[0] for x in (0.5, 1.5, 2.5, 3.5, 4.5)] == [0, 1, 2, 2, 3]
    with pytest.raises(InvalidArgumentError, match="both directions of f0"):
        monotone_rules(["valve in f0", "valve in falling f0"], schema)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.integers(2, 6), st.sampled_from([2, 3]))
def test_it_costs_as_little_as_possible(seed, n_leaves, n_actions):
    """The naive twin tries every labelling."""
    policy = random_policy(seed, n_leaves, n_actions)
    worth = np.random.default_rng(seed + 1).integers(0, 30, (n_leaves, n_actions)).astype(float)
    texts = ["stop in f0", "stop in falling f1"]
    kept = keep_monotone(policy, monotone_rules(texts, policy.schema), worth)
    if kept is policy:
        return
    places = np.array([[rng.uniform(0.01, 9.99) for _ in range(3)] for rng in
                       [np.random.default_rng(k) for k in range(4000)]])  # fmt: skip
    leaf = policy.tree.leaf_index(places)
    reached = np.unique(leaf)
    best = max(
        sum(worth[k, labels[k]] for k in reached)
        for labels in itertools.product(range(n_actions), repeat=n_leaves)
        if holds(policy, labels, texts)
    )
    got = kept.actions[kept.tree.leaf_index(places)]
    mine = sum(worth[k, got[leaf == k][0]] for k in reached)
    assert mine == pytest.approx(best)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.integers(2, 5))
def test_no_leaf_names_what_is_masked_unless_it_must(seed, n_leaves):
    """The naive twin tries every labelling."""
    policy = random_policy(seed, n_leaves)
    allowed = np.random.default_rng(seed + 2).random((n_leaves, 3)) < 0.6
    allowed[np.arange(n_leaves), policy.actions] = True
    texts = ["stop in f0", "stop in falling f1"]
    rules = monotone_rules(texts, policy.schema)
    kept = keep_monotone(policy, rules, allowed=allowed)
    places = np.random.default_rng(0).uniform(0.01, 9.99, (4000, 3))
    leaf = policy.tree.leaf_index(places)
    reached, first = np.unique(leaf, return_index=True)
    got = kept.actions[kept.tree.leaf_index(places[first])]
    least = min(
        sum(not allowed[k, labels[k]] for k in reached)
        for labels in itertools.product(range(3), repeat=n_leaves)
        if holds(policy, labels, texts)
    )
    assert (~allowed[reached, got]).sum() == least


def holds(policy, labels, texts):
    labelled = TreePolicy(policy.tree, np.array(labels), policy.schema)
    return all(verify(labelled, f"monotone {text}", everywhere=True).holds for text in texts)


def test_of_two_actions_each_rule_is_one_of_the_other():
    policy = random_policy(3, 12, n_actions=2)
    for texts in (["wait in f0"], ["stop in falling f0"], ["wait in f0", "stop in falling f1"]):
        kept = keep_monotone(policy, monotone_rules(texts, policy.schema))
        assert kept is not policy
        assert all(verify(kept, f"monotone {text}").holds for text in texts)
    one, other = (
        keep_monotone(policy, monotone_rules([text], policy.schema))
        for text in ("wait in f0", "stop in falling f0")
    )
    assert one == other


def test_what_was_shown_decides_which_leaf_gives_way():
    schema = Schema((Feature("distance", "m", 0.0, 9.0),), ("go", "stop"))
    tree = DecisionTree.single_leaf(1).split(0, 0, 5.0)
    policy = TreePolicy(tree, np.array([1, 0]), schema)
    rules = monotone_rules(["monotone stop in distance"], schema)
    assert keep_monotone(policy, rules, np.array([[1.0, 9.0], [5.0, 0.0]])).actions.tolist() == [1]
    assert keep_monotone(policy, rules, np.array([[1.0, 3.0], [5.0, 0.0]])).actions.tolist() == [0]
    known = LeafStatistics(np.array([[0, 30], [3, 0]]), *np.full((2, 2, 2), np.nan))
    seen = TreePolicy(tree, np.array([1, 0]), schema, leaves=known)
    assert keep_monotone(seen, rules).actions.tolist() == [1]


def test_under_masks_no_leaf_forgets_what_it_falls_back_on():
    policy = random_policy(3, 12)
    values = np.random.default_rng(0).random((12, 3))
    known = LeafStatistics(np.full((12, 3), 9), values, values)
    masked = replace(policy, leaves=known, masked=True)
    kept = keep_monotone(masked, monotone_rules(["stop in f0"], policy.schema))
    assert kept != masked
    assert verify(kept, "monotone stop in f0").holds
    others = [[k for k in np.argsort(-row) if k != a]
              for row, a in zip(values, kept.actions, strict=True)]  # fmt: skip
    assert kept.orders[:, 1:].tolist() == others


def test_a_locked_leaf_stays():
    schema = Schema((Feature("distance", "m", 0.0, 9.0),), ("go", "stop"))
    tree = DecisionTree.single_leaf(1).split(0, 0, 5.0)
    rules = monotone_rules(["stop in distance"], schema)
    policy = TreePolicy(tree, np.array([1, 0]), schema, locked=(1,))
    kept = keep_monotone(policy, rules, np.array([[0.0, 99.0], [1.0, 0.0]]))
    assert kept.actions.tolist() == [0, 0]
    assert kept.locked == (1,)
    with pytest.raises(InvalidArgumentError, match="contradict the locked leaves"):
        keep_monotone(TreePolicy(tree, np.array([1, 0]), schema, locked=(0, 1)), rules)


@pytest.mark.parametrize(
    ("texts", "word"),
    [
        (["stop in f0", "stop in falling f0"], "both directions of f0"),
        (["stop in f0", "monotone stop in falling f0 when f1 > 3"], "both directions of f0"),
        (["stop in speed"], "unknown feature 'speed'"),
        (["brake in f0"], "unknown action 'brake'"),
        (["never stop when f0 > 3"], "unknown"),
        (["stop"], "'in'"),
    ],
)
def test_a_wrong_rule_is_one_line(texts, word):
    with pytest.raises(InvalidArgumentError, match=r"^[^\n]*$") as raised:
        monotone_rules(texts, random_policy(0, 3).schema)
    assert word in str(raised.value)


def test_opposite_rules_of_places_that_do_not_meet_are_fine():
    schema = random_policy(0, 3).schema
    texts = ["stop in f0 when f1 < 3", "stop in falling f0 when f1 > 3"]
    assert len(monotone_rules(texts, schema)) == 2


def test_an_unknown_name_is_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'stop'"):
        monotone_rules(["stp in f0"], random_policy(0, 3).schema)
