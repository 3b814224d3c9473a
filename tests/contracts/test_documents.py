"""README and documentation are run: a page cannot show what does not work."""

import ast
import importlib
import re
import sys
from contextlib import contextmanager, nullcontext
from pathlib import Path
from unittest import mock

import gymnasium
import joblib
import pytest
from joblib.externals.loky import get_reusable_executor

import eutree  # registers its environments before a page registers its own
from eutree.envs import PLANTS
from tests.contracts.documents import (
    ENOUGH,
    ROOT,
    Block,
    blocks,
    pages,
    rewrite,
    run_block,
    run_command,
    shortened,
)
from tests.little_proof import little_proof
from tests.little_search import little_search

# Why a block may not run; any other reason is refused. Anything else in python or console runs.
REASONS = {
    "waits for a person",
    "needs what a person recorded",
    "needs other machines",
    "needs what is not installed here",
    "starts a server",
    "installs",
    "takes minutes",
}
# Pages on which work is divided among processes; it ends in the same bytes without them.
ABOUT_PROCESSES = {"learning.md", "many-machines.md"}
# Languages of blocks that are shown, not run. A shell block is `console`, so that it runs.
SHOWN = {"text", "c", "json", "toml"}


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return an empty folder to run a page in; what it imports and registers is forgotten."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    with mock.patch.dict(gymnasium.registry), mock.patch.dict(PLANTS):
        yield tmp_path
    for module in [m for m, v in sys.modules.items() if _lies_in(v, tmp_path)]:
        del sys.modules[module]


def _lies_in(module: object, folder: Path) -> bool:
    return str(getattr(module, "__file__", None) or "").startswith(f"{folder}/")


@pytest.fixture
def processes(request, folder):
    """Let a page start processes if it is about them; it costs others more than what they show."""
    if request.node.callspec.params["page"].name in ABOUT_PROCESSES:
        get_reusable_executor().shutdown(wait=True)  # its workers look for modules elsewhere
        yield
        get_reusable_executor().shutdown(wait=True)
    else:
        with joblib.parallel_config(backend="sequential"):
            yield


def at_most(**most):
    """Let what learns take no option that is larger than these."""

    def less(function):
        return lambda *given, **options: function(
            *given, **{k: min(v, most[k]) if k in most else v for k, v in options.items()}
        )

    learning = {name: less(getattr(eutree, name)) for name in ("learn", "learn_runs")}
    return mock.patch.multiple(eutree, **learning)


@contextmanager
def less_work():
    """Search little and learn twice where the best of more runs is taken."""
    with little_search(), at_most(runs=2):
        yield


@contextmanager
def shorter():
    """Learn few episodes, search little and prove on coarse cells; ``shortened`` for Python."""
    coarse = {"_CELLS": 330, "_SPACING": 0.6, "_BEST_CELLS": 110, "_BEST_SPACING": 1.5}
    cells = mock.patch.multiple("eutree_lab.plants.evasion", **coarse)
    few = at_most(runs=2, episodes=ENOUGH["learn"])
    with little_search(), little_proof(), cells, few:
        yield


@pytest.mark.usefixtures("processes")
@pytest.mark.parametrize("page", pages(), ids=name)
def test_blocks_run(page: Path, folder: Path) -> None:
    namespace, printed = {"__name__": "__main__"}, ""
    found = blocks(page)
    exact = max((k for k, block in enumerate(found) if block.mark == "output"), default=-1)
    for k, block in enumerate(found):
        quickly = k > exact
        with nullcontext() if not quickly else less_work() if exact >= 0 else shorter():
            shown = run_block(
                block, namespace, page=page, folder=folder, printed=printed, quickly=quickly
            )
        if block.language in ("python", "console"):
            printed = shown


@pytest.mark.parametrize("page", pages(), ids=name)
def test_what_is_not_run_has_one_of_few_reasons(page: Path) -> None:
    found = blocks(page)
    assert {block.value for block in found if block.mark == "no-run"} <= REASONS
    languages = {block.language for block in found if not block.language.startswith("{")}
    assert languages <= SHOWN | {"python", "console"}


def test_few_blocks_are_not_run() -> None:
    marks = [block.mark for page in pages() for block in blocks(page)]
    assert marks.count("no-run") <= 16


