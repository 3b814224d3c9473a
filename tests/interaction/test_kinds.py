"""Kinds of features: read from the spaces, declared by the environment or in a file, carried on."""

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.export import to_c, to_python, to_structured_text, to_svg
from eutree.inspection.regions import Region, domain
from eutree.interaction import GuardedEnv
from eutree.interaction.making import make
from eutree.interaction.names import Names, kinds_of, named
from eutree.interaction.spaces import describe
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes

KINDS = {
    "tariff": "integer",
    "phase": ("north", "east", "south", "west"),
    "green": ("x0", "x1", "x2"),
}


class Crossing(gymnasium.Env):
    """A door, a phase, one-hot greens, a tariff and a distance; each kind matters to the reward."""

    observation_space = spaces.Dict(
        {
            "door": spaces.MultiBinary(1),
            "green": spaces.Box(0.0, 1.0, (3,), np.float64),
            "phase": spaces.Discrete(4),
            "tariff": spaces.Box(0.0, 3.0, (1,), np.float64),
            "far": spaces.Box(0.0, 9.0, (1,), np.float64),
        }
    )
    action_space = spaces.Discrete(2)
    max_steps = 20

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._t = 0
        return self._observe(), {}

    def _observe(self):
        draw = self.np_random
        self._seen = {
            "door": draw.integers(0, 2, 1).astype(np.int8),
            "green": np.eye(3)[draw.integers(3)],
            "phase": np.int64(draw.integers(4)),
            "tariff": draw.integers(0, 4, 1).astype(float),
            "far": draw.uniform(0, 9, 1),
        }
        return self._seen

    def step(self, action):
        self._t += 1
        reward = float(action == wanted(self._seen))
        return self._observe(), reward, False, self._t == self.max_steps, {}


def wanted(seen):
    """Return 1 in phases east and west with an open door, at green 1, or at a high tariff."""
    return int(
        (seen["phase"] in (1, 3) and seen["door"][0]) or seen["green"][1] or seen["tariff"][0] >= 3
    )


@pytest.fixture(scope="module", autouse=True)
def registered():
    gymnasium.register("Crossing-v0", entry_point=Crossing)
    yield
    del gymnasium.registry["Crossing-v0"]


def test_what_the_spaces_say():
    kinds = {feature.name: feature for feature in describe(Crossing()).features}
    assert kinds["door"].is_flag
    assert kinds["phase"].is_integer
    assert not kinds["far"].is_integer
    assert not kinds["green.x0"].is_integer


def test_an_environment_declares_them():
    env = Crossing()
    env.feature_kinds = KINDS
    schema = describe(env)
    assert schema.groups == {"green": (2, 3, 4)}
    assert [schema.features[k].category for k in (2, 3, 4)] == ["x0", "x1", "x2"]
    assert kinds_of(schema) == {"door": "flag", **KINDS}
    past = schema.with_history(1)
    assert past.groups["green, 1 ago"] == (9, 10, 11)


def test_a_file_declares_them(tmp_path):
    path = tmp_path / "names.json"
    features = ["open", "far [m]", "green 0", "green 1", "green 2", "phase", "tariff"]
    kinds = {"green": ["0", "1", "2"], "phase": ["n", "e", "s", "w"], "tariff": "integer"}
    path.write_text(json.dumps({"features": features, "kinds": kinds}))
    env = Crossing()
    env.feature_kinds = KINDS  # under its own names, which are no more
    Names.load(path).give(env)
    schema = describe(env)
    assert schema.groups == {"green": (2, 3, 4)}
    assert schema.features[3].category == "1"
    assert schema.features[5].categories == ("n", "e", "s", "w")
    assert schema.features[6].is_integer


