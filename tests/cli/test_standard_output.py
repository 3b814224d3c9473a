"""With --json there is one JSON object on standard output, whatever an environment prints."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import eutree as package
from eutree.cli._output import Output
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree

LOUD = """
import ctypes, os
import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete

libc = ctypes.CDLL(None)


class Loud(gymnasium.Env):
    observation_space, action_space = Box(0.0, 1.0, (1,), np.float64), Discrete(2)

    def __init__(self):
        print("made")

    def reset(self, *, seed=None, options=None):
        print("begins")
        return np.zeros(1), {}

    def step(self, action):
        print("step")
        os.write(1, b"from the system\\n")
        libc.printf(b"from C\\n")
        return np.zeros(1), 1.0, True, False, {}


gymnasium.register("Loud-v0", Loud)
"""
LINE = ("evaluate", "policy.json", "--import", "loud", "--episodes", "2")


def prepare(folder):
    (folder / "loud.py").write_text(LOUD)
    tree, schema = DecisionTree.single_leaf(1), Schema.anonymous(1, 2)
    policy = TreePolicy(tree, np.array([1]), schema, EnvironmentSpec("Loud-v0"))
    policy.save(folder / "policy.json")


def call(folder, *line, python=("-m", "eutree")):
    environment = os.environ | {"PYTHONPATH": str(Path(package.__file__).parents[1])}
    return subprocess.run(
        [sys.executable, *python, *line],
        cwd=folder, env=environment, capture_output=True, text=True,
    )  # fmt: skip


def test_an_environment_that_prints_does_not_break_json(tmp_path):
    prepare(tmp_path)
    done = call(tmp_path, *LINE, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["episodes"] == 2
    for said in ("made", "begins", "step", "from the system", "from C"):
        assert said in done.stderr
    assert "begins" in call(tmp_path, *LINE).stdout  # the control: without --json it is let be


def test_nor_within_a_process(eutree, tmp_path):
    prepare(tmp_path)
    try:
        answer = eutree(*LINE, "--json")
        assert answer.json["mean_return"] == 1.0
        assert "begins" in answer.err
    finally:
        sys.modules.pop("loud", None)


@pytest.mark.parametrize("more", [(), ("--json",)], ids=["text", "json"])
def test_without_a_standard_output_nobody_is_told(tmp_path, more):
    """`evaluate --json >&-` was an internal error: None has no fileno."""
    prepare(tmp_path)
    line = (sys.executable, "-m", "eutree", *LINE, *more)
    code = f"import os, sys; os.close(1); os.execv(sys.executable, {line})"
    done = call(tmp_path, python=("-c", code))
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert "error" not in done.stderr


def test_a_mistake_leaves_standard_output_empty(tmp_path):
    done = call(tmp_path, "evaluate", "missing.json", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: cannot read missing.json")


def test_a_target_is_tried_before_the_work(eutree, tmp_path, monkeypatch, expert, demonstrations):
    """`show --html` played episodes for 20 s before it found that it could not write."""

    def works(*arguments, **options):
        raise AssertionError("worked before it tried the target")

    for place, name in (
        (importlib.import_module("eutree.report.watching"), "watch_if_possible"),
        (importlib.import_module("eutree.cli.inspecting"), "evaluate"),
        (importlib.import_module("eutree.distillation"), "distill"),
        (importlib.import_module("eutree.compression"), "compress"),
        (importlib.import_module("eutree.report"), "demonstration_figures"),
    ):
        monkeypatch.setattr(place, name, works)
    lines = [
        ("show", expert, "--html"),
        ("demos", "stats", demonstrations, "--html"),
        ("distill", "eutree/Evasion2-v0", "--expert", "gate", "--out"),
        ("compress", expert, "--demos", demonstrations, "--out"),
        ("edit", expert, "--set-action", "0=stop", "--set-action", "1=stop", "--out"),
    ]
    for line in lines:
        answer = eutree(*line, "no/where")
        assert (answer.code, answer.err.count("\n")) == (2, 1), answer.err
        assert "cannot write no/where: the folder no does not exist" in answer.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("say", [Output.say, lambda output, text: output.result({}, text)])
def test_colons_around_a_word_are_no_picture(capfd, say):
    say(Output(as_json=False), "plant:Guard: 20 episodes")
    assert "plant:Guard: 20 episodes" in "".join(capfd.readouterr())
