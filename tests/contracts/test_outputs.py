"""No command writes what it reads: every output of every command beside every input."""

import shutil
from pathlib import Path

import click
import numpy as np
import pytest

from eutree.cli._options import PARTS, Written, check_outputs
from eutree.cli.main import COMMANDS, eutree, run
from eutree.data import Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from tests.little_search import little_search


def commands(group, path=()):
    """Yield the words and the command of each command."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            yield from commands(command, (*path, name))
        else:
            yield (*path, name), command


ALL = list(commands(eutree))


def pairs(reads):
    """Return each output of each command with each parameter that reads, by name and words."""
    return [
        pytest.param(words, command, output, source, id=f"{words[-1]}: {output.name} {source.name}")
        for words, command in ALL
        for output in command.params
        if isinstance(output.type, Written)
        for source in command.params
        if reads(words, source)
    ]


PAIRS = pairs(
    lambda _, source: isinstance(source.type, click.Path) and not isinstance(source.type, Written)
)

# Parameters that take a name, and how each names the file tank.py
MODULE, IN_FILE, IN_MODULE = (
    ("tank",),
    ("tank.py:rule", "./demos/../tank.py:Tank.rule"),
    ("tank:Own",),
)
NAMES_OF_CODE = {
    "import": MODULE,
    "environment": IN_MODULE,
    "method": IN_MODULE,
    **dict.fromkeys(("expert", "teacher", "against"), (*IN_FILE, *IN_MODULE)),
}  # fmt: skip
NAMED = pairs(
    lambda words, source: (
        source.name in NAMES_OF_CODE
        and not isinstance(source.type, click.Choice)
        and (source.name, words) not in {("expert", ("learn",)), ("method", ("distill",))}
    )
)


def line(words, command, given):
    """Return a command line with these values, and some text for every other argument."""
    options, arguments = [], []
    for parameter in command.params:
        value = given.get(parameter.name)
        if isinstance(parameter, click.Argument):
            arguments.append(value or "eutree/Evasion2-v0")
        elif value is not None:
            options += [parameter.opts[-1], value]
    return [*words, *options, "--", *arguments]


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Return a folder with a policy file, demonstrations and what stands for a run."""
    schema = Schema.anonymous(1, 2)
    policy = TreePolicy(DecisionTree.single_leaf(1), np.array([1]), schema)
    policy.save(tmp_path / "p.json")
    episode = Episode(np.zeros((3, 1)), [0, 1], [0.0, 1.0], True, False)
    spec = EnvironmentSpec("eutree/Evasion2-v0")
    Demonstrations((episode,), schema, spec).save(tmp_path / "demos")
    (tmp_path / "tank.py").write_text("raise ValueError('this is read before it is compared')\n")
    (tmp_path / "run" / "runs" / "0").mkdir(parents=True)
    shutil.copy(tmp_path / "p.json", tmp_path / "run" / "runs" / "0" / "policy.json")
    shutil.copy(tmp_path / "p.json", tmp_path / "run" / "policy.json")
    monkeypatch.chdir(tmp_path)
    return tmp_path


SAME = (
    ("p.json", "p.json"),
    ("./demos/../p.json", "p.json"),
    ("link.json", "p.json"),
    ("demos", "demos"),
    ("demos/demonstrations.json", "demos"),
    ("run/policy.json", "run"),
    ("run", "run/policy.json"),
    ("run/runs/0/policy.json", "run"),
    ("soft.json", "p.json"),
    ("inside.json", "run"),
    ("run", "inside.json"),
)


@pytest.mark.parametrize(("words", "command", "output", "source"), PAIRS)
def test_an_output_is_no_input(words, command, output, source, place, capsys):
    (place / "link.json").hardlink_to(place / "p.json")
    (place / "soft.json").symlink_to(place / "p.json")
    shutil.copy(place / "p.json", place / "inside.json")
    (place / "run" / "config.json").symlink_to(place / "inside.json")
    before = contents(place)
    for written, read in SAME:
        if output.name == "front" and written.startswith("run"):
            continue  # it writes other files to a folder
        assert run(line(words, command, {output.name: written, source.name: read})) == 2
        assert "which it would overwrite" in capsys.readouterr().err
    assert contents(place) == before


@pytest.mark.parametrize(("words", "command", "output", "source"), NAMED)
def test_an_output_is_no_code_that_is_named(words, command, output, source, place, capsys):
    (place / "link.py").hardlink_to(place / "tank.py")
    (place / "soft").symlink_to(place / "tank.py")
    before = contents(place)
    for name in NAMES_OF_CODE[source.name]:
        for written in ("tank.py", str(place / "tank.py"), "run/../tank.py", "link.py", "soft"):
            assert run(line(words, command, {output.name: written, source.name: name})) == 2
            assert "tank.py, which it would overwrite" in capsys.readouterr().err
    assert contents(place) == before


