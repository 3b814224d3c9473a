"""``--help`` is one screen; ``--help-all`` has every option, each in one group."""

import click
import pytest

from eutree.cli._options import _SHARED, Helped
from eutree.cli.main import COMMANDS
from eutree.cli.main import eutree as group

SCREEN = 40  # lines, of 80 columns


def commands(of=group, *words):
    """Yield each command, and each command in a group, with the words that it is called by."""
    yield words, of
    if isinstance(of, click.Group):
        context = click.Context(of)
        for name in of.list_commands(context):
            yield from commands(of.get_command(context, name), *words, name)


EACH = {" ".join(words): command for words, command in commands()}
HELPED = [line for line, command in EACH.items() if isinstance(command, Helped)]


def test_all_commands_are_found():
    assert set(COMMANDS) < set(EACH)
    assert {"", "demos import", "study lead", "reproduce"} < set(EACH)
    assert {"learn", "show", "demo", "record", "demos import"} < set(HELPED)


@pytest.mark.parametrize("line", EACH)
def test_help_is_one_screen(eutree, line, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    answer = eutree(*line.split(), "--help")
    assert answer.code == 0
    assert len(answer.out.splitlines()) <= SCREEN
    assert f"Example: eutree {line}" in answer.out
    assert ("--help-all shows" in " ".join(answer.out.split())) == (line in HELPED)


@pytest.mark.parametrize("line", HELPED)
def test_all_options_are_shown_once(eutree, line):
    answer = eutree(*line.split(), "--help-all")
    assert answer.code == 0
    options = [one for one in EACH[line].params if isinstance(one, click.Option)]
    options_text = answer.out.partition("Example:")[0]
    lines = [words.split() for words in options_text.splitlines() if words.startswith("  -")]
    for option in options:
        flag = option.opts[-1]
        shown = [words for words in lines if flag == words[words[0] == "-h,"]]
        assert len(shown) == 1, flag


@pytest.mark.parametrize("line", HELPED)
def test_what_is_grouped_or_brief_exists(line):
    one = EACH[line]
    known = {parameter.name for parameter in one.params} | {"help", "strict"}
    own = {heading: names for heading, names in one._groups.items() if heading not in _SHARED}
    assert {name for names in own.values() for name in names} | set(one._brief) <= known
    grouped = [name for names in one._groups.values() for name in names]
    assert len(set(grouped)) == len(grouped)
    if own:
        options = {each.name for each in one.params if isinstance(each, click.Option)}
        assert options <= set(grouped), "every option of a grouped command is in a group"
