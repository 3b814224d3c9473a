"""The report of a run: everything shown, every name harmless, nothing from outside."""

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from eutree.report import RunReport, run_page
from eutree.report.chart import chart, ticks
from tests.export.policies import EVASION, NASTY, policy_of, tree
from tests.report.browser import grave_violations, open_page

CURVE = [(0.0, 0.5, 0.4, 0.6), (20.0, 0.8, 0.7, 0.9), (40.0, 0.9, 0.85, 0.95)]


def report(name: str = "EU-Tree") -> RunReport:
    return RunReport(
        title=f"{name}, a run",
        curves={"success rate": {name: CURVE, "C. U-Tree": CURVE[:2]}, name: {name: CURVE}},
        header=("learner", name),
        rows=[(name, "99 %"), ("C. U-Tree", name)],
        trees={name: policy_of(tree(9, 3), EVASION, statistics=True)},
        files=[(name, name), ("the policy", "a folder/policy.json")],
        notes=[name],
    )


class Outline(HTMLParser):
    """Collects the tags, the attributes and the text of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data: str) -> None:
        self.text += data


def test_everything_is_shown() -> None:
    outline = Outline(run_page(report()))
    for words in ("EU-Tree, a run", "Success rate", "99 %", "9 leaves", "policy.json"):
        assert words in outline.text
    assert outline.tags.count("polyline") == 4  # the second measure knows one learner of two
    assert outline.tags.count("table") == 1
    assert ("href", "a%20folder/policy.json") in outline.attributes


@pytest.mark.parametrize("name", NASTY)
def test_any_name_is_harmless(name: str) -> None:
    ordinary, nasty = Outline(run_page(report("plain"))), Outline(run_page(report(name)))
    assert nasty.tags == ordinary.tags
    for key, value in nasty.attributes:
        assert not key.startswith("on")
        assert key != "style"
        if key == "href":
            assert re.fullmatch(r"[A-Za-z0-9%/_.~-]*", value or "")


def test_parts_without_content_are_left_out() -> None:
    outline = Outline(run_page(RunReport(title="Nothing yet")))
    assert "section" not in outline.tags
    assert "Nothing yet" in outline.text


def test_same_report_same_page() -> None:
    assert run_page(report()) == run_page(report())


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3.0, 17.0), (5.0, 5.0), (1e-9, 3e-9)])
def test_ticks_enclose_the_interval(low: float, high: float) -> None:
    found = ticks(low, high)
    step = found[1] - found[0]
    assert found[0] <= low + 1e-9 * step
    assert found[-1] >= high - 1e-9 * step
    assert 2 <= len(found) <= 9


def test_chart_without_points_says_so() -> None:
    assert "No return was recorded" in chart("return", {"EU-Tree": []})


@pytest.mark.promise(25)
@pytest.mark.parametrize("width", [390, 1280])
def test_browser_is_quiet_and_nothing_is_cut_off(chromium: Any, tmp_path: Path, width: int) -> None:
    (tmp_path / "run.html").write_text(run_page(report("<b>bold</b>")), encoding="utf-8")
    opened = open_page(chromium, tmp_path / "run.html", width=width)
    opened.assert_quiet()
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
    assert opened.page.locator("main svg.chart").count() == 2
    assert opened.page.locator("b").count() == 0
    opened.page.close()


@pytest.mark.promise(25)
def test_an_injected_script_does_not_run(chromium: Any, tmp_path: Path) -> None:
    """The control: even if escaping failed, the page's policy refuses what it does not know."""
    injected = run_page(report()).replace("<main>", "<main><script>document.title='x'</script>")
    (tmp_path / "run.html").write_text(injected, encoding="utf-8")
    opened = open_page(chromium, tmp_path / "run.html")
    assert opened.page.title() == "EU-Tree, a run"
    assert "Content Security Policy" in opened.messages[0]
    opened.page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_serious_for_axe(chromium: Any, axe: str, tmp_path: Path, scheme: str) -> None:
    (tmp_path / "run.html").write_text(run_page(report()), encoding="utf-8")
    context = chromium.new_context(bypass_csp=True, color_scheme=scheme)
    page = context.new_page()
    page.goto((tmp_path / "run.html").as_uri())
    grave = grave_violations(page, axe)
    context.close()
    assert grave == []
