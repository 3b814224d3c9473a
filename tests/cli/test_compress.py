"""``eutree compress``: a budget, a margin, short thresholds, and one line for each mistake."""

from dataclasses import replace

from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec


def test_a_budget_is_kept_and_evaluated(eutree, expert, demonstrations):
    line = ["compress", expert, "--demos", demonstrations, "--out", "small.json", "--json"]
    exact = eutree(*line).json
    assert (exact["agreement"], exact["environment_steps"]) == (1.0, 0)
    answer = eutree(*line, "--max-disagreement", "0.2", "--evaluate", "--episodes", "20")
    assert answer.code == 0
    assert answer.json["weighted_disagreement"] <= 0.2
    assert answer.json["n_leaves_after"] < exact["n_leaves_after"]
    assert answer.json["environment_steps"] > 40
    assert TreePolicy.load("small.json").n_leaves == answer.json["n_leaves_after"]


def test_a_margin_is_kept_and_its_steps_are_counted(eutree, expert, demonstrations):
    line = ["compress", expert, "--demos", demonstrations, "--out", "small.json", "--seed", "1"]
    answer = eutree(*line, "--return-margin", "30", "--episodes", "60", "--round", "--json")
    assert answer.code == 0
    assert answer.json["return_change"][0] >= -30
    assert answer.json["environment_steps"] > 120
    words = eutree(*line, "--return-margin", "30", "--episodes", "60", "--round").out
    assert f"{answer.json['environment_steps']} environment steps in all" in words


def test_rounded_thresholds_are_played_where_they_can_be(eutree, expert, demonstrations):
    line = ["--demos", demonstrations, "--out", "small.json", "--round", "--episodes", "20"]
    assert "rounded, it earned" in eutree("compress", expert, *line).out
    assert eutree("compress", expert, *line, "--json").json["rounding"]["episodes"] == 20
    elsewhere = replace(TreePolicy.load(expert), environment=EnvironmentSpec("Nowhere-v0"))
    elsewhere.save("elsewhere.json")
    said = eutree("compress", "elsewhere.json", *line).out
    assert "the rounded thresholds were not played: unknown environment 'Nowhere-v0'" in said


def test_mistakes_are_named(eutree, expert, demonstrations):
    line = ["compress", expert, "--demos", demonstrations, "--out", "small.json"]
    cases = {
        ("--env-arg", "noise=0"): "--env-arg needs --evaluate or --return-margin",
        ("--weights", "q-gap", "--max-disagreement", "0.1"): 'weights must be "visits"',
        ("--max-disagreement", "2"): "max_disagreement must be a number in [0, 1]",
        ("--max-disagreement", "0.1", "--return-margin", "1"): "got both",
    }
    for options, message in cases.items():
        answer = eutree(*line, *options)
        assert answer.code == 2
        assert message in answer.err
    assert "must be a run folder, or --demos" in eutree("compress", expert, "--out", "x.json").err
