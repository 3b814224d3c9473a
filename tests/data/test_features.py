"""What a tree sees of the past: one stacking for episodes, the border and policies."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import eutree
from eutree.errors import InvalidArgumentError
from eutree.features import FeatureMap
from eutree.interaction import GuardedEnv
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree

MAPS = st.builds(
    FeatureMap,
    n_observed=st.integers(1, 3),
    n_actions=st.integers(1, 3),
    observations=st.integers(0, 3),
    actions=st.integers(0, 3),
)


def an_episode(features, length, seed):
    generator = np.random.default_rng(seed)
    observations = generator.normal(size=(length + 1, features.n_observed))
    return observations, generator.integers(features.n_actions, size=length)


def naive(features, observations, actions):
    """The definition, number by number."""
    rows = []
    for t in range(len(observations)):
        row = []
        for k in range(features.observations + 1):
            row += list(observations[max(t - k, 0)])
        for k in range(1, features.actions + 1):
            row += [float(t >= k and actions[t - k] == a) for a in range(features.n_actions)]
        rows.append(row)
    return np.array(rows)


@given(MAPS, st.integers(0, 6), st.integers(0, 99))
def test_episodes_are_stacked_as_defined_and_as_step_by_step(features, length, seed):
    observations, actions = an_episode(features, length, seed)
    wanted = naive(features, observations, actions)
    np.testing.assert_array_equal(features.of_episode(observations, actions), wanted)
    seen = features.first(observations[0])
    np.testing.assert_array_equal(seen, wanted[0])
    for t, action in enumerate(actions):
        seen = features.next(seen, int(action), observations[t + 1])
        np.testing.assert_array_equal(seen, wanted[t + 1])
    assert features.n_features == wanted.shape[1]


def a_policy(features, seed):
    """A random tree of ten leaves over the features."""
    generator = np.random.default_rng(seed)
    tree = DecisionTree.single_leaf(features.n_features)
    for leaf in range(9):
        feature = int(generator.integers(features.n_features))
        tree = tree.split(leaf=leaf, feature=feature, threshold=float(generator.normal() / 2))
    schema = Schema.anonymous(features.n_observed, features.n_actions)
    return TreePolicy(
        tree,
        generator.integers(features.n_actions, size=10),
        schema.with_history(features.observations, features.actions),
        history=features.observations,
        past_actions=features.actions,
    )


@given(MAPS, st.integers(0, 99))
def test_policies_remember_alone_and_side_by_side(features, seed):
    policy = a_policy(features, seed)
    assert policy.features == features
    generator = np.random.default_rng(seed + 1)
    stream = generator.normal(size=(8, 3, features.n_observed))  # 8 steps of 3 copies
    starts = generator.random((8, 3)) < 0.3
    starts[0] = True
    state, batch = None, []
    for step in range(8):
        actions, state = policy.predict(stream[step], state, starts[step])
        batch.append(actions)
    for copy in range(3):
        state, first = None, 0
        for step in range(8):
            first = step if starts[step, copy] else first
            action, state = policy.predict(stream[step, copy], state, starts[step, copy])
            assert action == batch[step][copy]
            done = np.array([row[copy] for row in batch[first:step]], dtype=np.int64)
            seen = naive(features, stream[first : step + 1, copy], done)[-1]
            assert action == policy.act(seen.tolist())


def test_the_border_stacks_as_episodes_do():
    env = GuardedEnv(gymnasium.make("eutree/Evasion2-v0"), history=2, past_actions=2)
    names = env.schema.feature_names
    assert names[:4] == ("position", "opponent_1", "opponent_2", "position, 1 ago")
    assert names[-4:] == ("did stop, 1 ago", "did go, 1 ago", "did stop, 2 ago", "did go, 2 ago")
    rows, actions = [env.reset(seed=3)], []
    for action in (1, 0, 1, 1, 0):
        actions.append(action)
        rows.append(env.step(action)[0])
    own = np.array(rows)[:, :3]
    expected = env.features.of_episode(own, np.array(actions))
    np.testing.assert_array_equal(np.array(rows), expected)


def test_a_policy_that_sees_actions_is_saved_and_evaluated_like_any(tmp_path):
    """It alternates: go after stop, stop after go, which no tree over observations can."""
    env = gymnasium.make("eutree/Evasion2-v0", collision_distance=0.0)
    schema = GuardedEnv(env, past_actions=1).schema
    tree = DecisionTree.single_leaf(5).split(leaf=0, feature=4, threshold=0.5)
    policy = TreePolicy(tree, np.array([1, 0]), schema, past_actions=1)
    policy.save(tmp_path / "p.json")
    again = TreePolicy.load(tmp_path / "p.json")
    assert again == policy
    assert again.past_actions == 1
    found = eutree.evaluate(again, env, episodes=20, seed=0)
    assert found.success_rate == 1.0
    np.testing.assert_array_equal(found.lengths % 2, 1)
    np.testing.assert_array_equal(found.returns, 100.0 - 2.0 * (found.lengths // 2))


def test_what_cannot_be_a_map_is_refused():
    schema = Schema((Feature("x"),), ("a", "b"))
    with pytest.raises(InvalidArgumentError, match="past_actions must be from 0 to 4999"):
        schema.with_history(0, 5000)
    with pytest.raises(InvalidArgumentError, match="actions must be"):
        FeatureMap(n_observed=1, n_actions=2, actions=-1)
    leaf = DecisionTree.single_leaf(2)
    with pytest.raises(InvalidArgumentError, match="past_actions must leave at least one of"):
        TreePolicy(leaf, np.array([0]), Schema.anonymous(2, 2), past_actions=1)
