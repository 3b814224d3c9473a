"""What the lab adds is found by its names, by the command line as by Python."""

import pytest

import eutree
from eutree.cli.main import run
from eutree.learners import METHODS
from eutree_lab.tasks.experts import EXPERTS
from eutree_lab.tasks.registration import TASKS


@pytest.mark.parametrize("name", EXPERTS)
def test_a_demonstrator_is_found_on_the_command_line(name, tmp_path, capsys):
    expert = next(iter(EXPERTS[name]))
    line = ["record", name, "--expert", expert, "--episodes", "1", "--out", str(tmp_path / "d")]
    assert run(line) == 0, capsys.readouterr().err
    assert len(eutree.Demonstrations.load(tmp_path / "d")) == 1


def test_every_task_with_a_demonstrator_is_one():
    assert EXPERTS.keys() <= TASKS.keys()


def test_the_methods_are_listed_behind_those_of_the_core():
    of_the_lab = ["adaptive-q", "density-tree", "history-u-tree", "parti-game", "vqql", "vrd"]
    names = list(METHODS)
    assert names[:3] == ["planning", "u-tree", "distilled-dqn"]
    assert [name for name in names if name in of_the_lab] == of_the_lab


def test_reproduce_is_listed_among_the_commands(capsys):
    assert run(["--help"]) == 0
    assert "Reproduce the paper's figures and tables." in capsys.readouterr().out
