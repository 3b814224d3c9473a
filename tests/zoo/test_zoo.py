"""The trees that come with the package: what their cards say is what they are."""

import json
import tomllib
from importlib import import_module
from pathlib import Path

import gymnasium
import pytest

import eutree
from eutree import zoo
from eutree.cli.learn import _teacher
from eutree.cli.main import run
from eutree.envs.experts import EXPERTS
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.interaction.making import make
from eutree.learners import method
from eutree.learners.registry import with_choices
from eutree.schema import EnvironmentSpec

CARDS = [pytest.param(one, id=one.name) for one in zoo.cards()]
SETTINGS = sorted((Path(zoo.__file__).parent / "settings").glob("*.toml"))


@pytest.mark.parametrize("card", CARDS)
def test_a_card_says_the_size_and_the_task_of_its_tree(card: zoo.Card) -> None:
    tree = zoo.load(card.name)
    assert tree.n_leaves == card.leaves <= card.most_leaves
    assert tree.environment is not None
    assert tree.environment.id == card.task


@pytest.mark.parametrize("card", CARDS)
def test_a_tree_earns_what_its_card_says(card: zoo.Card) -> None:
    """Thirty episodes: their mean lies within five standard errors of the card's.

    The spread is the larger of theirs and the card's: thirty may hold none of the rare disasters.
    """
    if "Lander" in card.task:
        pytest.importorskip("Box2D", reason="needs Box2D (extra envs)")
    if "Cologne" in card.task:
        pytest.importorskip("libsumo", reason="needs SUMO")
    if card.module:
        import_module(card.module)
    tree = zoo.load(card.name)
    assert tree.environment is not None
    found = eutree.evaluate(tree, make(tree.environment), episodes=30, seed=11_000_000)
    known = (card.interval[1] - card.interval[0]) / (2 * 1.96) * card.episodes**0.5
    spread = max(float(found.returns.std(ddof=1)), known)
    assert abs(found.mean_return - card.mean_return) <= 5 * spread / 30**0.5 + 1e-6


def test_a_larger_tree_of_a_task_earns_more() -> None:
    for task in zoo.tasks():
        known = [one for one in zoo.cards() if one.task == task]
        returns = [one.mean_return for one in known]
        assert returns == sorted(returns)
        assert [one.most_leaves for one in known] == sorted(one.most_leaves for one in known)


def test_a_task_alone_names_the_smallest_as_good_as_the_best() -> None:
    for task in zoo.tasks():
        known = [one for one in zoo.cards() if one.task == task]
        best = max(known, key=lambda one: one.mean_return)
        chosen = zoo.card(task)
        assert chosen.mean_return >= best.interval[0]
        assert not [
            one for one in known
            if one.leaves < chosen.leaves and one.mean_return >= best.interval[0]
        ]  # fmt: skip


def test_an_unknown_tree_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'MountainCar-v0'"):
        zoo.load("MountainCat-v0")
    with pytest.raises(InvalidArgumentError, match=r"number of leaves, at least .*, got '1'"):
        zoo.load("MountainCar-v0:1")
    with pytest.raises(InvalidArgumentError, match="got 'many'"):
        zoo.load("MountainCar-v0:many")
    with pytest.raises(UnknownNameError, match="task with settings"):
        zoo.settings_of("Unheard-v0")
    for name in (None, 3):
        with pytest.raises(InvalidArgumentError, match=f"tree of the zoo, got {name}"):
            zoo.load(name)  # type: ignore[arg-type]
        with pytest.raises(InvalidArgumentError, match=f"settings of the zoo, got {name}"):
            zoo.settings_of(name)  # type: ignore[arg-type]