@pytest.mark.parametrize(
    ("kinds", "error", "message"),
    [
        ({"dor": "flag"}, UnknownNameError, "door"),
        ({"door": "binary"}, InvalidArgumentError, "flag, integer or the names"),
        ({"phase": ("a", "b")}, InvalidArgumentError, "from 0 to 3"),
        ({"phase": ("a", "b", "b", "c")}, InvalidArgumentError, "all distinct"),
        ({"green": ("green.x0", "green.x9")}, UnknownNameError, "green.x9"),
        ({"far": "flag"}, InvalidArgumentError, "from 0 to 9"),
    ],
)
def test_a_kind_that_is_none(kinds, error, message):
    with pytest.raises(error, match=message):
        describe(Crossing()).with_kinds(kinds)


def test_they_travel_and_no_decision_depends_on_them(tmp_path):
    env = gymnasium.make("Crossing-v0")
    env.unwrapped.feature_kinds = KINDS
    demos = eutree.record(env, wanted, episodes=20, seed=0)
    demos.save(tmp_path / "demos")
    demos = eutree.Demonstrations.load(tmp_path / "demos")
    policy = eutree.fit_expert_tree(demos)
    policy.save(tmp_path / "policy.json")
    policy = TreePolicy.load(tmp_path / "policy.json")
    assert kinds_of(policy.schema) == {"door": "flag", **KINDS}
    words = str(policy)
    assert "if green is x1:" in words
    assert "tariff <= 2" in words
    assert "0.5" not in words
    found = eutree.evaluate(policy, "Crossing-v0", episodes=20, seed=1)
    assert found.mean_return == 20.0
    # With nothing declared the same tree is learned: kinds are words, not numbers.
    plain = replace(demos, schema=describe(Crossing()))
    assert eutree.fit_expert_tree(plain).tree.equals(policy.tree)
    for text in (to_c(policy), to_python(policy), to_structured_text(policy)):
        assert "green is not x1" in text
    assert "green is x1" in to_svg(policy)
    assert "phase, 0.0 to 3.0, 0 north, 1 east, 2 south, 3 west" in to_c(policy)
    assert "green.x1, one of green" in to_structured_text(policy)


def test_a_test_that_decides_nothing_is_shown_as_it_is():
    env = Crossing()
    env.feature_kinds = KINDS
    tree = DecisionTree.single_leaf(7).split(0, 0, 1.5)
    assert str(TreePolicy(tree, [0, 1], describe(env))).startswith("if door <= 1.5:")


def test_each_value_of_a_discrete_space_can_be_a_feature(tmp_path):
    """A code takes two tests to set a value apart, a group one."""
    spec = eutree.EnvironmentSpec("Crossing-v0", {"one_hot": True})
    env = make(spec)
    env.unwrapped.feature_kinds = {"phase": ("north", "east", "south", "west")}
    schema = describe(env)
    assert schema.groups["phase"] == (5, 6, 7, 8)
    assert schema.feature_names[4:10] == (
        "green.x2",
        "phase is north",
        "phase is east",
        "phase is south",
        "phase is west",
        "tariff",
    )
    assert schema.features[0].is_flag
    demos = eutree.record(env, lambda seen: int(seen[6] or seen[8]), episodes=20, seed=0)
    assert demos.environment == spec
    policy = eutree.fit_expert_tree(demos)
    assert policy.n_leaves == 3
    low, high = leaf_boxes(policy.tree)
    words = {
        Region(a, b).words(policy.schema, domain(policy.schema))
        for a, b in zip(low, high, strict=True)
    }
    assert words & {"phase is north,south", "phase is east,west"}
    eutree.evaluate(policy, spec, episodes=2)
    path = tmp_path / "names.json"
    path.write_text(json.dumps({"kinds": {"phase": ["n", "e", "s", "w"]}}))
    with named(Names.load(path)):
        assert describe(make(spec)).feature_names[5:7] == ("phase is n", "phase is e")
    fitted = eutree.fit_expert_tree(demos)
    describe(make(spec)).check_same(fitted.schema, "the policy", of="the environment")
    with pytest.raises(InvalidArgumentError, match="features and actions"):
        fitted.schema.check_same(describe(make(spec)), "the policy", of="the environment")
    assert GuardedEnv(make(spec)).schema.n_features == 10
