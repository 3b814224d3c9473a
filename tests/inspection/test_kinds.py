"""Flags, categories, one-hot groups and whole numbers, in words and in proofs."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import EutreeError, UnknownNameError
from eutree.export import to_c, to_dot
from eutree.inspection import diff, enforce, verify, why
from eutree.inspection.properties import parse
from eutree.inspection.regions import Region, domain
from eutree.policies import TreePolicy
from eutree.schema import Control, Feature, Schema, combined_actions
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes, possible
from eutree.trees.text import asked
from tests import naive_trees

PHASES = tuple(
    Feature(f"phase is {name}", low=0, high=1, is_integer=True, group="phase") for name in "ABCD"
)
DOOR = Feature("open", low=0, high=1, is_integer=True)
TARIFF = Feature("tariff", "ct", 0, 3, is_integer=True)
MODE = Feature("mode", low=1, high=4, is_integer=True, categories=("off", "low", "mid", "high"))
LEVEL = Feature("level", "m", 0.0, 5.0)
SCHEMA = Schema((*PHASES, DOOR, TARIFF, MODE, LEVEL), ("wait", "go", "stop"))
A, B, C, D, OPEN, TAX, SETTING, HEIGHT = range(8)


def policy_of(cuts, actions):
    return TreePolicy(DecisionTree.single_leaf(8).split_each(cuts), actions, SCHEMA)


def observations():
    """Yield every observation of the schema, the level at four heights."""
    for phase, door, tariff, mode, level in itertools.product(
        range(4), (0, 1), range(4), range(1, 5), (0.0, 0.5, 2.0, 5.0)
    ):
        yield [*np.eye(4)[phase], door, tariff, mode, level]


ROWS = np.array(list(observations()), dtype=float)


def random_policy(generator):
    tree = naive_trees.random_tree(generator, int(generator.integers(1, 12)), 8)
    inner = tree.feature >= 0
    threshold = np.where(tree.feature == HEIGHT, 0.5, generator.integers(0, 4, inner.size) - 0.5)
    tree = DecisionTree(
        8, tree.feature, np.where(inner, threshold, np.nan), tree.left, tree.right, tree.leaf
    )
    return TreePolicy(tree, generator.integers(0, 3, tree.n_leaves), SCHEMA)


def test_rules_say_what_is_meant():
    cuts = [(0, A, 0.5), (0, C, 0.0), (0, OPEN, 0.5), (1, TAX, 1.0), (2, SETTING, 2.0)]
    assert str(policy_of(cuts, [0, 1, 2, 0, 1, 2])).splitlines() == [
        "if phase is A:",
        "    if tariff <= 1 ct:",
        "        go",
        "    else:",
        "        go",
        "else if phase is C:",
        "    if mode is off,low:",
        "        stop",
        "    else:",
        "        stop",
        "else if open:",
        "    wait",
        "else:",
        "    wait",
    ]


def test_what_the_tests_above_exclude_is_not_named_again():
    policy = policy_of([(0, SETTING, 1.5), (1, SETTING, 2.5), (2, SETTING, 3.5)], [0, 1, 2, 0])
    assert str(policy).splitlines() == [
        "if mode is off:",
        "    wait",
        "else if mode is low:",
        "    go",
        "else if mode is mid:",
        "    stop",
        "else:",
        "    wait",
    ]
    assert "mode is mid ? yes" in str(why(policy, [1, 0, 0, 0, 1, 2, 3, 1.0]))
    for text in (to_c(policy), to_dot(policy)):
        assert "mode is mid" in text
        assert "low,mid" not in text


@pytest.mark.parametrize("seed", range(30))
def test_a_question_is_answered_as_its_words_say(seed):
    """Among what the tests above leave, yes is the categories that the words name."""
    policy = random_policy(np.random.default_rng(seed))
    tree = policy.tree
    for row in ROWS[:: len(ROWS) // 40]:
        for node in tree.path(tree.leaf_of(row.tolist()))[:-1]:
            feature, _, cut = test = asked(SCHEMA, tree, node)
            words = test.question()
            if feature != SETTING or " is " not in words:
                continue
            named = words.split(" is ")[1].removeprefix("not ").split(",")
            is_named = MODE.categories[int(row[SETTING]) - 1] in named
            is_yes = test.answer(is_left=row[feature] <= cut) == "yes"
            assert is_yes == (is_named != (" is not " in words))


def test_a_test_asks_for_the_fewer_categories():
    policy = policy_of([(0, SETTING, 3.0)], [0, 1])
    assert str(policy).splitlines() == ["if mode is high:", "    go", "else:", "    wait"]
    assert "mode is high" in to_dot(policy)
    assert "/* mode is not high */" in to_c(policy)


def test_several_tests_of_a_group_are_one_phrase():
    low, high = leaf_boxes(policy_of([(0, A, 0.5), (0, C, 0.5)], [0, 1, 2]).tree)
    words = [Region(a, b).words(SCHEMA, domain(SCHEMA)) for a, b in zip(low, high, strict=True)]
    assert words == ["phase is B,D", "phase is A", "phase is C"]


@pytest.mark.parametrize(
    ("cuts", "leaf", "words"),
    [
        ([(0, A, 0.5)], 0, "phase is not A"),
        ([(0, OPEN, 0.5)], 0, "not open"),
        ([(0, OPEN, 0.0)], 1, "open"),
        ([(0, TAX, 1.0)], 1, "tariff >= 2 ct"),
        ([(0, TAX, 2.5), (0, TAX, 0.5)], 2, "1 <= tariff <= 2 ct"),
        ([(0, TAX, 1.5), (0, TAX, 0.5)], 2, "tariff = 1 ct"),
        ([(0, SETTING, 3.0), (0, SETTING, 1.0)], 2, "mode is low,mid"),
        ([(0, SETTING, 3.0)], 0, "mode is not high"),
    ],
)
def test_a_box_in_words(cuts, leaf, words):
    low, high = leaf_boxes(DecisionTree.single_leaf(8).split_each(cuts))
    assert Region(low[leaf], high[leaf]).words(SCHEMA, domain(SCHEMA)) == words


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_answers_are_those_of_all_observations(seed):
    """A category is no interval: nothing that no observation can be is a counter-example."""
    generator = np.random.default_rng(seed)
    policy = random_policy(generator)
    actions = policy.predict(ROWS)[0]
    conditions = {
        "phase is B,D": ROWS[:, B] + ROWS[:, D] > 0,
        "phase is not A and open": (ROWS[:, A] == 0) & (ROWS[:, OPEN] == 1),
        "not open": ROWS[:, OPEN] == 0,
        "tariff >= 2": ROWS[:, TAX] >= 2,
        "tariff > 0.5 and level < 0.5": (ROWS[:, TAX] >= 1) & (ROWS[:, HEIGHT] < 0.5),
        "mode is off,mid": np.isin(ROWS[:, SETTING], (1, 3)),
        "mode is not high": ROWS[:, SETTING] < 4,
    }
    for text, here in conditions.items():
        found = verify(policy, f"never go when {text}")
        assert found.holds == (not (actions[here] == 1).any())
        for example in found.counter_examples:
            assert policy.predict(example.point)[0] == 1
            assert (ROWS[here][:, :HEIGHT] == example.point[:HEIGHT]).all(axis=1).any()
    whole = verify(policy, "never go")
    flat = [
        policy.predict(np.append(row[:HEIGHT], level))[0] for row in ROWS[::4] for level in (0, 1)
    ]
    parts = np.array(flat).reshape(-1, 2) == 1
    assert whole.share == pytest.approx((parts * [0.1, 0.9]).sum(axis=1).mean())


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_difference_counts_what_can_be(seed):
    generator = np.random.default_rng(seed)
    one, two = random_policy(generator), random_policy(generator)
    rows = np.concatenate([np.column_stack([ROWS[::4, :HEIGHT], np.full(128, h)]) for h in (0, 1)])
    differ = (one.predict(rows)[0] != two.predict(rows)[0]).reshape(2, -1)
    found = diff(one, two)
    assert found.share == pytest.approx(differ.mean(axis=1) @ [0.1, 0.9])
    for box in found.boxes:
        point = box.region.point(SCHEMA)
        assert one.predict(point)[0] == box.first
        assert two.predict(point)[0] == box.second
        assert point[:4].sum() == 1


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_the_nearest_other_decision_is_one_that_can_be(seed):
    generator = np.random.default_rng(seed)
    policy = random_policy(generator)
    point = ROWS[generator.integers(len(ROWS))]
    found = why(policy, point)
    for alternative in found.alternatives:
        assert policy.predict(alternative.observation)[0] == alternative.action
        assert alternative.observation[:4].sum() == 1
        assert (alternative.observation[:HEIGHT] % 1 == 0).all()
    assert {a.action for a in found.alternatives} | {found.action} == set(
        policy.predict(ROWS)[0].tolist()
    ) | {found.action}


def test_why_in_words():
    policy = policy_of([(0, B, 0.5), (0, TAX, 1.0)], [0, 1, 2])
    point = [1, 0, 0, 0, 0, 1, 1, 2.0]
    lines = why(policy, point).text.splitlines()
    assert lines == [
        "wait, by leaf 0: phase is not B and tariff <= 1 ct",
        "  phase is B ? no",
        "  tariff <= 1 ct ? yes: 1, by 1 ct",
        "  stop from tariff >= 2 ct (by 1) on",
        "  go where phase is B",
    ]


def test_a_rule_about_categories_is_made_true():
    policy = policy_of([(0, HEIGHT, 1.0)], [0, 1])
    ruled = enforce(policy, "always stop when mode is off,mid and open").policy
    assert verify(ruled, "always stop when mode is off,mid and open").holds
    assert not verify(ruled, "always stop when mode is low").holds


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("never go when phase is E", "category"),
        ("never go when tariff is 2", "values have no names"),
        ("never go when phase <= 1", "'is' after 'phase'"),
        ("never go when level", "a comparison"),
        ("never go when not level", "a comparison"),
        ("monotone go in mode", "can be raised"),
        ("never go when phase is A and phase is B", "somewhere within the bounds"),
        ("never go when mode is not off,low,mid,high", "some observation"),
    ],
)
def test_mistakes_are_named(text, message):
    with pytest.raises(EutreeError, match=message):
        verify(policy_of([], [0]), text)


def test_an_unknown_category_names_the_nearest():
    with pytest.raises(UnknownNameError, match="middle"):
        parse("never go when mode is middle", SCHEMA)


def test_what_is_possible_is_possible_already():
    low, high = domain(SCHEMA).low, domain(SCHEMA).high
    again = possible(low, high, SCHEMA)
    assert np.array_equal(again[0], low)
    assert np.array_equal(again[1], high)


VALVE = Control("valve", "%", (0.0, 50.0, 100.0))
HEATER = Control("heater", "kW", (0.0, 3.0))
SET = Schema((LEVEL,), combined_actions((VALVE, HEATER)), (VALVE, HEATER))


def setting(*actions, cuts):
    tree = DecisionTree.single_leaf(1).split_each([(k, 0, cut) for k, cut in enumerate(cuts)])
    return TreePolicy(tree, actions, SET)


def test_quantities_are_asked_for_by_their_values():
    policy = setting(0, 2, 5, cuts=[1.0, 3.0])  # valve 0, 50, 100 %; heater 0, 0, 3 kW
    assert verify(policy, "always heater = 0 when level <= 3").holds
    assert not verify(policy, "always heater = 0").holds
    assert verify(policy, "never valve > 50 % when level <= 3").holds
    assert verify(policy, "always valve >= 50 when level > 1").holds
    assert verify(policy, "monotone valve in level").holds
    falling = verify(policy, "monotone valve in falling level")
    assert not falling.holds
    assert "valve 50 %, heater 0 kW becomes valve 0 %" in falling.counter_examples[0].words
    assert not verify(setting(4, 2, 5, cuts=[1.0, 3.0]), "monotone valve in level").holds
    assert verify(policy, "never valve > 50 % when 1 < level <= 3 m").holds
    with pytest.raises(EutreeError, match="some but not all"):
        verify(policy, "always valve <= 100")


def test_a_quantity_is_enforced_where_one_action_is_left():
    alone = Schema((LEVEL,), combined_actions((VALVE,)), (VALVE,))
    tree = DecisionTree.single_leaf(1)
    ruled = enforce(TreePolicy(tree, [2], alone), "always valve = 0 when level < 1").policy
    assert verify(ruled, "always valve <= 0 when level < 1").holds


def between_kinds():
    """Return a policy of a group, an integer and categories that goes where none of them can be."""
    group = [Feature(f"w.{one}", low=0, high=1, is_integer=True, group="w") for one in "xyz"]
    tariff = Feature("tariff", low=0, high=3, is_integer=True)
    phase = Feature("phase", low=0, high=2, is_integer=True, categories=("A", "B", "C"))
    schema = Schema((*group, tariff, phase), ("stop", "go"))
    tree = DecisionTree.single_leaf(5).split(0, 1, 2.5).split(0, 4, 0.5).split(2, 4, 0.25)
    return TreePolicy(tree, np.array([0, 1, 0, 1]), schema)


@pytest.mark.parametrize("question", ["always stop", "never go when w is x"])
def test_everywhere_a_counter_example_lies_in_its_region_and_breaks_the_property(question):
    """One feature of a group was set to 1 in a region where none is, and the policy kept it."""
    policy = between_kinds()
    found = verify(policy, question, everywhere=True)
    assert not found.holds
    for example in found.counter_examples:
        assert example.region.contains(example.point)
        assert policy.predict(example.point)[0] == example.action == 1
        assert "nothing" not in example.words


def test_everywhere_both_points_of_a_switch_lie_where_it_says():
    group = [Feature(f"w.{one}", low=0, high=1, is_integer=True, group="w") for one in "xyz"]
    schema = Schema((*group, Feature("load", low=0.0, high=4.0)), ("stop", "go"))
    tree = DecisionTree.single_leaf(4).split(0, 1, 2.5).split(1, 3, 9.0)
    policy = TreePolicy(tree, np.array([0, 0, 1]), schema)
    assert verify(policy, "monotone stop in load").holds
    (example,) = verify(policy, "monotone stop in load", everywhere=True).counter_examples
    assert example.region.contains(example.point)
    assert [policy.predict(at)[0] for at in (example.point, example.raised)] == [0, 1]
    assert example.words.startswith("stop becomes go where w.y > 2.5 and load <= 9")


def test_everywhere_codes_need_not_be_whole():
    found = verify(between_kinds(), "never go when phase > 0 and phase < 1", everywhere=True)
    assert not found.holds
    assert all(0.0 < example.point[4] < 1.0 for example in found.counter_examples)
    assert verify(between_kinds(), "never go when phase is A and tariff <= 0").holds
