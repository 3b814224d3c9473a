"""Small faults that new users met, each with the command line that showed it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from eutree.__main__ import _in_one_line
from eutree.cli.compress import _in_words as in_words
from eutree.compression.episodes import CompressionReport
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from tests.patience import ENOUGH
from tests.training.processes import COMMAND


@pytest.mark.parametrize(
    "line",
    [
        ("evaluate", "x.json", "--seed", 1, "--seed", 2),
        ("learn", "eutree/Evasion2-v0", "--out", "a", "--seed", 1, "--out", "b"),
        ("demos", "stats", "demos", "--html", "a", "--html", "b"),
    ],
)
def test_an_option_given_twice_is_refused(eutree, line):
    """The last one won without a word: --seed 1 --seed 2 was seed 2."""
    answer = eutree(*line)
    assert answer.code == 2
    assert answer.err.startswith("error: --")
    assert answer.err.endswith(" is given 2 times\n")


def test_what_may_be_repeated_and_flags_are_not_refused(eutree, expert):
    line = ("--env-arg", "opponent_speed=4", "--env-arg", "noise=0.1", "--json", "--json")
    assert eutree("evaluate", expert, "--episodes", 2, *line).code == 0
    assert eutree("demos", "list", "--help", "--help").code == 0


def test_a_file_of_no_known_kind_lists_the_ways_out(eutree, expert):
    said = eutree("export", expert, "--out", "room.foo").err
    assert "--out must end in one of .c, .onnx," in said
    assert "--format must be one of c, onnx," in said
    assert "room.foo" in said


def test_an_unknown_environment_points_to_import(eutree):
    said = eutree("record", "Furnace-v0", "--expert", "gate", "--out", "x").err
    assert "known once its module is imported: --import MODULE" in said


def test_ctrl_c_in_the_demo_says_so(tmp_path):
    demo = subprocess.Popen(
        [sys.executable, "-m", "eutree", "demo", "--out", str(tmp_path / "d")],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    mark = tmp_path / "d" / ".eutree-demo"
    for _ in range(int(10 * ENOUGH)):
        if mark.exists() or demo.poll() is not None:
            break
        time.sleep(0.1)
    os.kill(demo.pid, signal.SIGINT)
    _, said = demo.communicate(timeout=ENOUGH)
    assert demo.returncode == 130
    assert "interrupted" in said.splitlines()  # of a process it stopped, another may say more


def test_compression_that_changes_nothing_says_so(eutree, expert, demonstrations):
    line = ("compress", expert, "--demos", demonstrations, "--out", "small.json", "--mode", "merge")
    said = " ".join(eutree(*line).out.split())
    before = TreePolicy.load(expert).n_leaves
    assert f"still {before} leaves: no smaller tree was found (merge, chosen by labels)" in said


def test_a_better_tree_of_the_same_size_is_not_called_nothing():
    report = CompressionReport(2, 2, 0.75, 0.01, "return", 0.25)
    assert in_words(report, 4).startswith(
        "still 2 leaves: no smaller tree was found, but a better one of that size (return, chosen"
    )


def test_a_warning_of_gymnasium_comes_without_its_colours():
    said = _in_one_line(UserWarning("\x1b[33mWARN: Box low's precision lowered\x1b[0m"))
    assert said == "warning: Box low's precision lowered\n"


NOISY = """
import gymnasium, numpy

class Noisy(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-1, 1, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, render_mode=None):
        gymnasium.logger.warn("made with noise")

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return numpy.zeros(1, numpy.float32), {}

    def step(self, action):
        return numpy.zeros(1, numpy.float32), 1.0, True, False, {}

