"""Trees that keep a rule, from the shell: fitted, learned and compressed ones pass ``verify``."""

import json
from pathlib import Path

import pytest

RULES = ["right in angle", "right in turn rate"]
ASKED = [word for rule in RULES for word in ("--monotone", rule)]


@pytest.fixture
def demos(eutree):
    line = ["record", "CartPole-v1", "--expert", "balance", "--careless", 0.2, "--episodes", 30]
    short = ["--env-arg", "max_episode_steps=60"]
    assert eutree(*line, *short, "--out", "demos", "--seed", 2).code == 0
    return "demos"


def proven(eutree, path):
    answers = [word for rule in RULES for word in ("--property", f"monotone {rule}")]
    return eutree("verify", path, *answers).code == 0


def test_a_fitted_tree_keeps_the_rules(eutree, demos):
    line = ["fit", demos, "--out", "e.json", "--no-pruning", "--episodes", 10]
    assert eutree(*line).code == 0
    assert not proven(eutree, "e.json")
    assert eutree(*line, *ASKED).code == 0
    assert proven(eutree, "e.json")
    assert eutree(*line, *ASKED, "--practise", 2).code == 0
    assert proven(eutree, "e.json")
    assert eutree(*line[:-1], 0, *ASKED).code == 0
    assert proven(eutree, "e.json")


LITTLE = ["--set", "planner.n_steps=2000", "--set", "planner.improvement.deviations=500"]


@pytest.mark.parametrize(("method", "little"), [("planning", LITTLE), ("u-tree", [])])
def test_a_learned_tree_keeps_them_and_so_does_the_start(eutree, demos, method, little):
    line = ["learn", "CartPole-v1", "--demos", demos, "--episodes", 3, "--method", method,
            "--evaluation-episodes", 3, "--evaluate-every", 2, "--out", "run", *little]  # fmt: skip
    assert eutree(*line, *ASKED, "--judge-episodes", 5, "--front-steps", 2000).code == 0
    assert proven(eutree, "run/policy.json")
    assert json.loads(Path("run/config.json").read_text())["monotone"] == RULES
    other = eutree(*line, "--monotone", "right in angle", "--judge-episodes", 5, "--resume",
                   "--front-steps", 2000)  # fmt: skip
    assert other.code == 2
    assert "started with monotone ('right in angle', 'right in turn rate')" in other.err
    assert eutree("learn", "--out", "run", "--resume", "--episodes", 4).code == 0
    assert proven(eutree, "run/policy.json")


def test_a_compressed_tree_keeps_them(eutree, demos):
    line = ["fit", demos, "--out", "e.json", "--no-pruning", "--episodes", 0]
    assert eutree(*line, *ASKED).code == 0
    small = ["compress", "e.json", "--out", "s.json", "--demos", demos, "--mode", "lossless"]
    assert eutree(*small, *ASKED).code == 0
    assert proven(eutree, "s.json")
    assert eutree(*line).code == 0
    answer = eutree(*small, *ASKED)
    assert answer.code == 2
    assert "policy must keep 'monotone right in angle'" in answer.err


def test_a_wrong_rule_is_one_line_before_anything_is_done(eutree, demos):
    for command in (
        ["fit", demos, "--out", "e.json"],
        ["learn", "CartPole-v1", "--demos", demos, "--out", "run"],
    ):
        answer = eutree(*command, "--monotone", "right in angel")
        assert answer.code == 2
        assert "unknown feature 'angel'. Did you mean 'angle'?" in answer.err
        answer = eutree(*command, "--monotone", "right in angle", "--monotone", "left in angle")
        assert answer.code == 2
        assert "both directions of angle" in answer.err
