"""``--import``: a module in the current folder registers the environment."""

import sys

import gymnasium
import pytest

from eutree.policies import TreePolicy

MODULE = """
import gymnasium
from gymnasium.envs.classic_control import CartPoleEnv

gymnasium.register("Import-v0", CartPoleEnv, max_episode_steps=20)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "registers_import_v0.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p])
    yield tmp_path
    gymnasium.registry.pop("Import-v0", None)
    sys.modules.pop("registers_import_v0", None)


def test_an_environment_of_the_current_folder_is_learned_and_evaluated(eutree, folder):
    own = ("--import", "registers_import_v0")
    line = ("learn", "Import-v0", "--episodes", "2", "--evaluation-episodes", "2", "--out", "run")
    assert "unknown environment" in eutree(*line).err
    assert eutree(*line, *own).code == 0
    answer = eutree("evaluate", "run/policy.json", *own, "--episodes", "3", "--json")
    assert answer.json["environment"] == "Import-v0"


def test_a_module_that_cannot_be_found_is_named(eutree, folder):
    (folder / "broken.py").write_text("import no_such_simulator\n")
    answer = eutree("learn", "Import-v0", "--import", "broken", "--out", "run")
    assert (answer.code, "no_such_simulator" in answer.err) == (2, True)
    answer = eutree("learn", "broken:Import-v0", "--out", "run")
    assert (answer.code, "no_such_simulator" in answer.err) == (2, True)


def test_the_next_commands_of_the_page_import_it_too(eutree, folder, monkeypatch):
    """They were refused: the environment was unknown."""
    pages = []
    monkeypatch.setattr("eutree.recording.browser.record_in_browser", lambda recorder, **given: (
        pages.append(given)
    ))  # fmt: skip
    (folder / "leans.py").write_text(
        "def leans(observation):\n    return int(observation[2] > 0)\n"
    )
    own = ("--import", "registers_import_v0.py")
    line = ("record", "Import-v0", "--expert", "leans.py:leans", "--out", "shown")
    assert eutree(*line, *own).code == 0
    assert eutree("fit", "shown", *own, "--episodes", "0", "--out", "tree.json").code == 0
    for words, out in (((), "shown"), (own, "here")):
        assert eutree("record", "Import-v0", "--out", out, *words).code == 0
    without, given = pages
    assert without["details"]["commands"][1] == "eutree fit shown --out expert.json"
    fitting = "eutree fit here --out expert.json --import registers_import_v0"
    assert given["details"]["commands"][1] == fitting
    tree = TreePolicy.load("tree.json")
    lines = given["maker"]._commands(folder / "tree.json", tree)
    assert [line.split()[1] for line in lines if "--import" in line] == ["evaluate", "learn"]
    (evaluate,) = (line for line in lines if line.startswith("eutree evaluate"))
    assert eutree(*evaluate.replace("1000", "3").split()[1:], "--json").code == 0
    assert "--import" not in " ".join(without["maker"]._commands(folder / "tree.json", tree))