gymnasium.register("Noisy-v0", Noisy, max_episode_steps=10)
"""


def test_a_warning_of_other_processes_is_said_once_by_the_command(tmp_path):
    (tmp_path / "noisy.py").write_text(NOISY)
    leaf = DecisionTree.single_leaf(1)
    schema, task = Schema.anonymous(1, 2), EnvironmentSpec("Noisy-v0")
    TreePolicy(leaf, np.array([0]), schema, task).save(tmp_path / "tree.json")
    code = f"import eutree.parallel as p; p.PATIENCE = 0; {COMMAND}"
    line = ["evaluate", "tree.json", "--import", "noisy", "--episodes", "40", "--n-jobs", "2"]
    done = subprocess.run(
        [sys.executable, "-c", code, *line],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True,
        text=True,
        timeout=ENOUGH,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "\x1b" not in done.stderr
    assert done.stderr.count("made with noise") == 1
    assert "warning: made with noise\n" in done.stderr


def test_thresholds_are_rounded_to_steps(eutree, expert, demonstrations):
    """--round left 20.12699 where two recorded temperatures lay on both sides of it."""
    line = ("compress", expert, "--demos", demonstrations, "--out", "small.json", "--json",
            "--mode", "lossless", "--episodes", 20)  # fmt: skip
    assert eutree(*line, "--round", "0.5").code == 0
    tree = TreePolicy.load("small.json").tree
    cuts = tree.threshold[tree.feature >= 0]
    assert all(c % 0.5 == 0 or (c + 1e-9) % 0.5 < 2e-9 for c in cuts.tolist())
    assert eutree(*line, "--round", "position=2").code == 0
    tree = TreePolicy.load("small.json").tree
    assert all(round(c, 9) % 2 == 0 for c in tree.threshold[tree.feature == 0].tolist())
    assert any(round(c, 9) % 2 for c in tree.threshold[tree.feature > 0].tolist())
    assert eutree(*line, "--round").code == 0
    for wrong, message in (
        ("room=1", "unknown feature 'room'"),
        ("small", "--round must be alone, a step, or FEATURE=STEP, got 'small'"),
        ("0", "the step of position must be a number in (0, inf"),
    ):
        assert message in eutree(*line, "--round", wrong).err


def test_learning_from_a_log_does_not_speak_of_no_episodes(eutree, demonstrations):
    """It ended with "eu-tree: 0 episodes, 0 steps"."""
    line = ("learn", "--demos", demonstrations, "--offline", "--episodes", 1, "--out", "run")
    answer = eutree(*line)
    assert answer.code == 0, answer.err
    said = " ".join(answer.out.split())
    assert "8 recorded episodes, none of its own" in said
    assert "0 steps" not in said


def test_learning_from_a_log_takes_the_range_of_returns(eutree, demonstrations):
    line = ("learn", "--demos", demonstrations, "--offline", "--episodes", 1, "--out", "run")
    answer = eutree(*line, "--return-range", 5, -5)
    assert answer.code == 2
    assert "return_range must be the lowest and the highest of a finite range" in answer.err
    answer = eutree(*line, "--return-range", -100, 100, "--json")
    assert answer.json["against_fit"]["believed"] is False
    assert answer.json["handed_over"] == "start"  # it said "learned", and gave no reason
    assert (
        answer.json["why"] == "the learned tree is not believed to earn more than the tree of fit"
    )
    assert json.loads(Path("run/config.json").read_text())["return_range"] == [-100.0, 100.0]


@pytest.mark.parametrize("command", ["learn", "fit", "compress", "record"])
def test_help_has_no_range_that_nothing_reaches(eutree, command):
    """Every whole number ended in [0<=x<=1000000000]."""
    assert "1000000000" not in eutree(command, "--help").out
    assert "is not in the range 1<=x<=" in eutree("record", "x", "--out", "y", "--episodes", 0).err


def test_a_renamed_policy_is_played_under_its_old_names(eutree, expert, tmp_path):
    names = tmp_path / "names.json"
    names.write_text('{"actions": ["wait", "drive"]}')
    out = tmp_path / "named.json"
    answer = eutree("edit", expert, "--rename", names, "--out", out, "--episodes", 3)
    assert answer.code == 0, answer.err
    assert "on the same 3 episodes" in answer.out
    assert TreePolicy.load(out).schema.actions == ("wait", "drive")
    names.write_text('{"derived": ["twice = position * 2"]}')
    answer = eutree("edit", expert, "--rename", names, "--out", out)
    assert "--rename must name features and actions alone, got derived" in answer.err


def test_of_several_files_all_are_written_or_none(eutree, expert, tmp_path):
    (tmp_path / "room.h").mkdir()
    answer = eutree("export", expert, "--out", tmp_path / "room.c", "--header")
    assert answer.code == 2
    assert not (tmp_path / "room.c").exists()


def test_an_argument_of_a_plant_that_is_no_number(eutree, tmp_path):
    line = ("prove", "zoo:MountainCar-v0", "--env-arg", "goal_velocity=abc")
    assert "goal_velocity must be a number" in eutree(*line).err


def test_what_a_last_action_earned_is_said_to_count_nowhere(eutree, tmp_path):
    """A crash that ends an episode of a log without a row behind it was not heard of again."""
    said = "is left out: nothing says what it led to"
    rows = ["episode,action,reward,terminated,x", "1,0,1,false,2", "1,1,-100,true,3"]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    answer = eutree("demos", "import", "log.csv", "--out", "with")
    assert f"{said}, so what it earned counts nowhere" in answer.out + answer.err
    (tmp_path / "log.csv").write_text("episode,action,x\n1,0,2\n1,1,3\n")
    answer = eutree("demos", "import", "log.csv", "--out", "without")
    assert said in answer.out + answer.err
    assert "counts nowhere" not in answer.out + answer.err


def test_values_that_the_environment_cannot_have_are_refused_on_import(eutree, tmp_path):
    """They were taken, other than with --names."""
    for number, square in enumerate(("999", "3.7")):
        rows = ["episode,action,reward,terminated,square", f"a,0,-1,false,{square}", "a,,,,47"]
        (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
        answer = eutree(
            "demos", "import", "log.csv", "--env", "CliffWalking-v1", "--out", f"d{number}"
        )
        assert answer.code == 2
        assert "is declared to be a whole number from 0 to 47, and" in answer.err
        assert not (tmp_path / f"d{number}").exists()


def test_a_log_whose_ends_are_where_the_last_action_was_taken(eutree, tmp_path):
    rows = ["episode,action,reward,terminated,x", "1,0,1,false,2", "1,1,-100,true,3"]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    assert "(but see --ends-in-place)" in eutree("demos", "import", "log.csv", "--out", "a").out
    answer = eutree("demos", "import", "log.csv", "--ends-in-place", "--out", "b", "--json")
    assert (answer.json["n_transitions"], answer.json["dropped_actions"]) == (2, 0)
    arrays = {"obs": [[2.0], [3.0]], "acts": [0, 1], "rews": [1.0, -100.0], "terminals": [0, 1]}
    np.savez(tmp_path / "log.npz", **{name: np.array(one) for name, one in arrays.items()})
    answer = eutree("demos", "import", "log.npz", "--ends-in-place", "--out", "c", "--json")
    assert answer.json["n_transitions"] == 2
    assert (
        "file .csv"
        in eutree("demos", "import", "minari:a/b-v0", "--ends-in-place", "--out", "d").err
    )
