"""Derived features from the shell: declared once, they go with all that follows."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np

from eutree.policies import TreePolicy
from tests.little_search import little_search


def test_from_the_shell(eutree):
    Path("d.txt").write_text("# two\nlean = angle / position\nturn = angle - last(angle)\n")
    for line in (
        "record CartPole-v1 --expert fall --episodes 4 --out raw --seed 1",
        "fit raw --derive d.txt --out p.json --episodes 5",
        "evaluate p.json --episodes 3",
        "evaluate p.json CartPole-v1 --episodes 3",
        "why p.json --observation 0,1,2,3 --demos raw",
        "show p.json --html p.html --episodes 1",
        "verify p.json --property 'no dead leaves' --demos raw",
        "compress p.json --max-leaves 3 --episodes 3 --out small.json",
        "compress p.json --demos raw --return-margin 50 --episodes 3 --out small.json",
        "diff p.json small.json",
        "edit p.json --enforce 'always left when angle <= -0.2' --episodes 2 --out safe.json",
    ):
        with little_search():
            answer = eutree(*shlex.split(line))
        assert answer.code in (0, 1), answer.err
    policy = TreePolicy.load("p.json")
    assert [feature.name for feature in policy.schema.derived] == ["lean", "turn"]


def test_pages_and_the_terminal_say_what_is_derived(eutree):
    assert eutree("record", "CartPole-v1", "--expert", "fall", "--episodes", 4, "--out", "raw",
                  "--seed", 1).code == 0  # fmt: skip
    line = ["fit", "raw", "--derive", 'spin = 2 * "turn rate"', "--release-8", "--episodes", 0]
    assert eutree(*line, "--history", 0, "--out", "p.json").code == 0
    policy = TreePolicy.load("p.json")
    spin = policy.tree.__class__.single_leaf(5).split(0, 4, 0.0)
    replace(policy, tree=spin, actions=[0, 1], leaves=None).save("q.json")
    said = "where spin [rad/s] = 2 * turn rate"
    assert said in eutree("show", "q.json").out
    assert eutree("show", "q.json", "--html", "q.html", "--episodes", 0).code == 0
    assert said in Path("q.html").read_text()


def test_a_run_goes_on_with_them(eutree):
    assert (
        eutree("record", "CartPole-v1", "--expert", "fall", "--episodes", 4, "--out", "raw").code
        == 0
    )
    line = ["learn", "CartPole-v1", "--demos", "raw", "--derive", "lean = angle / position",
            "--episodes", 2, "--judge-episodes", 0, "--front-steps", 0, "--method", "u-tree",
            "--out", "run"]  # fmt: skip
    assert eutree(*line).code == 0
    learned = TreePolicy.load("run/policy.json")
    assert learned.schema.derived[0].formula == "angle / position"
    assert eutree("learn", "--out", "run", "--resume", "--episodes", 4).code == 0
    assert TreePolicy.load("run/policy.json").schema == learned.schema


def test_a_run_goes_on_with_no_others(eutree):
    """The stored steps had a column of products and sums, which one name was given to."""
    line = ["learn", "CartPole-v1", "--episodes", 2, "--judge-episodes", 0, "--front-steps", 0,
            "--method", "u-tree", "--out", "run"]  # fmt: skip
    assert eutree(*line, "--derive", "both = angle * position").code == 0
    again = ["learn", "--out", "run", "--resume", "--episodes", 4]
    refused = eutree(*again, "--derive", "both = angle + position")
    assert refused.code == 2
    assert "the run was started with names" in refused.err
    assert "both = angle * position" in refused.err
    assert eutree(*again).code == 0


def test_a_mistake_is_one_line(eutree):
    line = ["record", "CartPole-v1", "--expert", "fall", "--out", "raw"]
    answer = eutree(*line, "--derive", "lean = angel / position")
    assert answer.code == 2
    assert "unknown feature 'angel'. Did you mean 'angle'?" in answer.err
    answer = eutree(*line, "--derive", "missing.txt")
    assert answer.code == 2
    assert "missing.txt" in answer.err


def test_fit_proposes_what_would_help(eutree):
    generator = np.random.default_rng(0)
    lines = ["episode,left [m],right [m],action"]
    for step in range(600):
        left, right = generator.uniform(0.0, 9.0, 2)
        lines.append(f"{step // 100},{left},{right},{'stop' if left > right else 'go'}")
    Path("log.csv").write_text("\n".join(lines))
    assert eutree("demos", "import", "log.csv", "--out", "shown").code == 0
    answer = eutree("fit", "shown", "--out", "p.json")
    hint = next(line for line in answer.out.splitlines() if line.startswith("a feature `"))
    asked = shlex.split(hint)[-2:]
    again = eutree("fit", "shown", "--out", "p.json", *asked)
    assert again.code == 0
    assert "a feature `" not in again.out
    auto = eutree("fit", "shown", "--derive", "auto", "--out", "q.json")
    assert auto.code == 0, auto.err
    assert "derived `left minus right = left - right`: 2 leaves in place of" in auto.out
    assert Path("p.json").read_bytes() == Path("q.json").read_bytes()
    assert eutree("export", "q.json", "--format", "c", "--out", "q.c").code == 0
    refused = eutree("evaluate", "q.json", "CartPole-v1", "--derive", "auto")
    assert refused.code == 2
    assert "auto is understood by fit" in refused.err


def test_a_policy_is_loaded_where_features_are_declared(eutree):
    """``--derive`` and a file's "derived" were taken for those of ``edit --rename``."""
    turn = "turn = angle - last(angle)"
    Path("names.json").write_text(json.dumps({"derived": [turn]}))
    assert eutree("record", "CartPole-v1", "--expert", "fall", "--episodes", 4, "--out", "raw",
                  "--seed", 1).code == 0  # fmt: skip
    for options, out in ((), "plain.json"), (("--names", "names.json"), "derived.json"):
        line = ("fit", "raw", "--history", 0, "--episodes", 0, "--out", out, *options)
        assert eutree(*line).code == 0
        alone = eutree("evaluate", out, "--episodes", 3).out
        for again in (("--derive", turn), ("--names", "names.json")):
            assert eutree("evaluate", out, "--episodes", 3, *again).out == alone
            distilled = eutree("distill", "CartPole-v1", "--policy", out, "--demos", "raw",
                               "--method", "cloning", "--validation-episodes", 2, "--out", "d.json",
                               *again)  # fmt: skip
            assert distilled.code == 0, distilled.err
            assert TreePolicy.load("d.json").schema.derived[0].name == "turn"
            edited = eutree("edit", out, "--set-action", "0=left", "--episodes", 2, "--out",
                            "e.json", *again)  # fmt: skip
            assert edited.code == 0, edited.err
            shown = eutree("show", out, "--html", "p.html", "--episodes", 2, *again)
            assert "no episodes" not in shown.out
    other = eutree("evaluate", "derived.json", "--derive", "turn = angle * 2", "--episodes", 3)
    assert other.code == 2
    assert "as those of the environment, ['angle * 2'], got ['angle - last(angle)']" in other.err
    past = ("fit", "raw", "--history", 1, "--episodes", 0, "--out", "past.json")
    assert eutree(*past).code == 0
    refused = eutree("evaluate", "past.json", "--derive", turn)
    assert refused.code == 2
    assert "past.json must have the features" in refused.err


