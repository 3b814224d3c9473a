"""README and documentation are run: a page cannot show what does not work."""

from pathlib import Path

import pytest

from tests.contracts.documents import ROOT, Block, blocks, pages, run_block, run_command


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "__main__"}
    for block in blocks(page):
        run_block(block, namespace, page=page, folder=tmp_path)


def test_a_wrong_block_fails(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```python\nx = 1\n```\n\n```python\nassert x == 2\n```\n")
    first, second = blocks(page)
    namespace: dict[str, object] = {}
    run_block(first, namespace, page=page, folder=tmp_path)
    with pytest.raises(AssertionError):
        run_block(second, namespace, page=page, folder=tmp_path)


def test_a_wrong_command_fails(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="unknown command"):
        run_command("eutree no-such-command", tmp_path)


def test_marked_block_is_only_compiled(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- no-run: takes an hour -->\n```python\n1 / 0\n```\n")
    assert blocks(page) == [Block(line=3, language="python", code="1 / 0\n", runs=False)]
    run_block(blocks(page)[0], {}, page=page, folder=tmp_path)
