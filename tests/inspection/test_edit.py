"""Edits by hand are checked, and what is locked stays, whatever is learned around it."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import eutree
from eutree.errors import FormatError, InvalidArgumentError, UnknownNameError
from eutree.inspection import diff, edit, numbered
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from tests.inspection.crossings import crossing
from tests.inspection.lattices import lattice, lattice_policy


def test_a_threshold_and_an_action_change_and_nothing_else():
    edited = edit(crossing(), thresholds={0: 9.0}, actions={1: "stop"})
    assert edited.changes == (
        "node 0: position <= 8 m became position <= 9 m",
        "leaf 1: go became stop",
    )
    assert edited.policy.tree.threshold[[0, 1]].tolist() == [9.0, 2.5]
    assert edited.policy.actions.tolist() == [0, 0, 1]
    assert edited.warnings == ()
    assert edit(crossing()).policy == crossing()


def test_a_leaf_that_nothing_reaches_any_more_is_named():
    schema = Schema((Feature("x", "", 0.0, 10.0),), ("a", "b"))
    tree = DecisionTree.single_leaf(1).split(0, 0, 4.0).split(1, 0, 6.0)
    policy = TreePolicy(tree, np.array([0, 1, 0]), schema)
    assert edit(policy, thresholds={0: 5.0}).warnings == ()
    assert edit(policy, thresholds={0: 7.0}).warnings == ("no observation reaches leaf 1 any more",)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_new_action_changes_the_decisions_of_its_leaf_only(seed):
    generator = np.random.default_rng(seed)
    policy = lattice_policy(generator, 2)
    leaf = int(generator.integers(policy.n_leaves))
    new = edit(policy, actions={leaf: "do 1"}).policy
    points = lattice(policy)
    changed = policy.predict(points)[0] != new.predict(points)[0]
    here = policy.tree.leaf_index(points) == leaf
    assert changed.tolist() == (here & (policy.actions[leaf] == 0)).tolist()
    assert diff(policy, new).share == pytest.approx(changed.mean())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"thresholds": {1: 31.0, 0: 31.0}}, r"threshold of position must be a number in \[0, 30"),
        ({"thresholds": {9: 1.0}}, "node must be an integer from 0 to 4, got 9"),
        ({"thresholds": {2: 1.0}}, "node must be a test, got 2, leaf 1"),
        ({"actions": {3: "go"}}, "leaf must be an integer from 0 to 2, got 3"),
        ({"actions": {0: "goo"}}, "Did you mean 'go'"),
        ({"lock": [5]}, "node must be an integer from 0 to 4, got 5"),
    ],
)
def test_mistakes_are_named(changes, message):
    with pytest.raises((InvalidArgumentError, UnknownNameError), match=message):
        edit(crossing(), **changes)


def test_what_is_locked_stays_until_it_is_unlocked():
    locked = edit(crossing(), lock=[1]).policy  # the subtree of leaves 0 and 2
    assert locked.locked == (0, 2)
    for changes in ({"actions": {0: "go"}}, {"thresholds": {1: 3.0}}, {"thresholds": {0: 3.0}}):
        with pytest.raises(InvalidArgumentError, match="locked"):
            edit(locked, **changes)
        assert edit(locked, unlock=[0], **changes).policy.locked == ()
    assert edit(locked, actions={1: "stop"}).policy.locked == (0, 2)
    assert edit(locked, unlock=[3]).policy.locked == (2,)


def test_locks_are_stored_and_shown():
    locked = edit(crossing(), lock=[3]).policy
    data = locked.to_bytes()
    assert TreePolicy.from_bytes(data) == locked
    assert TreePolicy.from_bytes(data) != crossing()
    assert b"locked" not in crossing().to_bytes()
    assert "leaf 0: stop, locked" in numbered(locked)
    with pytest.raises(InvalidArgumentError, match="locked must be leaves"):
        TreePolicy(crossing().tree, crossing().actions, crossing().schema, locked=(3,))
    with pytest.raises(FormatError):
        TreePolicy.from_bytes(data.replace(b'"locked":true', b'"locked":7'))


@pytest.mark.parametrize(
    ("preset", "episodes"), [("paper", 40), pytest.param("default", 200, marks=pytest.mark.slow)]
)
def test_learning_goes_on_around_a_lock_and_never_changes_it(preset, episodes, tmp_path):
    env = gymnasium.make("eutree/Evasion2-v0")
    schema = eutree.record(env, eutree.experts.wait_at_crossing, episodes=1, seed=0).schema
    start = edit(halves(schema), actions={1: "stop"}, lock=[1]).policy
    run = {"expert": start, "method": preset, "out": tmp_path / "run"}
    run |= {"evaluate_every": 200, "evaluation_episodes": 2, "seed": 1}
    short = eutree.learn(env, episodes=episodes, **run)
    longer = eutree.learn(env, episodes=episodes + 10, resume=True, **run)
    saved = TreePolicy.load(tmp_path / "run" / "policy.json")
    assert short.policy.n_leaves > 2
    for policy in (short.policy, longer.policy, saved):
        (leaf,) = policy.locked
        assert policy.schema.actions[policy.actions[leaf]] == "go"
        low, high = leaf_boxes(policy.tree)
        assert (low[leaf].max(), high[leaf].tolist()) == (-np.inf, [HALF, np.inf, np.inf])


HALF = 5.0


def halves(schema):
    """Return a policy that always goes, in two leaves."""
    return TreePolicy(DecisionTree.single_leaf(3).split(0, 0, HALF), np.array([1, 1]), schema)


def test_without_the_lock_learning_changes_that_leaf():
    """The control: the same run without the lock splits it."""
    env = gymnasium.make("eutree/Evasion2-v0")
    schema = eutree.record(env, eutree.experts.wait_at_crossing, episodes=1, seed=0).schema
    options = {"method": "paper", "episodes": 40, "evaluation_episodes": 2, "seed": 1}
    policy = eutree.learn(env, expert=halves(schema), **options).policy
    assert (policy.tree.threshold[policy.tree.feature >= 0] < HALF).any()
