"""``eutree prove``: one JSON object, exit codes, a page; mistakes are one line."""

import json

import pytest

from eutree.cli.main import run
from eutree.envs import PLANTS
from eutree.proof import Plant
from tests.little_proof import little_proof
from tests.proof.policies import BAD, GOOD, policy_of


@pytest.fixture(autouse=True)
def coarse():
    with little_proof():
        yield


@pytest.fixture
def car(tmp_path):
    path = tmp_path / "car.json"
    policy_of(GOOD).save(path)
    return path


def result(capsys, *arguments):
    code = run(["prove", *map(str, arguments), "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_proven_refuted_and_undecided_have_their_codes(car, tmp_path, capsys):
    code, found = result(capsys, car)
    assert (code, found["proven"], found["kind"]) == (0, True, "proof")
    assert found["bounds"]["steps"] == [83, 108]
    assert found["undecided"] == 0
    assert found["worst_start"]["steps"] == 108
    assert found["counterexample"] is None
    bad = tmp_path / "bad.json"
    policy_of(BAD).save(bad)
    code, found = result(capsys, bad, "arrives")
    assert (code, found["proven"]) == (1, False)
    assert -0.6 <= found["counterexample"]["position"] <= -0.4
    question = "returns at least -98 with probability at least 0.5"
    code, found = result(capsys, car, question, "--sampled", "--episodes", 20)
    assert (code, found["kind"]) == (3, "statistical")


def test_a_page_shows_the_starts(car, tmp_path, capsys):
    page = tmp_path / "proof.html"
    code, found = result(capsys, car, "--html", page)
    assert code == 0
    text = page.read_text()
    assert found["path"] == str(page)
    assert found["files"] == [str(page)]
    assert text.count("<rect") == 320
    assert "arrives within 108 steps" in text
    assert "http" not in text.replace("http-equiv", "")


def test_each_file_that_is_written_is_named(car, tmp_path, capsys):
    """With both only the page was."""
    page, kept = tmp_path / "proof.html", tmp_path / "proof.json"
    _, found = result(capsys, car, "--html", page, "--out", kept)
    assert found["path"] == str(page)
    assert found["files"] == [str(page), str(kept)]
    assert page.exists()
    assert kept.exists()
    assert result(capsys, car, "--out", kept)[1]["path"] == str(kept)
    assert "files" not in result(capsys, car)[1]


def test_an_environment_without_a_plant_gets_a_statistical_certificate(tmp_path, capsys):
    path = tmp_path / "lander.json"
    policy_of((0, 0.0, 0, 1), "Acrobot-v1").save(path)
    code, found = result(capsys, path, "--episodes", 5)
    assert (code, found["kind"]) == (0, "statistical")
    assert found["work"] == {"episodes": 5}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["flies"], "property must be"),
        (["stays in speed <= 1"], "unknown feature 'speed'"),
        (["stays in upper_level < 2 and lower_level < 2 for ever"], "feature 'upper_level'"),
        (["succeeds with probability at least 0.9"], "is about chance, and nothing in the plant"),
        (["stays in position <= 0.6 for ever"], "has no grid, which a property for ever needs"),
        (["--env", "CartPole-v1"], "must have the features and actions of CartPole-v1"),
        (["--sampled", "--confidence", "2"], "confidence must be"),
        (["--sampled", "returns at least 1"], "--range LOW HIGH"),
        (["--sampled", "arrives"], "needs a plant"),
    ],
)
def test_mistakes_are_one_line(car, capsys, monkeypatch, arguments, message):
    monkeypatch.setattr("eutree.cli.measuring.evaluate_policy", None)  # nothing is played before
    assert run(["prove", str(car), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_the_page_never_overwrites_the_policy(car, capsys):
    before = car.read_bytes()
    assert run(["prove", str(car), "--html", str(car)]) == 2
    assert "must be another place than POLICY" in capsys.readouterr().err
    assert car.read_bytes() == before


def test_with_sampled_it_is_not_said_that_no_plant_is_known(car, tmp_path, capsys):
    """Of a plant that a module had registered, too: "none is known for MountainCar-v0"."""
    assert run(["prove", str(car), "arrives", "--sampled"]) == 2
    error = capsys.readouterr().err
    assert "episodes of MountainCar-v0, asked with --sampled or where none is known," in error
    assert "none is known for" not in error
    path = tmp_path / "swing.json"
    policy_of((0, 0.0, 0, 1), "Acrobot-v1").save(path)
    assert run(["prove", str(path), "arrives"]) == 2
    assert "needs a plant" in capsys.readouterr().err


class Still(Plant):
    """A plant that does not say how boxes move."""

    state = ("x0", "x1", "x2", "x3", "x4", "x5")
    start = ((0.0, 0.0),) * 6
    limit = 5

    def __init__(self, spec):
        self.environment = spec


def test_a_plant_without_a_step_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(PLANTS, "Acrobot-v1", Still)
    path = tmp_path / "lander.json"
    policy_of((0, 0.0, 0, 1), "Acrobot-v1").save(path)
    assert run(["prove", str(path)]) == 2
    error = capsys.readouterr().err
    assert "plant must have a step that moves boxes, got Still without one" in error
    assert error.count("\n") == 1


def test_what_a_plant_cannot_answer_is_said_at_once_or_played(car, tmp_path, capsys):
    pole = tmp_path / "pole.json"
    assert run(["export", "zoo:CartPole-v1", "--out", str(pole)]) == 0
    capsys.readouterr()
    assert run(["prove", str(pole), "arrives"]) == 2
    assert "a task with a goal, which CartPole-v1 has not" in capsys.readouterr().err
    asked = "returns at least -199 with probability at least 0.1"
    code, found = result(capsys, car, asked, "--episodes", 40)
    assert (code, found["kind"]) == (0, "statistical")
    assert found["work"] == {"episodes": 40}


def test_what_a_proof_had_no_use_for_is_said(car, capsys):
    assert run(["prove", str(car), "--episodes", "50", "--seed", "3"]) == 0
    said = capsys.readouterr().err
    assert "no episode was drawn, so --episodes, --seed changed nothing" in said
    assert run(["prove", str(car)]) == 0
    assert "changed nothing" not in capsys.readouterr().err


def test_a_refutation_shows_its_start(tmp_path, capsys):
    bad = tmp_path / "bad.json"
    policy_of(BAD).save(bad)
    assert run(["prove", str(bad)]) == 1
    assert "; for example from position " in capsys.readouterr().out


def test_two_outputs_never_overwrite_each_other(car, tmp_path, capsys):
    both = tmp_path / "both"
    assert run(["prove", str(car), "--html", str(both), "--out", str(both)]) == 2
    assert "--out must be another place than --html" in capsys.readouterr().err
    assert not both.exists()
    (tmp_path / "front").mkdir()
    inside = tmp_path / "front" / "start.json"
    line = ["compress", str(car), "--out", str(inside), "--front", str(tmp_path / "front")]
    assert run(line) == 2
    assert "must be another place" in capsys.readouterr().err
    source = tmp_path / "m_test.c"
    line = ["export", str(car), "--format", "c", "--out", str(source), "--name", "m"]
    assert run([*line, "--self-test"]) == 2
    assert not source.exists()