def test_a_teacher_s_demonstrations_need_not_have_what_it_derives(eutree):
    line = ("record", "CartPole-v1", "--expert", "fall", "--episodes", 4, "--out", "raw")
    assert eutree(*line).code == 0
    assert eutree("fit", "raw", "--derive", "lean = angle / position", "--history", 0,
                  "--episodes", 0, "--out", "p.json").code == 0  # fmt: skip
    for teacher in "--policy", "--expert":
        answer = eutree("distill", "CartPole-v1", teacher, "p.json", "--demos", "raw", "--method",
                        "cloning", "--validation-episodes", 2, "--out", "d.json")  # fmt: skip
        assert answer.code == 0, answer.err


def test_a_renamed_tree_with_derived_features_is_told_of_names(eutree):
    """Its formulas were read under the environment's names first: unknown feature 'tilt'."""
    line = ("record", "CartPole-v1", "--expert", "fall", "--episodes", 4, "--out", "raw")
    assert eutree(*line).code == 0
    assert eutree("fit", "raw", "--derive", "turn = angle - last(angle)", "--history", 0,
                  "--episodes", 0, "--out", "p.json").code == 0  # fmt: skip
    names = {"features": ["place [m]", "speed [m/s]", "tilt [deg]", "spin [deg/s]"]}
    Path("names.json").write_text(json.dumps(names))
    edited = eutree("edit", "p.json", "--rename", "names.json", "--episodes", 2, "--out", "q.json")
    assert edited.code == 0
    assert TreePolicy.load("q.json").schema.derived[0].unit == "deg"
    answer = eutree("evaluate", "q.json", "--episodes", 3)
    assert answer.code == 2
    assert "names of a file are given here, too, by --names" in answer.err
    named = eutree("evaluate", "q.json", "--episodes", 3, "--names", "names.json")
    assert named.out == eutree("evaluate", "p.json", "--episodes", 3).out
