"""Every command's --help ends in an example, and the examples run as one session."""

import shlex
from pathlib import Path

import click
import pytest

from eutree.cli.main import eutree, run
from tests.contracts.documents import shortened
from tests.little_search import little_search

# Run elsewhere, or not by a test: why.
NOT_HERE = {
    "warm-up": "tests/cli/test_first_command.py runs it; it compiles for minutes",
    "demo": "tests/demo runs it; it takes a while",
    "reproduce": "tests/lab/paper runs the smoke settings; the figures take hours",
    "demos replay": "opens a window",
    "study lead": "needs a person; tests/lab/test_leading.py runs it",
    "study table": "needs what people did; tests/lab/test_study.py runs it",
    "demos merge": "needs folders that the session does not make",
    "demos rename": "needs a file of names, which a person writes",
    "demos import": "needs a data set that the session does not make",
}
# The example needs a person; the rest of the session needs what it would have recorded.
INSTEAD = {"record": "eutree record eutree/Evasion2-v0 --expert gate --out demos/"}


def commands(group: click.Group, prefix: str = "") -> dict[str, click.Command]:
    """Return all commands below ``group``, groups left out, by their words."""
    found = {}
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None, name
        if isinstance(command, click.Group):
            found |= commands(command, f"{prefix}{name} ")
        else:
            found[prefix + name] = command
    return found


def example(command: click.Command) -> str:
    """Return the example in the epilog of ``command``."""
    return (command.epilog or "").partition("Example: ")[2]


COMMANDS = commands(eutree)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_an_example_of_the_command(name: str) -> None:
    assert example(COMMANDS[name]).startswith(f"eutree {name}")


def test_examples_run_as_one_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    names = [name for name in COMMANDS if name not in NOT_HERE]
    assert names.index("record") == 0
    for name in names:
        line = INSTEAD.get(name) or example(COMMANDS[name])
        with little_search():
            code = run(shortened(shlex.split(line))[1:])
        output = capsys.readouterr()
        assert code == 0, f"$ {line}\n{output.out}{output.err}"


def test_exceptions_are_commands() -> None:
    assert NOT_HERE.keys() <= COMMANDS.keys()