def test_an_output_is_no_package_nor_file_of_features(place, monkeypatch, capsys):
    Path("plants/hot").mkdir(parents=True)
    Path("plants/hot/__init__.py").write_text("1\n")
    Path("derived.txt").write_text("twice = x0 * 2\n")
    fit = ("fit", "demos", "--episodes", "0", "--out")
    for written, *given in (
        ("plants/hot/__init__.py", "--import", "plants.hot"),
        ("derived.txt", "--derive", "./derived.txt"),
    ):
        before = Path(written).read_bytes()
        assert run([*fit, written, *given]) == 2
        assert "which it would overwrite" in capsys.readouterr().err
        assert Path(written).read_bytes() == before
    monkeypatch.syspath_prepend(str(place / "plants"))
    assert run([*fit, "plants/hot/__init__.py", "--import", "hot"]) == 2
    assert "--out must be another place than --import" in capsys.readouterr().err


def test_trees_of_a_front_overwrite_no_tree_that_is_read(place, capsys):
    command = {words[-1]: command for words, command in ALL}["compress"]
    Path("front").mkdir()
    shutil.copy("p.json", "front/8.json")
    with pytest.raises(InvalidArgumentError, match="--front must be another place than SOURCE"):
        check_outputs(command, {"source": "front/8.json", "front": "front"})
    check_outputs(command, {"source": "p.json", "front": "front", "out": "front/small.json"})


def test_a_name_is_no_file_where_it_names_something_else(place):
    """The folder `tank` may hold the demonstrations made with the module `tank`."""
    command = {words[-1]: command for words, command in ALL}["record"]
    Path("tank").mkdir()
    check_outputs(command, {"environment": "Tank-v0", "import": "tank", "out": "tank"})
    check_outputs(command, {"environment": "tank:Tank-v0", "expert": "gate", "out": "tank"})


def test_there_are_pairs_and_what_writes_says_so():
    assert len(PAIRS) >= 15
    assert {words[0] for words, *_ in (pair.values for pair in PAIRS)} < {
        *COMMANDS,
        "reproduce",
        "study",
    }
    assert len(NAMED) >= 20
    names = {"out", "html", "run_html", "tensorboard", "target", "front"}
    for words, command in ALL:
        for parameter in command.params:
            is_output = isinstance(parameter.type, Written)
            assert is_output == (parameter.name in names), (words, parameter.name)


@pytest.mark.parametrize("written", ["page.html", "demos/page.html", "run/small.json"])
def test_another_place_is_no_fault(written, place, capsys):
    for _ in range(2):  # a page is written again where it was
        source = "run" if written.startswith("run") else "p.json"
        assert run(["show", source, "--html", written, "--episodes", "0"]) == 0
    assert Path(written).exists()


@little_search()
def test_the_parts_are_those_of_a_run_and_of_demonstrations(place, capsys):
    ask = ("--episodes", "2", "--evaluate-every", "1", "--evaluation-episodes", "2", "--runs", "2",
           "--n-jobs", "1")  # fmt: skip
    assert (
        run(["record", "CartPole-v1", "--expert", "fall", "--episodes", "2", "--out", "shown"]) == 0
    )
    assert run(["learn", "--demos", "shown", "--out", "runs", *ask]) == 0
    for folder in ("shown", "runs", "runs/runs/0"):
        names = {path.name for path in Path(folder).iterdir() if path.is_file()}
        assert names
        assert all(PARTS.fullmatch(name) or name == ".lock" for name in names)


LEARN = ("learn", "CartPole-v1", "--episodes", "1")
RECORD = ("record", "CartPole-v1", "--web", "--out")


@pytest.mark.parametrize(
    ("wanted", "held"),
    [
        ((*LEARN, "--out", "demos"), "demonstrations"),
        ((*LEARN, "--runs", "2", "--out", "demos"), "demonstrations"),
        (("reproduce", "table-2", "--smoke", "--out", "demos"), "demonstrations"),
        ((*RECORD, "run"), "a run"),
    ],
)
def test_a_folder_holds_one_kind_of_thing(wanted, held, place, capsys):
    (place / "run" / "config.json").write_text("{}")
    before = contents(place)
    assert run(list(wanted)) == 2
    assert f"it holds {held}; choose another folder" in capsys.readouterr().err
    assert contents(place) == before


def test_demonstrations_with_a_policy_are_no_run(place, capsys):
    shutil.copy("p.json", "demos/policy.json")
    assert run(["show", "demos"]) == 2
    assert "must be a policy file, or a run folder" in capsys.readouterr().err