def test_a_task_of_the_examples_names_the_module_that_registers_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for name in ("TwoTanks-v0", "Inventory-v0", "Cologne1-v0"):
        monkeypatch.delitem(gymnasium.registry, name, raising=False)
    tanks, stock = "--import examples.two_tanks", "--import examples.inventory"
    learn = ["learn", "--settings", "zoo:TwoTanks-v0", "--out", str(tmp_path / "run")]
    light = ["learn", "--settings", "zoo:Cologne1-v0", "--out", str(tmp_path / "light")]
    assert run(light) == 2
    assert "--import examples.traffic_light registers" in capsys.readouterr().err
    for line in (["evaluate", "zoo:TwoTanks-v0"], ["prove", "zoo:TwoTanks-v0"], learn):
        assert run(line) == 2
        assert f"in a clone of it, {tanks}" in capsys.readouterr().err
    assert run(["show", "zoo:Inventory-v0", "--html", str(tmp_path / "a.html")]) == 0
    assert stock in capsys.readouterr().err
    assert run(["evaluate", "zoo:Inventory-v0", "--import", "examples.of_no_clone"]) == 2
    assert "in a clone of the repository" in capsys.readouterr().err


def test_a_tree_of_the_zoo_is_no_environment(capsys: pytest.CaptureFixture[str]) -> None:
    record = ["record", "zoo:CartPole-v1:4", "--expert", "fall"]
    for line in (["learn", "zoo:CartPole-v1"], record):
        assert run([*line, "--out", "nowhere"]) == 2
        assert "is a tree of the zoo; its task is CartPole-v1" in capsys.readouterr().err


@pytest.mark.parametrize("path", SETTINGS, ids=lambda path: path.stem)
def test_settings_are_choices_of_a_method_and_a_run(path: Path) -> None:
    document = tomllib.loads(path.read_text())
    of_run = document.pop("run")
    assert with_choices(method(document.pop("method")), document) is not None
    assert of_run.keys() - {"arguments", "derived"} == {
        "task",
        "expert",
        "demonstrations",
        "race_share",
    }
    name = path.stem.replace("eutree-", "eutree/")
    task = name.removesuffix("-derived")
    assert of_run["task"] == task
    assert ("derived" in of_run) == (task != name or task == "Cologne1-v0")
    assert zoo.settings_of(name) == path
    assert ":" in of_run["expert"] or of_run["expert"] in EXPERTS[task]


def test_the_command_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["zoo"]) == 0
    printed = capsys.readouterr().out
    assert all(one.name in printed for one in zoo.cards())
    assert "eutree[envs]" not in printed
    assert run(["zoo", "LunarLander-v3"]) == 0
    assert "needs gymnasium[box2d]: pip install 'eutree[envs]'" in capsys.readouterr().out
    assert run(["zoo", "MountainCar-v1"]) == 2
    assert "MountainCar-v0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "sizes"),
    [("MountainCar-v0", [4, 8]), ("MountainCar-v0:4", [4]), ("CartPole-v1:9", [4])],
)
@pytest.mark.parametrize("prefix", ["", "zoo:"])
def test_the_command_lists_a_task_or_the_one_tree_that_is_named(
    name: str, sizes: list[int], prefix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["zoo", prefix + name, "--json"]) == 0
    trees = json.loads(capsys.readouterr().out)["trees"]
    assert [one["most_leaves"] for one in trees] == sizes


def test_a_name_of_the_zoo_stands_where_a_file_does(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    name = "zoo:MountainCar-v0"
    assert run(["show", name]) == 0
    assert "position" in capsys.readouterr().out
    assert run(["evaluate", name, "--episodes", "3", "--json"]) == 0
    assert run(["export", name, "--out", str(tmp_path / "car.c")]) == 0
    assert (tmp_path / "car.c").exists()
    assert run(["show", "zoo:Nowhere-v0"]) == 2
    assert "eutree zoo" in capsys.readouterr().err


def test_a_teacher_of_the_zoo_costs_the_steps_that_its_card_says() -> None:
    spec = EnvironmentSpec("CartPole-v1")
    teacher = _teacher("zoo:CartPole-v1", None, spec)
    assert teacher is not None
    assert teacher.cost == zoo.card("CartPole-v1").steps > 0


def test_a_tree_of_the_zoo_is_not_written_over(capsys: pytest.CaptureFixture[str]) -> None:
    before = zoo.path_of("CartPole-v1").read_bytes()
    assert run(["edit", "zoo:CartPole-v1", "--reseal"]) == 2
    assert "--out must name the file to write" in capsys.readouterr().err
    assert zoo.path_of("CartPole-v1").read_bytes() == before
