"""A rule that is enforced holds, nothing else changes, and learning keeps it."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import eutree
from eutree.errors import InvalidArgumentError
from eutree.inspection import edit, enforce, verify
from eutree.policies import TreePolicy
from eutree.policies.reach import within_kinds
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from tests import naive_trees
from tests.inspection.crossings import crossing
from tests.inspection.lattices import lattice, lattice_policy


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_the_rule_holds_and_no_other_decision_changes(seed):
    generator = np.random.default_rng(seed)
    policy = lattice_policy(generator, 2)
    name = policy.schema.features[int(generator.integers(2))].name
    low, high = sorted(generator.choice(np.arange(-1.0, 8.0, 0.5), 2, replace=False).tolist())
    rule = f'always "do 1" when {low} < "{name}" <= {high}'
    new = enforce(policy, rule).policy
    assert verify(new, rule, everywhere=True).holds
    points = lattice(policy)
    values = points[:, policy.schema.feature_names.index(name)]
    inside = (low < values) & (values <= high)
    expected = np.where(inside, 1, policy.predict(points)[0])
    assert new.predict(points)[0].tolist() == expected.tolist()


def test_two_rules_hold_together_and_their_leaves_are_locked():
    rules = ["always stop when position <= 2 and gap < 0", "never stop when position > 20"]
    edited = enforce(crossing(), rules)
    assert all(verify(edited.policy, rule).holds for rule in rules)
    assert len(edited.policy.locked) == 2
    assert edited.changes[1] == "never stop when position > 20: a rule of its own now, locked"


def test_earlier_locks_stay_and_are_not_contradicted():
    locked = edit(crossing(), lock=[0]).policy
    with pytest.raises(InvalidArgumentError, match=r"must not contradict leaf .* locked on go"):
        enforce(locked, "always stop when position <= 30")
    rule = "always stop when position > 20"
    once = enforce(crossing(), rule).policy
    again = enforce(once, "always go when position <= 1").policy
    assert verify(again, rule).holds
    assert len(again.locked) == 2


KINDS = Schema(
    (
        *(Feature(f"mode is {one}", "", 0.0, 1.0, True, group="mode") for one in "ABC"),
        Feature("count", low=0.0, high=4.0, is_integer=True),
        Feature("level", low=0.0, high=5.0),
    ),
    ("wait", "go", "stop"),
)


def of_kinds(size, generator):
    """Return random observations of these kinds."""
    codes = np.eye(3)[generator.integers(3, size=size)]
    return np.column_stack([codes, generator.integers(5, size=size), 5 * generator.random(size)])


@pytest.mark.parametrize("rule", ["mode is C", "mode is B, C", "count = 2", "1 <= count <= 3"])
@pytest.mark.parametrize("seed", range(8))
def test_what_is_left_of_the_tree_can_be_reached(rule, seed):
    """Below `mode is C` the tree asked for `mode is A`; nothing was said of such leaves."""
    generator = np.random.default_rng(seed)
    tree = naive_trees.random_tree(generator, 24, 5, n_values=5)
    policy = within_kinds(TreePolicy(tree, generator.integers(3, size=tree.n_leaves), KINDS))
    text = f"always stop when {rule}"
    edited = enforce(policy, text)
    assert verify(edited.policy, text).holds
    rows = of_kinds(2000, generator)
    mode, count = rows[:, :3].argmax(axis=1), rows[:, 3]
    inside = {
        "mode is C": mode == 2,
        "mode is B, C": mode >= 1,
        "count = 2": count == 2,
        "1 <= count <= 3": (count >= 1) & (count <= 3),
    }[rule]
    expected = np.where(inside, 2, policy.predict(rows)[0])
    assert edited.policy.predict(rows)[0].tolist() == expected.tolist()
    assert within_kinds(edited.policy) is edited.policy
    beyond = [f"no observation reaches leaf {leaf}" for leaf in unreached(edited.policy)]
    assert list(edited.warnings) == beyond


def unreached(policy):
    """Return the leaves outside of the bounds of `level` and `count`."""
    low, high = leaf_boxes(policy.tree)
    outside = (high[:, 3:] < 0) | (low[:, 3:] >= [4, 5])
    return np.flatnonzero(outside.any(axis=1)).tolist()


def test_a_leaf_beyond_the_bounds_stays_and_is_named():
    """Observations may lie beyond them, so no decision is dropped."""
    features = (Feature("level", "m", 0.0, 5.0), Feature("flow"))
    policy = TreePolicy(
        DecisionTree.single_leaf(2).split(0, 1, 0.0), np.array([0, 1]), Schema(features, ("a", "b"))
    )
    assert enforce(policy, "always a when level <= 4").warnings == ()
    edited = enforce(policy, "always a when level <= 5")
    assert edited.policy.predict([6.0, 1.0])[0] == 1
    dead = np.flatnonzero(leaf_boxes(edited.policy.tree)[0][:, 0] >= 5.0).tolist()
    assert len(dead) == 2
    assert edited.warnings == tuple(f"no observation reaches leaf {leaf}" for leaf in dead)


def test_what_is_no_rule_about_one_action_is_refused():
    with pytest.raises(InvalidArgumentError, match="must be 'always ACTION when CONDITIONS'"):
        enforce(crossing(), "monotone go in position")


def test_learning_goes_on_around_the_rule():
    env = gymnasium.make("eutree/Evasion2-v0")
    demonstrations = eutree.record(env, eutree.experts.wait_at_crossing, episodes=5, seed=0)
    rule = "always stop when position <= 3 and -2 <= opponent_1 <= 2"
    expert = enforce(eutree.fit_expert_tree(demonstrations), rule).policy
    learned = eutree.learn(
        env, demonstrations=demonstrations, expert=expert, episodes=40, evaluate_every=40, seed=0
    ).policy
    assert verify(learned, rule).holds
