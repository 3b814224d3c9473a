"""Policy files: save, load, save gives the same bytes; a loaded tree is a tree."""

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings

from eutree.errors import FileError, FormatError, InvalidArgumentError
from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from tests.policies.small import small_policy
from tests.policies.strategies import policies


def probes(policy, rng):
    """Random points, and every threshold with its neighbours, on every feature."""
    cuts = policy.tree.threshold[policy.tree.feature >= 0]
    special = [0.0, -0.0, 5e-324, -5e-324, math.inf, -math.inf, math.nan]
    with np.errstate(over="ignore"):
        edges = [cuts, np.nextafter(cuts, -np.inf), np.nextafter(cuts, np.inf), special]
        random = rng.standard_cauchy(500) * 10.0 ** rng.integers(-5, 300, 500)
    return rng.choice(np.concatenate([*edges, random]), (2000, policy.tree.n_features))


@pytest.mark.promise(4)
@given(policies())
@settings(deadline=None)
def test_save_load_save_gives_the_same_bytes_and_decisions(policy):
    data = policy.to_bytes()
    loaded = TreePolicy.from_bytes(data)
    assert loaded == policy
    assert loaded.to_bytes() == data
    points = probes(policy, np.random.default_rng(0))
    assert np.array_equal(loaded.tree.leaf_index(points), policy.tree.leaf_index(points))


@pytest.mark.promise(4)
def test_a_large_tree_decides_the_same_at_100_000_points():
    rng = np.random.default_rng(0)
    tree = DecisionTree.single_leaf(5)
    for _ in range(300):
        tree = tree.split(int(rng.integers(tree.n_leaves)), int(rng.integers(5)), rng.normal())
    policy = TreePolicy(tree, rng.integers(0, 3, tree.n_leaves), Schema.anonymous(5, 3))
    loaded = TreePolicy.from_bytes(policy.to_bytes())
    for seed in range(50):
        points = probes(policy, np.random.default_rng(seed))
        assert np.array_equal(
            loaded.actions[loaded.tree.leaf_index(points)],
            policy.actions[policy.tree.leaf_index(points)],
        )


def test_the_file_reads_well(tmp_path):
    path = tmp_path / "policy.json"
    small_policy().save(path)
    text = path.read_text()
    assert '"environment": {"id":"eutree/Evasion2-v0","arguments":{"opponent_speed":4.2}}' in text
    assert '\n  {"feature":0,"threshold":0.5,"left":1,"right":2},\n  {"leaf":0},\n' in text
    assert '\n  {"action":1,"visits":[3,0],"values":[3.0,null],"deviations":[null,null]},' in text
    assert TreePolicy.load(path) == small_policy()


@pytest.mark.promise(5)
@pytest.mark.parametrize("bad", [math.inf, -math.inf])
@pytest.mark.parametrize("field", ["values", "deviations", "arguments"])
def test_nothing_infinite_is_written(tmp_path, bad, field):
    policy = small_policy()
    parts = {"tree": policy.tree, "actions": policy.actions, "schema": policy.schema}
    if field == "arguments":
        policy = TreePolicy(**parts, environment=EnvironmentSpec("x", {"speed": bad}))
    else:
        zeros = {name: np.zeros((3, 2)) for name in ("visits", "values", "deviations")}
        policy = TreePolicy(**parts, leaves=LeafStatistics(**zeros | {field: np.full((3, 2), bad)}))
    with pytest.raises(InvalidArgumentError, match=r"finite|numbers"):
        policy.save(tmp_path / "policy.json")
    assert list(tmp_path.iterdir()) == []


def change(*path, to):
    def apply(document):
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = to

    return apply


def remove(*path):
    def apply(document):
        for key in path[:-1]:
            document = document[key]
        del document[path[-1]]

    return apply


