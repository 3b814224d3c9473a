"""``eutree diff``, ``verify`` and ``why``: texts, JSON, exit codes."""

import json
from pathlib import Path

import gymnasium
import numpy as np

from eutree.inspection.regions import is_box, leaf_parts
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.trees import DecisionTree


def test_diff_of_a_policy_with_itself_is_empty(eutree, expert):
    answer = eutree("diff", expert, expert, "--json")
    assert answer.code == 0
    assert (answer.json["share"], answer.json["boxes"], answer.json["structure"]) == (0.0, [], [])


def test_diff_counts_the_demonstrated_steps(eutree, expert, demonstrations):
    answer = eutree("edit", expert, "--set-action", "0=stop", "--out", "other.json")
    assert answer.code == 0
    found = eutree("diff", expert, "other.json", "--demos", demonstrations, "--json").json
    plain = eutree("diff", expert, "other.json", "--json").json
    assert plain["visited"] is None
    assert found["share"] == plain["share"]
    assert abs(found["visited"] - sum(box["visited"] for box in found["boxes"])) < 1e-12
    assert (
        "of the recorded steps"
        in eutree("diff", expert, "other.json", "--demos", demonstrations).out
    )


def test_verify_exits_with_0_for_a_proof_and_1_for_a_refutation(eutree, expert, demonstrations):
    everywhere = "0 <= position <= 30"
    refuted = eutree("verify", expert, "--property", f"never go when {everywhere}")
    assert (refuted.code, refuted.out.split(":")[0]) == (1, "refuted")
    both = [f"never {action} when {everywhere}" for action in ("stop", "go")]
    answer = eutree("verify", expert, "--property", both[0], "--property", both[1], "--json")
    assert (answer.code, answer.json["holds"]) == (1, False)
    shares = [entry["share"] for entry in answer.json["answers"]]
    assert abs(sum(shares) - 1.0) < 1e-9
    proven = eutree("verify", expert, "--property", "no dead leaves", "--demos", demonstrations)
    assert (proven.code, proven.out.split(":")[0]) == (0, "proven")


def test_verify_takes_observations_of_demonstrations_and_of_a_run(
    eutree, demonstrations, expert, monkeypatch
):
    """Where both were given, the demonstrations counted for nothing."""
    tree = DecisionTree.single_leaf(3).split(0, 0, 1.0)
    TreePolicy(tree, [1, 0], TreePolicy.load(expert).schema).save("two.json")
    seen = np.zeros((4, 3))  # of a run that stayed where it began
    monkeypatch.setattr("eutree.training.stored_observations", lambda _: seen)
    asked = ("verify", "two.json", "--property", "no dead leaves")
    assert eutree(*asked, "--demos", demonstrations).code == 0
    assert eutree(*asked, "--run", "run").code == 1
    assert eutree(*asked, "--demos", demonstrations, "--run", "run").code == 0


def test_a_run_of_another_task_says_nothing_of_a_tree(eutree, monkeypatch):
    """As many features were enough: leaves of one task were proven alive by another's steps."""
    tree = DecisionTree.single_leaf(3).split(0, 0, 1.0)
    for name in ("Pendulum-v1", "eutree/Evasion2-v0"):
        spec = EnvironmentSpec(name, {})
        schema = Schema(tuple(Feature(f"{name} {k}") for k in range(3)), ("one", "other"))
        Path(name[:3]).mkdir()
        TreePolicy(tree, [1, 0], schema, spec).save(Path(name[:3], "policy.json"))
    monkeypatch.setattr("eutree.training.stored_observations", lambda _: np.eye(3) * 2)
    asked = ("verify", "Pen/policy.json", "--property", "no dead leaves", "--run")
    assert eutree(*asked, "Pen").code == 0
    refused = eutree(*asked, "eut")
    assert refused.code == 2
    assert "eut must be a run of the policy's task Pendulum-v1 (3 features)" in refused.err


def test_after_a_rule_leaves_have_other_numbers(eutree, expert):
    rule = "always stop when position > 29 and opponent_1 <= 0"
    words = ("with the rules nodes and leaves have other numbers",)
    line = ("edit", expert, "--enforce", rule, "--out", "e.json", "--episodes", "0", "--json")
    assert not set(words) & set(eutree(*line).json["changes"])
    assert set(words) < set(eutree(*line, "--set-action", "0=stop").json["changes"])


def test_leaves_that_nothing_reaches_have_their_new_numbers(eutree):
    schema = Schema((Feature("x", "", 0.0, 10.0), Feature("y")), ("a", "b"))
    tree = DecisionTree.single_leaf(2).split(0, 0, 4.0).split(1, 0, 6.0)
    TreePolicy(tree, [0, 1, 0], schema).save("p.json")
    line = ("edit", "p.json", "--set-threshold", "0=7", "--out", "e.json", "--json")
    assert eutree(*line).json["warnings"] == ["no observation reaches leaf 1 any more"]
    said = eutree(*line, "--enforce", "always b when y <= 0 and x <= 10").json["warnings"]
    boxes = leaf_parts(TreePolicy.load("e.json").tree, schema)
    dead = np.flatnonzero(~is_box(*boxes)).tolist()
    assert said == [f"no observation reaches leaf {leaf}" for leaf in dead] != []


def test_verify_names_mistakes(eutree, expert):
    answer = eutree("verify", expert, "--property", "never fly")
    assert answer.code == 2
    assert "unknown action 'fly'" in answer.err


