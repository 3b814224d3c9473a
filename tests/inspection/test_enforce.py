"""A rule that is enforced holds, nothing else changes, and learning keeps it."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import eutree
from eutree.errors import InvalidArgumentError
from eutree.inspection import edit, enforce, verify
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