CHANGED = "checksum: the file was changed after .* eutree edit .*policy.json --reseal"
BAD = {
    "cycle": (change("nodes", 2, "left", to=0), r"nodes\[2\]: child 0 must come after"),
    "self": (change("nodes", 2, "left", to=2), r"nodes\[2\]: child 2 must come after"),
    "shared": (change("nodes", 2, "left", to=4), r"nodes\[2\]: child 4 is already"),
    "shared by two": (change("nodes", 0, "left", to=3), r"nodes\[2\]: child 3 is already"),
    "unreachable": (
        lambda d: d["nodes"].extend([{"leaf": 3}, {"leaf": 4}]),
        "nodes: not a decision tree: every node but the root",
    ),
    "out of range": (change("nodes", 2, "right", to=9), r"nodes\[2\]: child 9 does not exist"),
    "negative": (change("nodes", 2, "right", to=-2), r"nodes\[2\].right: Expected `int` >= -1"),
    "no child": (remove("nodes", 2, "right"), r"nodes\[2\]: must have feature"),
    "threshold null": (change("nodes", 0, "threshold", to=None), r"nodes\[0\]: must have"),
    "feature": (change("nodes", 0, "feature", to=2), r"nodes\[0\]: feature must be in 0..1"),
    "both": (change("nodes", 1, "feature", to=0), r"nodes\[1\]: a leaf must have no feature"),
    "leaf twice": (change("nodes", 1, "leaf", to=1), "numbered 0, 1, 2"),
    "leaf missing": (change("nodes", 4, "leaf", to=7), "numbered 0, 1, 2"),
    "no nodes": (change("nodes", to=[]), "odd number of nodes, got 0"),
    "unknown action": (change("leaves", 1, "action", to=2), r"leaves\[1\].action: must be in 0..1"),
    "leaves": (lambda d: d["leaves"].pop(), "leaves: expected 3, one for each leaf, got 2"),
    "some statistics": (remove("leaves", 0, "visits"), "leaves: every leaf must have 2 visits"),
    "short statistics": (change("leaves", 0, "values", to=[1]), "every leaf must have 2 values"),
    "visits": (change("leaves", 0, "visits", to=[-1, 0]), "visits must be >= 0, got -1"),
    "large visits": (change("leaves", 0, "visits", to=[2**70, 0]), "visits|range"),
    "names": (change("schema", "actions", to=["a", "a"]), "schema: schema must have distinct"),
    "no features": (change("schema", "features", to=[]), "schema must name at least one"),
    "bounds": (change("schema", "features", 0, "high", to=-1.0), "must have low <= high"),
    "history": (change("history", to=2), "history . 1 must divide"),
    "newer": (change("version", to=3), "made by eutree .* as version 3 .* reads versions up to 2"),
    "other": (change("format", to="eutree/other"), "format: expected 'eutree/policy'"),
    "module": (change("environment", "id", to="os:x"), "environment.id: must name no module"),
    "window": (
        change("environment", "arguments", to={"render_mode": "human"}),
        "environment.arguments: must not choose a render_mode",
    ),
    "a digit of a threshold": (change("nodes", 0, "threshold", to=0.51), CHANGED),
    "an action": (change("leaves", 1, "action", to=0), CHANGED),
    "a bound": (change("schema", "features", 0, "high", to=9.0), CHANGED),
    "an argument": (change("environment", "arguments", "opponent_speed", to=4.3), CHANGED),
    "no checksum": (remove("checksum"), CHANGED),
    "extra key": (change("nodes", 1, "code", to="x"), r"nodes\[1\]: Object contains unknown field"),
}


@pytest.mark.promise(3)
@pytest.mark.promise(6)
@pytest.mark.parametrize("name", BAD)
def test_a_policy_that_breaks_a_rule_is_refused(tmp_path, name):
    apply, message = BAD[name]
    document = json.loads(small_policy().to_bytes())
    apply(document)
    path = tmp_path / "policy.json"
    path.write_text(json.dumps(document))
    with pytest.raises(FormatError, match=message) as caught:
        TreePolicy.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.promise(3)
def test_the_rules_hold_against_a_control(tmp_path):
    """The unchanged document loads, so each refusal above is due to its one change."""
    document = json.loads(small_policy().to_bytes())
    assert TreePolicy.from_bytes(json.dumps(document).encode()) == small_policy()


def test_a_hand_edited_file_is_taken_where_that_is_said(tmp_path):
    path = tmp_path / "policy.json"
    document = json.loads(small_policy().to_bytes())
    change("nodes", 0, "threshold", to=0.51)(document)
    path.write_text(json.dumps(document))
    edited = TreePolicy.load(path, hand_edited=True)
    assert edited.tree.threshold[0] == 0.51
    edited.save(path)
    assert TreePolicy.load(path) == edited
    change("nodes", 0, "feature", to=2)(document)
    path.write_text(json.dumps(document))
    with pytest.raises(FormatError, match="feature must be in"):
        TreePolicy.load(path, hand_edited=True)


@pytest.mark.parametrize("spelled", [lambda d: json.dumps(d, indent=3), json.dumps])
def test_the_checksum_is_over_what_is_said_and_not_how(spelled):
    document = json.loads(small_policy().to_bytes())
    document["schema"]["features"][0]["low"] = 0  # 0.0 as JavaScript writes it
    shuffled = dict(reversed(document.items())) | {"made_by": "eutree 9.9.9"}
    assert TreePolicy.from_bytes(spelled(shuffled).encode()) == small_policy()


def test_a_file_of_the_first_version_has_no_checksum():
    document = json.loads(small_policy().to_bytes()) | {"version": 1}
    del document["checksum"]
    assert TreePolicy.from_bytes(json.dumps(document).encode()) == small_policy()


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(FileError, match=r"cannot read .*none\.json: it does not exist"):
        TreePolicy.load(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("field", "value", "wanted"),
    [
        ("masked", 1, "masked must be a bool, got 1"),
        ("masked", "no", "masked must be a bool, got 'no'"),
        ("environment", "CartPole-v1", "environment must be a EnvironmentSpec, got 'CartPole-v1'"),
        ("schema", None, "schema must be a Schema, got None"),
        ("tree", 3, "tree must be a DecisionTree, got 3"),
        ("history", "1", "history must be an integer >= 0, got '1'"),
        ("past_actions", 0.0, "past_actions must be an integer >= 0, got 0.0"),
    ],
)
def test_a_field_of_another_kind_is_refused(field, value, wanted):
    """``masked=1`` was taken, and written to a file that could not be read."""
    made = {"tree": DecisionTree.single_leaf(1), "actions": [0], "schema": Schema.anonymous(1, 2)}
    with pytest.raises(InvalidArgumentError, match=f"^{re.escape(wanted)}"):
        TreePolicy(**(made | {field: value}))
