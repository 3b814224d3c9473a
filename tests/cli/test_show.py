"""``eutree show`` in the terminal."""

import json
from dataclasses import replace
from pathlib import Path

import gymnasium
import pytest

import eutree
from eutree.cli.main import run
from eutree.schema import EnvironmentSpec, Schema
from tests.export.policies import EVASION, NASTY, chain, policy_of, tree


def test_tree_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grown = tree(1, 3).split(0, 0, 7.25).split(1, 1, -8.5)
    policy_of(grown, EVASION, statistics=True).save(tmp_path / "policy.json")
    assert run(["show", str(tmp_path / "policy.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "3 leaves, depth 2 for eutree/Evasion2-v0"
    assert lines[1] == "position <= 7.25 m ?"
    assert "yes" in lines[2]
    assert "opponent_1 <= -8.5 m ?" in lines[3]
    assert sum("% of visits" in line for line in lines) == 3


def test_json_is_one_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    policy = policy_of(tree(5, 3), EVASION)
    policy.save(tmp_path / "policy.json")
    assert run(["show", str(tmp_path / "policy.json"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["n_leaves"] == 5
    assert printed["rules"] == str(policy)


def test_names_cannot_speak_to_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    schema = Schema.anonymous(len(NASTY), 1)
    schema = Schema(schema.features, NASTY)
    policy_of(tree(40, len(NASTY)), schema).save(tmp_path / "policy.json")
    assert run(["show", str(tmp_path / "policy.json")]) == 0
    printed = capsys.readouterr().out
    assert all(sign == "\n" or sign.isprintable() for sign in printed)


def test_deep_trees_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    policy_of(chain(300, to_the_left=True)).save(tmp_path / "policy.json")
    assert run(["show", str(tmp_path / "policy.json")]) == 0
    assert len(capsys.readouterr().out.splitlines()) > 300


def test_page_plays_episodes_and_knows_the_demonstrations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pygame")
    pytest.importorskip("PIL")
    env = gymnasium.make("eutree/Evasion2-v0")
    demonstrations = eutree.record(env, eutree.experts.wait_at_crossing, episodes=2, seed=0)
    demonstrations.save(tmp_path / "demos")
    policy_of(tree(5, 3), EVASION).save(tmp_path / "policy.json")
    arguments = ["show", str(tmp_path / "policy.json"), "--html", str(tmp_path / "page.html")]
    options = ["--episodes", "2", "--demos", str(tmp_path / "demos"), "--json"]
    assert run([*arguments, *options]) == 0
    captured = capsys.readouterr()
    printed = json.loads(captured.out)
    assert captured.err == "playing 1/2\nplaying 2/2\n"
    assert printed["episodes"] == 2
    page = (tmp_path / "page.html").read_text()
    assert printed["bytes"] == len(page.encode())
    assert "data:image/webp;base64," in page


def test_page_without_an_environment_says_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    policy = policy_of(tree(5, 3), EVASION)
    for environment, message in (
        (None, "no episodes: spec must name an environment"),
        (EnvironmentSpec("Nowhere-v0"), "no episodes: unknown environment 'Nowhere-v0'"),
    ):
        replace(policy, environment=environment).save(tmp_path / "policy.json")
        html = tmp_path / "page.html"
        assert run(["show", str(tmp_path / "policy.json"), "--html", str(html)]) == 0
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.out == f"written to {html}\n"
        assert html.exists()