def test_a_wrong_block_fails(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```python\nx = 1\n```\n\n```python\nassert x == 2\n```\n")
    first, second = blocks(page)
    namespace: dict[str, object] = {}
    run_block(first, namespace, page=page, folder=tmp_path)
    with pytest.raises(AssertionError):
        run_block(second, namespace, page=page, folder=tmp_path)


@pytest.mark.parametrize("end", ["", " | cat"])
def test_a_wrong_command_fails(tmp_path: Path, end: str) -> None:
    with pytest.raises(AssertionError, match="unknown command"):
        run_command(f"eutree no-such-command{end}", tmp_path)


@pytest.mark.parametrize(
    ("line", "played"),
    [
        ("eutree fit demos", "eutree fit demos --episodes 20"),
        ("eutree evaluate p --episodes 1000 --json", "eutree evaluate p --episodes 50 --json"),
        ("eutree", "eutree"),
        ("eutree learn Tank-v0 --episodes 5", "eutree learn Tank-v0 --episodes 5"),
        ("eutree learn --list-settings", "eutree learn --list-settings"),
        ("eutree compress r --episodes 200", "eutree compress r --episodes 50"),
        (
            "eutree learn --episodes 5 --race-steps 5000",
            "eutree learn --episodes 5 --race-steps 2000",
        ),
    ],
)
def test_a_line_is_shortened_in_its_episodes_and_races_alone(line: str, played: str) -> None:
    assert shortened(line.split()) == played.split()


def test_a_wrong_output_fails_and_can_be_written_anew(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(1)\n```\n\n<!-- output -->\n```text\n2\n```\n")
    first, second = blocks(page)
    printed = run_block(first, {}, page=page, folder=tmp_path)
    with pytest.raises(AssertionError):
        run_block(second, {}, page=page, folder=tmp_path, printed=printed)
    rewrite(page, tmp_path)
    assert blocks(page)[1].code == "1\n"


@pytest.mark.parametrize("page", pages(), ids=name)
def test_a_file_that_a_page_writes_imports_what_is_there(page: Path) -> None:
    for block in blocks(page):
        if block.mark == "file" and block.value.endswith(".py"):
            for line in ast.walk(ast.parse(block.code)):
                if isinstance(line, ast.ImportFrom) and str(line.module).startswith("eutree"):
                    found = importlib.import_module(str(line.module))
                    for imported in line.names:
                        assert hasattr(found, imported.name), f"{page}:{block.line}"


def test_a_file_is_written_and_not_run(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- file: one.py -->\n```python\n1 / 0\n```\n")
    run_block(blocks(page)[0], {}, page=page, folder=tmp_path)
    assert (tmp_path / "one.py").read_text() == "1 / 0\n"


def test_marked_block_is_only_compiled(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- no-run: takes an hour -->\n```python\n1 / 0\n```\n")
    assert blocks(page) == [Block(3, "python", "1 / 0\n", "no-run", "takes an hour")]
    run_block(blocks(page)[0], {}, page=page, folder=tmp_path)


@pytest.mark.parametrize("page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=name)
def test_links_of_pages_outside_the_documentation_lead_somewhere(page: Path) -> None:
    """Sphinx looks after the links in docs/."""
    targets = re.findall(r"\]\(([^)#:]+)\)", page.read_text())
    assert [target for target in targets if not (ROOT / target).exists()] == []


def test_the_tutorials_picture_is_of_the_tree_that_it_prints() -> None:
    """The rules on top make tests at or beyond their own levels unreachable."""
    page = (ROOT / "docs/tutorial.md").read_text()
    printed = page.partition("print(small)\n")[2].partition("```text\n")[2].partition("```")[0]
    levels = [float(cut) for cut in re.findall(r"always o\w+ when level .= ([\d.]+)\"", page)]
    tests = re.findall(r"if (\w+) <= ([\d.]+)", printed)
    drawn = (ROOT / "docs/images/tutorial-tree.svg").read_text()
    kept = [(f, cut) for f, cut in tests if f == "hour" or levels[0] < float(cut) < levels[1]]
    assert len(kept) >= 3
    assert [one for one in kept if f"{one[0]} ≤ {one[1]} " not in drawn] == []
