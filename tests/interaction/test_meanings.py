"""Names may agree where what they stand for does not: codes, formulas, quantities."""

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.data import Demonstrations, Episode, derive
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree


class Valve(gymnasium.Env):
    """Gains the number that its action is named by."""

    observation_space = spaces.Box(0, 1, (1,))
    action_space = spaces.Discrete(3)
    feature_names = ("level",)

    def __init__(self, *actions):
        self.action_names = actions

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.array([0.5], np.float32), {}

    def step(self, action):
        return np.array([0.5], np.float32), float(self.action_names[action]), False, True, {}


def always(*actions):
    """Return a policy that opens the valve wide, by what its actions are called."""
    widest = max(range(3), key=lambda k: float(actions[k]))
    schema = Schema((Feature("level", "", 0.0, 1.0),), actions)
    return TreePolicy(DecisionTree.single_leaf(1), np.array([widest]), schema)


def test_quantities_are_names_of_actions():
    """A tree that said 100 did 0 where the environment had its levels in another order."""
    assert eutree.evaluate(always("0", "50", "100"), Valve("0", "50", "100")).mean_return == 100
    with pytest.raises(InvalidArgumentError, match=r"\['100', '50', '0'\], got .*'0', '50', '100'"):
        eutree.evaluate(always("0", "50", "100"), Valve("100", "50", "0"), episodes=1)


@pytest.mark.parametrize("first", [-1, 0, 1])
def test_numbers_that_count_up_say_nothing(first):
    named = Schema((Feature("level"),), ("shut", "half", "open"))
    counted = tuple(str(first + k) for k in range(3))
    Schema((Feature("level"),), counted).check_same(named, "policy", of="the environment")


def deciding(schema, feature):
    tree = DecisionTree.single_leaf(schema.n_features).split(0, feature, 0.5)
    return TreePolicy(tree, np.array([0, 1]), schema)


def test_diff_compares_no_codes_that_mean_something_else():
    """It said that another action is taken on 0 % of the box."""

    def rule(*modes):
        mode = Feature("mode", "", 0.0, 1.0, True, modes)
        return deciding(Schema((Feature("room"), mode), ("off", "on")), 1)

    assert eutree.diff(rule("manual", "auto"), rule("manual", "auto")).share == 0.0
    with pytest.raises(
        InvalidArgumentError, match=r"mode \(manual, auto\).* got .*mode \(auto, manual\)"
    ):
        eutree.diff(rule("manual", "auto"), rule("auto", "manual"))


def test_diff_compares_no_other_formulas_of_one_name():
    def lead(formula):
        features = (Feature("a", "", 0, 2), Feature("b", "", 0, 2))
        return deciding(Schema(features, ("stop", "go")).derive([f"lead = {formula}"]), 2)

    assert eutree.diff(lead("a + b"), lead("a + b")).share == 0.0
    with pytest.raises(InvalidArgumentError, match=r"lead = a \+ b.* got .*lead = a - b"):
        eutree.diff(lead("a + b"), lead("a - b"))


def test_why_counts_no_steps_by_other_formulas():
    schema = Schema((Feature("a", "", 0, 2), Feature("b", "", 0, 2)), ("stop", "go"))
    episode = Episode([[1.0, 1.0], [2.0, 0.0]], [0], [0.0], True, False)
    shown = Demonstrations((episode,), schema)
    policy = deciding(schema.derive(["lead = a + b"]), 2)
    found = eutree.why(policy, [1, 1], demonstrations=derive(shown, ["lead = a + b"]))
    assert [one.step for one in found.support] == [0]
    for other in (shown, derive(shown, ["lead = a - b"])):
        with pytest.raises(
            InvalidArgumentError, match=r"derived features of .* got \[('a - b')?\]"
        ):
            eutree.why(policy, [1, 1], demonstrations=other)


def test_kinds_of_a_code_keep_its_order_and_those_of_a_group_their_names():
    mode = Feature("mode", "", 0.0, 1.0, True, ("auto", "manual"))
    with pytest.raises(InvalidArgumentError, match="in their order, auto, manual, got manual, au"):
        Schema((mode,), ("off", "on")).with_kinds({"mode": ["manual", "auto"]})
    named = Schema((mode,), ("off", "on")).with_kinds({"mode": ["self", "hand"]})
    assert named.features[0].categories == ("self", "hand")

    flags = tuple(Feature(f"mode is {c}", "", 0, 1, True, group="mode") for c in "abc")
    group = Schema(flags, ("off", "on"))
    assert group.with_kinds({"mode": ["b", "c", "a"]}) == group
    assert group.with_kinds({"mode": ["d", "e", "f"]}).feature_names[0] == "mode is d"


def test_names_of_numpy_are_text(tmp_path):
    actions = tuple(np.array(["u", "v"]))
    policy = deciding(Schema((Feature(np.str_("x"), np.str_("m")),), actions), 0)
    assert type(policy.schema.actions[0]) is type(policy.schema.features[0].unit) is str
    policy.save(tmp_path / "policy.json")
    assert eutree.TreePolicy.load(tmp_path / "policy.json").schema == policy.schema
    assert "np." not in eutree.export.to_python(policy)
