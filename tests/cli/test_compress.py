"""``eutree compress``: a budget, a margin, short thresholds, and one line for each mistake."""

from dataclasses import replace

import pytest

from eutree.cli._output import said_what_is_played
from eutree.compression.imagined import Pruned
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from tests.little_search import little_search


def test_a_budget_is_kept_and_evaluated(eutree, expert, demonstrations):
    line = ["compress", expert, "--demos", demonstrations, "--out", "small.json", "--json"]
    exact = eutree(*line, "--mode", "lossless").json
    assert exact["by"] == "labels"
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


def test_the_confidence_is_that_of_the_change_that_is_reported(eutree, expert):
    """A search by playing did not hear it, nor refuse what is none."""
    line = ["compress", expert, "--out", "small.json", "--episodes", "20", "--json"]
    wide, narrow = (eutree(*line, "--confidence", c).json["return_change"] for c in (0.95, 0.6))
    assert narrow[1] - narrow[0] < wide[1] - wide[0]


def test_rounded_thresholds_are_played_where_they_can_be(eutree, expert, demonstrations):
    line = ["--demos", demonstrations, "--out", "small.json", "--round", "--episodes", "20"]
    line += ["--mode", "lossless"]
    assert "rounded, it earned" in eutree("compress", expert, *line).out
    assert eutree("compress", expert, *line, "--json").json["rounding"]["episodes"] == 20
    elsewhere = replace(TreePolicy.load(expert), environment=EnvironmentSpec("Nowhere-v0"))
    elsewhere.save("elsewhere.json")
    said = eutree("compress", "elsewhere.json", *line).out
    assert "nothing was played: unknown environment 'Nowhere-v0'" in said


def test_mistakes_are_named(eutree, expert, demonstrations):
    line = ["compress", expert, "--demos", demonstrations, "--out", "small.json"]
    cases = {
        ("--imagined",): "imagined needs max_leaves",
        ("--weights", "q-gap", "--max-disagreement", "0.1"): 'weights must be "visits"',
        ("--max-disagreement", "2"): "max_disagreement must be a number in [0, 1]",
        ("--max-disagreement", "0.1", "--return-margin", "1"): "got both",
    }
    for options, message in cases.items():
        answer = eutree(*line, *options)
        assert answer.code == 2
        assert message in answer.err
    replace(TreePolicy.load(expert), environment=None).save("nowhere.json")
    line = ["compress", "nowhere.json", "--out", "x.json"]
    assert "must be a run folder, or --demos" in eutree(*line).err
    assert "must name an environment" in eutree(*line, "--env-arg", "noise=0").err
    assert "--front needs an environment" in eutree(*line, "--front", "front").err


def test_a_tree_alone_is_made_smaller_by_playing(eutree, expert):
    """No demonstrations are needed: the front is drawn, written, and in the answer."""
    line = ["compress", expert, "--out", "small.json", "--episodes", "40", "--seed", "1"]
    answer = eutree(*line, "--front", "front", "--json").json
    assert answer["by"] == "episodes"
    sizes = [one["n_leaves"] for one in answer["front"]]
    assert sizes[0] == answer["n_leaves_before"]
    assert sizes[1:] == sorted(set(sizes[1:]), reverse=True)
    for one in answer["front"]:
        assert TreePolicy.load(one["path"]).n_leaves == one["n_leaves"]
        assert one["return_interval"][0] <= one["mean_return"] <= one["return_interval"][1]
    words = eutree(*line).out
    assert "leaves  return [95 %]" in words
    assert f"{answer['front'][0]['mean_return']:.2f}" in words
    limited = eutree(*line, "--max-leaves", str(sizes[-1] + 1), "--json").json
    assert limited["n_leaves_after"] <= sizes[-1] + 1
    assert limited["mean_return_after"] >= answer["front"][-1]["mean_return"] - 1e-9


def test_where_nothing_can_be_played_the_model_of_the_run_chooses(eutree, demonstrations):
    line = ["learn", "eutree/Evasion2-v0", "--demos", demonstrations, "--out", "run"]
    assert eutree(*line, "--episodes", "6", "--evaluation-episodes", "2").code == 0
    policy = replace(TreePolicy.load("run/policy.json"), environment=EnvironmentSpec("Nowhere-v0"))
    policy.save("run/policy.json")
    with little_search():
        found = eutree("compress", "run", "--out", "small.json", "--max-leaves", "4", "--json").json
    assert (found["by"], found["environment_steps"]) == ("model", 0)
    assert found["n_leaves_after"] <= 4


@pytest.mark.parametrize(
    "options",
    [
        ("--imagined", "--max-leaves", 2),
        ("--imagined", "--max-leaves", 2, "--evaluate", "--against", "fall"),
        ("--mode", "lossless", "--round"),
    ],
)
def test_as_many_episodes_are_played_as_are_announced(eutree, options, monkeypatch):
    """It said "episodes played: 91 of 20"."""
    announced, played = [], []

    def heard(total, **more):
        announced.append(total)
        return said_what_is_played(total, **more)

    monkeypatch.setattr("eutree.cli.compress.said_what_is_played", heard)
    monkeypatch.setattr("eutree.cli._output._Counting.emit", lambda self, one: played.append(one))
    monkeypatch.setattr("eutree.compression.compressing.ASKED", 3)
    monkeypatch.setattr("eutree.compression.episodes.ROUNDED_EPISODES", 5)
    monkeypatch.setattr(Pruned, "check_order", lambda *_: None)
    line = ("record", "CartPole-v1", "--expert", "balance", "--episodes", 2, "--out", "demos")
    assert eutree(*line).code == 0
    assert eutree("fit", "demos", "--out", "large.json", "--no-pruning", "--episodes", 0).code == 0
    line = ("compress", "large.json", "--demos", "demos", "--out", "small.json", "--n-jobs", 1)
    answer = eutree(*line, "--episodes", 20, *options)
    assert answer.code == 0, answer.err
    assert announced == [len(played)]


def test_demonstrations_that_are_named_are_asked_in_place_of_those_of_the_run(
    eutree, demonstrations
):
    """A run folder hid them, from `--imagined` too."""
    line = ["learn", "eutree/Evasion2-v0", "--demos", demonstrations, "--out", "run"]
    assert eutree(*line, "--episodes", "6", "--evaluation-episodes", "2").code == 0
    replace(TreePolicy.load("run/policy.json"), environment=None).save("run/policy.json")
    for options in [("--mode", "lossless"), ("--imagined", "--max-leaves", "4")]:
        line = ["--out", "small.json", *options]
        named = [*line, "--demos", demonstrations]
        with little_search():
            alone = eutree("compress", "run/policy.json", *named)
            assert alone.code == 0
            assert eutree("compress", "run", *named) == alone
            assert eutree("compress", "run", *line) != alone
