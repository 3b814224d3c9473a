"""``--help`` is one screen; ``--help-all`` has every option, each in one group."""

import click
import pytest

from eutree.cli.main import eutree as group

SCREEN = 40  # lines, of 80 columns
COMMANDS = ("learn", "compress", "record", "evaluate", "fit", "distill", "prove", "edit")


def command(name):
    return group.get_command(click.Context(group), name)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_one_screen(eutree, name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    answer = eutree(name, "--help")
    assert answer.code == 0
    assert len(answer.out.splitlines()) <= SCREEN
    assert "--help-all shows" in " ".join(answer.out.split())
    assert f"Example: eutree {name}" in answer.out


@pytest.mark.parametrize("name", COMMANDS)
def test_all_options_are_shown_once(eutree, name):
    answer = eutree(name, "--help-all")
    assert answer.code == 0
    options = [one for one in command(name).params if isinstance(one, click.Option)]
    options_text = answer.out.partition("Example:")[0]
    lines = [line.split() for line in options_text.splitlines() if line.startswith("  -")]
    for option in options:
        flag = option.opts[-1]
        shown = [words for words in lines if flag == words[words[0] == "-h,"]]
        assert len(shown) == 1, flag


@pytest.mark.parametrize("name", ["learn", "compress"])
def test_what_is_grouped_or_brief_exists(name):
    one = command(name)
    known = {parameter.name for parameter in one.params} | {"help", "strict"}
    grouped = [name for names in one._groups.values() for name in names]
    assert set(grouped) | set(one._brief) <= known
    assert len(set(grouped)) == len(grouped)
    apart = {parameter.name for parameter in one.params if isinstance(parameter, click.Option)}
    assert apart <= set(grouped), "every option of a grouped command is in a group"
