"""Choices of a method within reach: by name, from a file, and listed."""

import json
import re
from pathlib import Path

import pytest

from eutree import zoo
from eutree.cli._given import RunSettings
from eutree.cli.main import run
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.learners import PRESETS
from eutree.learners.registry import METHODS, choices_of, with_choices
from eutree.policies import TreePolicy

SHORT = ("--episodes", "2", "--evaluation-episodes", "1")


@pytest.mark.parametrize("name", METHODS)
def test_every_choice_of_every_method_says_what_it_is_for(name):
    known = choices_of(METHODS[name]())
    assert known
    assert [choice.name for choice in known if not choice.text] == []


@pytest.mark.parametrize("name", PRESETS)
def test_choices_written_again_change_nothing(name):
    preset = PRESETS[name]
    same = {choice.name: choice.value for choice in choices_of(preset)}
    assert with_choices(preset, same) == preset


def test_the_last_name_is_enough_where_it_is_the_only_one():
    changed = with_choices(PRESETS["default"], {"price": 0.004})
    assert changed.planner.improvement.price == 0.004
    nested = with_choices(PRESETS["default"], {"planner": {"improvement": {"price": 0.004}}})
    assert nested == changed


def test_what_is_no_choice_is_named():
    with pytest.raises(UnknownNameError, match="prize"):
        with_choices(PRESETS["default"], {"prize": 1})
    with pytest.raises(InvalidArgumentError, match="price"):
        with_choices(PRESETS["default"], {"price": "much"})


def learned(tmp_path, name, *options):
    folder = tmp_path / name
    arguments = ("learn", "eutree/Evasion2-v0", *SHORT, "--out", str(folder), *map(str, options))
    assert run(arguments) == 0
    return json.loads((folder / "config.json").read_text())["method"]


def test_set_settings_and_a_run_s_configuration_say_the_same(tmp_path):
    by_set = learned(tmp_path, "set", "--set", "price=0.004", "--discount", 0.9)
    assert by_set["planner"]["improvement"]["price"] == 0.004
    assert by_set["planner"]["discount"] == 0.9
    file = tmp_path / "mine.toml"
    file.write_text('method = "planning"\n[planner]\ndiscount = 0.9\nimprovement.price = 0.004\n')
    assert learned(tmp_path, "toml", "--settings", file) == by_set
    config = tmp_path / "set" / "config.json"
    assert learned(tmp_path, "config", "--settings", config) == by_set
    assert learned(tmp_path, "over", "--settings", config, "--set", "price=0.1") != by_set


def line_of_run(tmp_path, environment, expert, entry):
    """Return a short `learn` whose settings have an entry of `[run]`."""
    file = tmp_path / "run.toml"
    lines = ('method = "planning"', "[run]", f'expert = "{expert}"', "demonstrations = 2", entry)
    file.write_text("\n".join(lines))
    return ["learn", environment, "--settings", str(file), *SHORT, "--front-steps", "0"]


def test_settings_may_say_how_an_environment_is_made(tmp_path):
    """`--settings zoo:Pendulum-v1`, whose actions have to be laid on a grid, was refused."""
    grid = 'arguments = { action_grid = { "torque [N m]" = [-2.0, 0.0, 2.0] } }'
    line = line_of_run(tmp_path, "Pendulum-v1", "swing", grid)
    assert run([*line, "--out", str(tmp_path / "a")]) == 0
    assert len(TreePolicy.load(tmp_path / "a" / "policy.json").schema.actions) == 3
    own = ["--action-grid", "torque [N m]=-2:2:5", "--out", str(tmp_path / "b")]
    assert run([*line, *own]) == 0
    assert len(TreePolicy.load(tmp_path / "b" / "policy.json").schema.actions) == 5


def test_settings_may_declare_derived_features(tmp_path):
    line = line_of_run(
        tmp_path, "MountainCar-v0", "rock", 'derived = ["lean = position + velocity"]'
    )
    for more, names in (([], ["lean"]), (["--derive", "own = position * velocity"], ["own"])):
        assert run([*line, *more, "--out", str(tmp_path / names[0])]) == 0
        schema = TreePolicy.load(tmp_path / names[0] / "policy.json").schema
        assert [one.name for one in schema.derived] == names


@pytest.mark.parametrize("path", sorted((Path(zoo.__file__).parent / "settings").glob("*.toml")))
def test_settings_of_the_zoo_are_read(path):
    assert RunSettings.of(path).demonstrations > 0


def test_settings_say_which_task_they_are_of(tmp_path, capsys):
    out = ("--out", str(tmp_path / "run"))
    for name in ("CartPole-v1", "Pendulum-v1"):
        assert run(["learn", "MountainCar-v0", "--settings", f"zoo:{name}", *out]) == 2
        assert f"the settings are of {name}, not of MountainCar-v0" in capsys.readouterr().err
    assert run(["learn", "--settings", "MountainCar-v0", *out]) == 2
    assert "those of the zoo are --settings zoo:MountainCar-v0" in capsys.readouterr().err


def test_settings_of_the_zoo_name_their_task_and_what_a_run_takes(tmp_path, capsys):
    out = ("--out", str(tmp_path / "run"), "--max-leaves", "4", "--judge-episodes", "0")
    line = ["learn", "--settings", "zoo:eutree/Evasion2-v0", *out]
    assert run([*line, "--steps", "50", "--evaluation-episodes", "1"]) == 0
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    assert config["environment"].startswith("eutree/Evasion2-v0")
    words, err = capsys.readouterr()
    assert "race_steps is 20 of the 50 steps, by the race_share of the settings" in err
    assert re.search(r"; \d+ steps counted, \d+ of them in demonstrations;", words)


def test_the_list_says_what_to_turn_first(capsys):
    assert run(["learn", "--list-settings", "--method", "u-tree", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["settings"]["significance.alpha"] == 0.01
    assert set(found["first"]) <= set(found["settings"])
    assert run(["learn", "--list-settings"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("* planner.improvement.price = ")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--set", "price"), "--set must be KEY=VALUE"),
        (
            ("--set", "prise=3"),
            "unknown choice of method 'planning' 'prise'. Did you mean 'price'? All: eutree learn",
        ),
        (("--set", "price=abc"), "price must be a number, got 'abc'\n"),  # and no path of Python
        (("--set", "n_episodes=1.5"), "n_episodes must be a whole number, got 1.5\n"),
        (("--settings", "none.toml"), "none.toml"),
        (("--discount", "2"), "discount"),
        (("--list-settings", "--method", "planing"), "Did you mean 'planning'"),
        ((), "--out"),
    ],
)
def test_mistakes_are_named(options, message, capsys):
    assert run(["learn", "eutree/Evasion2-v0", *options]) == 2
    assert message in capsys.readouterr().err
