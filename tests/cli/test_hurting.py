"""``eutree demos hurting``: what it names, what it writes, and that nothing is lost."""

import json
import re
from itertools import groupby
from operator import itemgetter

import numpy as np
import pytest
from benchmarks.people import folder as recorded_by

import eutree
from eutree.cli.main import run
from eutree.data import Demonstrations, Episode
from eutree.data.demonstrations import taught_in
from eutree.schema import Schema

TEACHES_WORSE = 4  # a folder whose tree succeeds in half of the episodes, and in 4 of 5 without it


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("people") / "demos"
    recorded_by("evasion", TEACHES_WORSE).save(path)
    return path


@pytest.fixture(scope="module")
def cut(folder, tmp_path_factory):
    """Return what the command says, and the folder that it has written."""
    out = tmp_path_factory.mktemp("cut") / "demos"
    with pytest.MonkeyPatch.context() as patched:
        said = []
        patched.setattr("eutree.cli._output.Output.result", lambda _, *words: said.append(words))
        asked = ["demos", "hurting", folder, "--out", out, "--episodes", 1000]
        assert run([*map(str, asked)]) == 0
    return *said[0], out


def test_no_progress_is_beyond_its_total(folder, monkeypatch, capsys):
    """Halving few episodes among many trees takes more than were asked for."""
    monkeypatch.setattr("eutree.fitting.hurting.MOST_PAIRS", 20)
    assert run(["demos", "hurting", str(folder), "--episodes", "30"]) == 0
    lines = re.findall(r"^(\w+) (\d+)/(\d+)$", capsys.readouterr().err, re.MULTILINE)
    assert [stage for stage, _ in groupby(lines, itemgetter(0))][:4] == [
        "choosing", "judging", "playing", "halving",
    ]  # fmt: skip
    for stage, count, total in lines:
        assert int(count) <= int(total), stage
    assert all(len(list(same)) <= 10 for _, same in groupby(lines, itemgetter(0)))


def test_it_names_segments_and_writes_a_folder_that_teaches_better(cut, folder):
    values, words, out = cut
    changed = [one for one in values["hurts"] if one["without"]]
    assert changed
    json.dumps(values)
    shown, left = Demonstrations.load(folder), Demonstrations.load(out)
    for one in changed:
        assert one["without"]["success_rate"] > one["with"]["success_rate"]
        assert one["what"] in ("cut", "flip")
        for part in one["segments"]:
            names = shown.schema.actions
            steps = shown.episodes[part["episode"]].actions[part["from_step"] : part["to_step"]]
            assert {names[action] for action in steps.tolist()} == {part["action"]}
            assert (part["becomes"] is None) == (one["what"] == "cut")
    assert (left.actions == shown.actions).all()
    env = eutree.interaction.making.make(shown.environment)
    before, after = (
        eutree.evaluate(eutree.fit_expert_tree(each), env, episodes=300, seed=9).success_rate
        for each in (shown, left)
    )
    assert after > before
    assert f"written to {out}" in words
    assert "with them" in words
    assert "without" in words


def test_what_was_cut_is_taken_back(cut, folder, capsys):
    out = cut[2]
    assert (taught_in(Demonstrations.load(out)) != Demonstrations.load(out).actions).any()
    assert run(["demos", "check", str(out), "--json"]) == 0  # what was done can be run again
    assert run(["demos", "hurting", str(out), "--undo", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["restored"]
    assert Demonstrations.load(out).digest == Demonstrations.load(folder).digest
    assert run(["demos", "hurting", str(out), "--undo"]) == 0
    assert "nothing was cut or flipped" in capsys.readouterr().out


def test_mistakes_give_one_line(folder, tmp_path, capsys):
    assert run(["demos", "hurting", str(folder), "--out", str(folder)]) == 2
    assert str(folder) in capsys.readouterr().err
    plain = eutree.Demonstrations.from_arrays([[0.0], [1.0]], [0, 1], starts=[True, False])
    plain.save(tmp_path / "log")
    assert run(["demos", "hurting", str(tmp_path / "log")]) == 2
    assert "names no environment" in capsys.readouterr().err


def test_taking_back_leaves_out_what_led_to_a_segment_that_was_shown_again(tmp_path, capsys):
    steps = {"taught": np.array([-1, -1, 1, -1])}
    facts = {
        "observations": np.arange(5.0)[:, None],
        "actions": [0, 1, 0, 1],
        "rewards": np.ones(4),
    }
    again = Episode(**facts, terminated=True, truncated=False, steps=steps,
                    extras={"shown_again": True})  # fmt: skip
    whole = Episode(**facts, terminated=True, truncated=False, steps=steps)
    Demonstrations((again, whole), Schema.anonymous(1, 2)).save(tmp_path / "demos")
    line = ["demos", "hurting", str(tmp_path / "demos"), "--undo"]
    assert run([*line, "--out", str(tmp_path / "out")]) == 2
    assert "takes no --out" in capsys.readouterr().err
    assert run(line) == 0
    taught = [one.taught.tolist() for one in Demonstrations.load(tmp_path / "demos").episodes]
    assert taught == [[-1, -1, 0, 1], [0, 1, 0, 1]]
