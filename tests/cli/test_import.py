"""``--import``: a module in the current folder registers the environment."""

import sys

import gymnasium
import pytest

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
