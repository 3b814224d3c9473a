"""Derived features go with environments, demonstrations and policies, and mean the same in each."""

import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import eutree
from eutree.data import derive
from eutree.errors import FormatError, InvalidArgumentError, UnknownNameError
from eutree.inspection import monotone_rules, verify
from eutree.interaction import DerivedObservation, GuardedEnv, describe
from eutree.interaction.making import make
from eutree.interaction.names import Names, named
from eutree.policies import TreePolicy
from eutree.report import watch
from eutree.schema import EnvironmentSpec, Feature
from eutree.trees import DecisionTree

DECLARED = ["lean = angle / position", "turn = angle - last(angle)", "late = last(turn)"]


def swinging(schema, threshold=0.0):
    """Return a policy that tests ``turn``, which is remembered, and then ``lean``."""
    names = schema.feature_names
    tree = DecisionTree.single_leaf(len(names)).split(0, names.index("turn"), threshold)
    tree = tree.split(1, names.index("lean"), 0.5)
    return TreePolicy(tree, np.array([0, 1, 0]), schema, EnvironmentSpec("CartPole-v1"))


@pytest.fixture
def policy():
    with make("CartPole-v1") as env:
        return swinging(describe(env).derive(DECLARED))


def test_an_environment_observes_them(policy):
    env = GuardedEnv(DerivedObservation(gym.make("CartPole-v1"), DECLARED))
    assert env.schema.feature_names[4:] == ("lean", "turn", "late")
    assert [feature.unit for feature in env.schema.derived] == ["rad/m", "rad", "rad"]
    first = env.reset(seed=0)
    assert first[5] == first[6] == 0.0
    second = env.step(1)[0]
    third = env.step(1)[0]
    assert second[5] == second[2] - first[2] != 0.0
    assert third[6] == second[5]
    assert third[4] == third[2] / third[0]
    assert env.reset(seed=0).tobytes() == first.tobytes()
    assert env.own_observation(second).tobytes() == second[:4].astype(np.float32).tobytes()


def test_a_policy_derives_by_itself_what_the_environment_would(policy):
    inner = gym.make("CartPole-v1")
    outer = GuardedEnv(DerivedObservation(gym.make("CartPole-v1"), DECLARED))
    for seed in (0, 1):
        mine, state = inner.reset(seed=seed)[0], None
        theirs, start = outer.reset(seed=seed), True
        for _ in range(12):
            action, state = policy.predict(mine, state, np.array(start))
            assert action == policy.predict(theirs)[0]
            mine, theirs, start = inner.step(action)[0], outer.step(action)[0], False


def test_a_batch_is_its_rows(policy):
    rng = np.random.default_rng(0)
    one, two = rng.normal(size=(2, 5, 4))
    start = np.array([False, True, False, True, False])
    _, state = policy.predict(one, None, np.ones(5, bool))
    actions, after = policy.predict(two, state, start)
    for k in range(5):
        _, alone = policy.predict(one[k])
        assert policy.predict(two[k], alone, start[k])[0] == actions[k]
    assert after.shape == (5, 7)


def test_evaluate_needs_no_more_than_the_policy(policy):
    derived = DerivedObservation(gym.make("CartPole-v1"), DECLARED)
    plain = eutree.evaluate(policy, gym.make("CartPole-v1"), episodes=20, seed=3)
    assert plain.mean_return == eutree.evaluate(policy, derived, episodes=20, seed=3).mean_return
    assert plain.mean_return == eutree.evaluate(policy, "CartPole-v1", episodes=20, seed=3,
                                                n_jobs=2).mean_return  # fmt: skip


def test_a_file_brings_them_back(policy, tmp_path):
    policy.save(tmp_path / "p.json")
    assert TreePolicy.load(tmp_path / "p.json") == policy
    assert "where lean [rad/m] = angle / position" in str(policy)
    assert "late" not in str(policy)  # no test asks for it


def test_a_damaged_formula_is_named(policy, tmp_path):
    document = json.loads(policy.to_bytes())
    document["schema"]["features"][4]["formula"] = "angle / pos"
    (tmp_path / "p.json").write_text(json.dumps(document))
    with pytest.raises(FormatError, match=r"schema: unknown feature 'pos'"):
        TreePolicy.load(tmp_path / "p.json")


def test_demonstrations_get_them_later_or_from_the_environment():
    later = eutree.record(gym.make("CartPole-v1"), lambda env: Left(), episodes=3, seed=0)
    derived = derive(later, DECLARED)
    env = DerivedObservation(gym.make("CartPole-v1"), DECLARED)
    at_once = eutree.record(env, lambda env: Left(), episodes=3, seed=0)
    assert derived.schema == at_once.schema
    assert derived.digest == at_once.digest
    assert derive(derived, ["more = lean"]).observations[:, -1].tolist() == (
        derived.observations[:, 4].tolist()
    )


