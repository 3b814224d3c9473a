"""A log has names of its own: those of a file, a policy or another log may be in another order."""

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from eutree.cli.main import run
from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree.interaction.making import make
from eutree.interaction.names import Names, named
from eutree.policies import TreePolicy

LEVELS = (0.4, 0.9, 1.2, 1.8)
PERMUTED = {"features": ["ready", "level [m]"], "actions": ["go", "stop"]}


def log_of(path, columns):
    """Write a log of four episodes: what is over 1 m goes; return its path."""
    lines = ["episode," + ",".join((*columns, "action"))]
    for episode in range(4):
        for level in (*LEVELS, 1.0):
            row = {"level": str(level), "ready": "0"}
            action = "go" if level > 1.0 else "stop"
            lines.append(",".join((str(episode), *(row[name] for name in columns), action)))
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def names_file(path, names):
    path.write_text(json.dumps(names))
    return str(path)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    log_of(tmp_path / "log.csv", ("level", "ready"))
    return tmp_path


def test_columns_and_actions_of_a_log_are_taken_by_their_names(folder):
    """They were taken by their places: what was shown as stop came out as go."""
    path = names_file(folder / "names.json", PERMUTED)
    assert run(["demos", "import", "log.csv", "--names", path, "--out", "demos"]) == 0
    read = Demonstrations.load(folder / "demos")
    assert read.schema.feature_names == ("ready", "level")
    assert [one.unit for one in read.schema.features] == ["", "m"]
    assert read.schema.actions == ("go", "stop")
    first = read.episodes[0]
    assert first.observations[:4].tolist() == [[0.0, level] for level in LEVELS]
    assert [read.schema.actions[k] for k in first.actions] == ["stop", "stop", "go", "go"]


def test_names_that_a_log_does_not_have_are_for_its_places(folder):
    other = {"features": ["height", "free"], "actions": ["halt", "run"]}
    path = names_file(folder / "names.json", other)
    assert run(["demos", "import", "log.csv", "--names", path, "--out", "demos"]) == 0
    read = Demonstrations.load(folder / "demos")
    assert read.schema.feature_names == ("height", "free")
    assert read.episodes[0].observations[:4, 0].tolist() == list(LEVELS)
    assert read.schema.actions == ("halt", "run")


def test_names_some_of_which_stand_elsewhere_are_refused(folder, capsys):
    path = names_file(folder / "names.json", {"features": ["ready", "height"]})
    assert run(["demos", "import", "log.csv", "--names", path, "--out", "demos"]) == 2
    assert "columns must have the names of the features, ready, height" in capsys.readouterr().err
    assert not (folder / "demos").exists()


def test_a_table_without_names_is_not_turned_around(folder, capsys):
    assert run(["demos", "import", "log.csv", "--out", "demos"]) == 0
    assert run(["demos", "export", "demos", "demos.npz"]) == 0
    stored = Demonstrations.from_npz("demos.npz")
    turned = [*reversed(stored.schema.feature_names)]
    path = names_file(folder / "names.json", {"features": turned})
    assert run(["demos", "import", "demos.npz", "--names", path, "--out", "again"]) == 2
    assert "names must be in the order of those in demos.npz" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "what"), [("flag", "from 0 to 1"), ("integer", ""), (["low", "high"], "from 0 to 1")]
)
def test_a_kind_that_a_value_contradicts_is_refused(folder, capsys, kind, what):
    """A level that was declared a flag gave a single leaf, and false proofs about it."""
    path = names_file(
        folder / "names.json", {"features": ["level", "ready"], "kinds": {"level": kind}}
    )
    assert run(["demos", "import", "log.csv", "--names", path, "--out", "demos"]) == 2
    said = capsys.readouterr().err
    assert f"to be a whole number {what}" in said
    assert "0.4 was recorded" in said
    assert run(["demos", "import", "log.csv", "--out", "demos"]) == 0
    assert run(["demos", "rename", "demos", path]) == 2
    path = names_file(folder / "good.json", {"kinds": {"ready": "flag"}})
    assert run(["demos", "rename", "demos", path]) == 0


def test_a_folder_without_episodes_is_named_too(folder):
    assert run(["demos", "import", "log.csv", "--out", "demos"]) == 0
    for episode in (folder / "demos").glob("episode-*"):
        episode.unlink()
    path = names_file(folder / "names.json", {"features": ["height", "free"]})
    assert run(["demos", "rename", "demos", path]) == 0


def test_a_log_in_another_order_is_not_asked_about_a_policy(folder, capsys):
    """A policy was cut to one leaf, which decided the same, it said, in all that was recorded."""
    log_of(folder / "other.csv", ("ready", "level"))
    for log, demos, actions in (("log", "demos", "stop,go"), ("other", "turned", "stop,go")):
        line = ["demos", "import", f"{log}.csv", "--out", demos, "--actions", actions]
        assert run(line) == 0
    assert run(["demos", "import", "log.csv", "--out", "swapped", "--actions", "go,stop"]) == 0
    assert run(["fit", "demos", "--out", "tree.json"]) == 0
    capsys.readouterr()
    for demos, listed in (
        ("turned", "level, ready, got ready, level"),
        ("swapped", "got go, stop"),
    ):
        assert run(["compress", "tree.json", "--demos", demos, "--out", "small.json"]) == 2
        assert listed in capsys.readouterr().err
    assert run(["compress", "tree.json", "--demos", "demos", "--out", "small.json"]) == 0
    tree = TreePolicy.load(folder / "small.json")
    assert tree.predict(np.array([[0.5, 0.0], [1.5, 0.0]]))[0].tolist() == [0, 1]


def test_actions_of_an_environment_keep_their_order():
    class Named(gymnasium.Env):
        observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float64)
        action_space = gymnasium.spaces.Discrete(2)
        action_names = ("stop", "go")

    gymnasium.register("tests/Named-v0", Named)
    try:
        with (
            named(Names(actions=("go", "stop"))),
            pytest.raises(InvalidArgumentError, match="names must be in the order of the envir"),
        ):
            make("tests/Named-v0")
    finally:
        del gymnasium.registry["tests/Named-v0"]


def test_actions_are_in_the_logs_order_whatever_order_names_or_environment_have(
    tmp_path, monkeypatch, capsys
):
    """A log's 0 was the first action of the file of names, and not of --actions."""
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("episode,action,x,y\n1,0,1,2\n1,1,2,3\n1,0,3,3\n1,,3,4\n")
    Path("names.json").write_text('{"actions": ["on", "off"]}')
    line = ["demos", "import", "log.csv", "--actions", "off,on", "--out"]
    for out, more in (("alone", []), ("named", ["--names", "names.json"])):
        assert run([*line, out, *more]) == 0
        found = Demonstrations.load(out)
        names = [found.schema.actions[k] for k in found.episodes[0].actions]
        assert names == ["off", "on", "off"]
    assert run([*line, "other", "--env", "MountainCar-v0"]) == 2
    assert "--actions must be" in capsys.readouterr().err