def test_why_names_the_demonstrations_behind_a_leaf(eutree, expert, demonstrations):
    answer = eutree("why", expert, "--observation", "0,5,5", "--demos", demonstrations, "--json")
    assert answer.code == 0
    assert answer.json["action"] in ("stop", "go")
    assert {entry["action"] for entry in answer.json["demonstrations"]} >= {answer.json["action"]}
    assert eutree("why", expert, "--observation", "0,5,5").out.startswith(answer.json["action"])
    assert eutree("why", expert, "--observation", "0;5").code == 2


def test_a_category_that_is_named_by_a_number_is_the_one_with_this_name(eutree):
    """It was taken for a code, and another observation was explained."""
    gear = Feature("gear", low=0, high=2, is_integer=True, categories=("1", "2", "3"))
    schema = Schema((gear,), ("go", "stop"))
    TreePolicy(DecisionTree.single_leaf(1).split(0, 0, 1.5), [0, 1], schema).save("gear.json")
    assert eutree("verify", "gear.json", "--property", "always go when gear is 2").code == 0
    assert eutree("why", "gear.json", "--observation", "2").out.startswith("go")
    assert eutree("why", "gear.json", "--observation", "3").out.startswith("stop")


def test_why_takes_the_names_of_categories(eutree):
    mode = Feature("mode", low=1, high=3, is_integer=True, categories=("off", "low", "high"))
    tree = DecisionTree.single_leaf(2).split_each([(0, 1, 2.5)])
    schema = Schema((Feature("heat"), mode), ("wait", "cool"))
    TreePolicy(tree, [0, 1], schema).save("policy.json")
    named = eutree("why", "policy.json", "--observation", "20, high")
    assert named.out == eutree("why", "policy.json", "--observation", "20,3").out
    assert named.out.startswith("cool")
    wrong = eutree("why", "policy.json", "--observation", "20,middle")
    assert wrong.code == 2
    assert "must have a number or one of off, low, high for mode, got 'middle'" in wrong.err
    assert (
        "observation must have 2 entries"
        in eutree("why", "policy.json", "--observation", "20,high,1").err
    )


def test_edit_shows_the_numbers_and_changes_nothing_by_itself(eutree, expert):
    answer = eutree("edit", expert)
    assert answer.code == 0
    assert answer.out.lstrip().startswith("0 ")
    assert "leaf 0: " in answer.out


def test_edit_writes_what_was_asked_and_evaluates_it(eutree, expert, tmp_path):
    before = eutree("why", expert, "--observation", "0,5,5", "--json").json
    other = {"stop": "go", "go": "stop"}[before["action"]]
    line = ["edit", expert, "--set-action", f"{before['leaf']}={other}", "--lock", "0"]
    answer = eutree(*line, "--out", "new.json", "--episodes", "5", "--json")
    assert answer.code == 0
    assert isinstance(answer.json["mean_return_after"], float)
    assert before["leaf"] in answer.json["locked"]
    after = eutree("why", "new.json", "--observation", "0,5,5", "--json").json
    assert after["action"] == other
    again = eutree("edit", "new.json", "--set-action", f"{before['leaf']}=go", "--out", "x.json")
    assert again.code == 2
    assert "unlock it first" in again.err


def test_edit_plays_nothing_where_the_environment_is_unknown(eutree, expert, monkeypatch):
    monkeypatch.delitem(gymnasium.registry, "eutree/Evasion2-v0")
    answer = eutree("edit", expert, "--set-threshold", "0=20", "--out", "new.json")
    assert (answer.code, "return" in answer.out) == (0, False)
    assert "changed, but not played: unknown environment 'eutree/Evasion2-v0'" in answer.err
    assert eutree("show", "new.json").out.count("20") >= 1


def test_edit_names_mistakes(eutree, expert):
    assert "--out must name the file" in eutree("edit", expert, "--lock", "0").err
    assert "must be NUMBER=VALUE" in eutree("edit", expert, "--set-action", "go").err
    assert "needs a number" in eutree("edit", expert, "--set-threshold", "0=x").err


def test_edit_accepts_a_file_that_was_changed_by_hand(eutree, expert, tmp_path):
    """A digit that had changed, in whatever way, was loaded and acted on."""
    text = expert.read_text()
    threshold = json.dumps(json.loads(text)["nodes"][0]["threshold"])
    path = tmp_path / "mine.json"
    path.write_text(text.replace(f'"threshold":{threshold}', '"threshold":3.25', 1))
    answer = eutree("evaluate", path, "--episodes", "2")
    assert (answer.code, f"eutree edit {path} --reseal" in answer.err) == (2, True)
    line = ("edit", path, "--reseal")
    assert eutree(*line, "--out", tmp_path / "copy.json").code == 0
    assert eutree("evaluate", path, "--episodes", "2").code == 2
    assert eutree(*line).code == 0
    assert path.read_bytes() == (tmp_path / "copy.json").read_bytes()
    assert eutree("evaluate", path, "--episodes", "2").code == 0


def test_edit_enforces_a_rule_that_verify_then_proves(eutree, expert, tmp_path):
    rule = "always stop when position <= 1"
    line = ["edit", expert, "--enforce", rule, "--out", tmp_path / "ruled.json", "--json"]
    answer = eutree(*line, "--episodes", "0")
    assert (answer.code, len(answer.json["locked"])) == (0, 1)
    assert answer.json["changes"] == [f"{rule}: a rule of its own now, locked"]
    assert eutree("verify", tmp_path / "ruled.json", "--property", rule).code == 0
