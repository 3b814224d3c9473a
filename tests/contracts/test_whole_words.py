"""Options and dates of the pages stay in one line, in a real browser with the pages' own style."""

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from docutils import nodes

from tests.contracts.documents import ROOT
from tests.report.browser import browser, open_page

PAGE = """<!doctype html><style>{style}</style>
<table class="docutils"><tr>
<th style="max-width: 1em"><code class="docutils literal {mark}"><span class="pre">--practise</span>
<span class="pre">100</span></code></th>
<td style="max-width: 1em"><span class="{mark}">2026-11-23</span></td>
</tr></table>
<div style="width: 1em"><code class="literal {mark}">
<span class="pre">--max-transitions</span></code></div>"""
BROKEN = """[...document.querySelectorAll('.pre, span:not(.pre)')].filter(
  one => one.getClientRects().length > 1).map(one => one.textContent)"""


@pytest.fixture(scope="module")
def conf() -> Iterator[ModuleType]:
    """Load the settings of the documentation, and leave the paths as they were."""
    paths = list(sys.path)
    spec = importlib.util.spec_from_file_location("settings_of_docs", ROOT / "docs" / "conf.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path[:] = paths


@pytest.fixture(scope="module")
def started() -> Iterator[Any]:
    with browser() as one:
        yield one


def broken(started: Any, folder: Path, mark: str, style: str) -> list[str]:
    path = folder / "page.html"
    path.write_text(PAGE.format(mark=mark, style=style))
    return open_page(started, path, width=390).page.evaluate(BROKEN)


def test_no_option_and_no_date_is_broken(started: Any, tmp_path: Path) -> None:
    style = (ROOT / "docs" / "static" / "pages.css").read_text()
    assert broken(started, tmp_path, "whole", style) == []


def test_the_browser_breaks_them_without_the_style(started: Any, tmp_path: Path) -> None:
    found = broken(started, tmp_path, "whole", "")
    assert {"--practise", "2026-11-23", "--max-transitions"} <= set(found)


SETTINGS = """<!doctype html><style>{style}</style><table class="{mark} docutils"><thead><tr>
<th>setting</th><th>default</th><th>what it does</th></tr></thead><tbody><tr>
<td><code class="literal"><span class="pre">planner.improvement.max_deviations</span></code></td>
<td><code class="literal"><span class="pre">6000</span></code></td>
<td>Steps at which single deviations are tried, at most.</td></tr></tbody></table>"""


@pytest.mark.parametrize(("mark", "stands_below"), [("settings", True), ("", False)])
def test_on_a_phone_what_a_setting_does_stands_below_it(
    started: Any, tmp_path: Path, mark: str, stands_below: bool
) -> None:
    """Of the last column a word of three letters was to be seen."""
    style = (ROOT / "docs" / "static" / "pages.css").read_text()
    (tmp_path / "page.html").write_text(SETTINGS.format(mark=mark, style=style))
    opened = open_page(started, tmp_path / "page.html", width=390)
    boxes = [cell.bounding_box() for cell in opened.page.locator("td").all()]
    assert (boxes[2]["y"] >= boxes[0]["y"] + boxes[0]["height"] - 1) is stands_below
    opened.page.close()


def test_the_tables_of_settings_are_marked(conf: ModuleType) -> None:
    for page, classes in (("reference/settings", ["settings"]), ("methods", [])):
        table = nodes.table()
        app = SimpleNamespace(env=SimpleNamespace(docname=page))
        conf.stack_settings(app, nodes.section("", table))
        assert table["classes"] == classes


def test_what_is_marked(conf: ModuleType) -> None:
    long, date = "x" * 60, nodes.Text("on 2026-11-23 and after")
    cell = nodes.entry("", nodes.paragraph("", "", date))
    alone = nodes.paragraph("", "", nodes.Text("on 2026-11-23"))
    codes = nodes.paragraph("", "", nodes.literal("", "--practise 100"), nodes.literal("", long))
    document = nodes.section("", cell, alone, codes)
    conf.keep_words_whole(None, document)
    marked = [
        n.astext()
        for n in document.findall()
        if "whole" in getattr(n, "attributes", {}).get("classes", ())
    ]
    assert marked == ["2026-11-23", "--practise 100"]
    assert cell.astext() == "on 2026-11-23 and after"