class Left:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return int(observation[2] > 0), state


def test_names_declare_them_under_their_own_words():
    names = Names(features=("way [km]", "v", "tilt [rad]", "w"), derived=("slope = tilt / way",))
    with named(names), make("CartPole-v1") as env:
        assert describe(env).features[-1] == Feature("slope", "rad/km", formula="tilt / way")
    assert describe(gym.make("CartPole-v1")).n_features == 4


def test_an_environment_without_names_takes_those_of_the_policy(policy):
    class Nameless(gym.Env):
        observation_space = gym.spaces.Box(-9.0, 9.0, (4,))
        action_space = gym.spaces.Discrete(2)

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            return np.ones(4, np.float32), {}

        def step(self, action):
            return np.ones(4, np.float32), 1.0, True, False, {}

    assert eutree.evaluate(policy, Nameless(), episodes=2).mean_return == 1.0


def test_a_tree_is_watched_where_nobody_declares_what_it_asks_for(policy):
    watched = watch(policy, episodes=2, pictures=False)
    assert [one.episode.observations.shape[1] for one in watched] == [7, 7]


def test_demonstrations_from_before_a_tree_was_derived_go_with_it(policy):
    demos = eutree.record("CartPole-v1", lambda env: Left(), episodes=3, seed=0)
    result = eutree.learn(
        gym.make("CartPole-v1"), expert=policy, demonstrations=demos, method="planning",
        episodes=2, evaluation_episodes=2, judge_episodes=0,
    )  # fmt: skip
    assert result.history.observations.shape[1] == 7
    assert result.policy.schema.derived == policy.schema.derived


@pytest.mark.parametrize("past", [0, 1])
def test_nothing_is_proven_monotone_through_what_is_made_of_it(policy, past):
    """With ``turn`` held fixed no test asks for the angle; but it turns with it."""
    schema = policy.schema.with_history(past)
    tree = replace(policy.tree, n_features=schema.n_features)
    policy = replace(policy, tree=tree, schema=schema, history=past)
    with pytest.raises(InvalidArgumentError, match=r"lean, which .* is made of angle"):
        verify(policy, "monotone right in angle")
    with pytest.raises(InvalidArgumentError, match=r"lean, which .* is made of position"):
        monotone_rules(["right in position"], schema)
    assert verify(policy, "monotone right in turn rate").holds
    assert not verify(policy, "monotone left in turn").holds


def test_a_formula_of_another_environment_is_said(policy):
    with pytest.raises(UnknownNameError, match=r"unknown feature .*angle"):
        DerivedObservation(gym.make("MountainCar-v0"), policy.schema.derived)
    with pytest.raises(InvalidArgumentError):
        eutree.evaluate(policy, "MountainCar-v0", episodes=1)


def test_what_has_one_name_has_one_formula(policy):
    other = DerivedObservation(gym.make("CartPole-v1"), ["lean = angle * position"])
    with pytest.raises(InvalidArgumentError, match=r"\['angle \* position'\], got \['angle / pos"):
        eutree.evaluate(policy, other, episodes=1)
    spelt = DerivedObservation(gym.make("CartPole-v1"), ["lean = (angle)/position", *DECLARED[1:]])
    assert eutree.evaluate(policy, spelt, episodes=1).episodes == 1


def test_the_past_is_not_derived_twice(policy):
    demos = eutree.record(gym.make("CartPole-v1"), lambda env: Left(), episodes=3, seed=0)
    past = derive(demos, DECLARED).with_history(1)
    expert = replace(eutree.fit_expert_tree(past), history=1)
    inner, state = gym.make("CartPole-v1"), None
    outer = GuardedEnv(DerivedObservation(gym.make("CartPole-v1"), DECLARED), history=1)
    mine, theirs = inner.reset(seed=0)[0], outer.reset(seed=0)
    for _ in range(8):
        action, state = expert.predict(mine, state)
        assert action == expert.act(theirs.tolist())
        mine, theirs = inner.step(action)[0], outer.step(action)[0]


def test_an_expert_that_is_scripted_sees_what_the_environment_says():
    env = DerivedObservation(gym.make("CartPole-v1"), DECLARED)
    demos = eutree.record(env, eutree.experts.EXPERTS["CartPole-v1"]["fall"], episodes=2, seed=0)
    plain = eutree.record("CartPole-v1", eutree.experts.EXPERTS["CartPole-v1"]["fall"], episodes=2,
                          seed=0)  # fmt: skip
    assert demos.actions.tolist() == plain.actions.tolist()
