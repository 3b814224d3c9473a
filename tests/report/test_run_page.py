"""The report of a run: everything shown, every name harmless, nothing from outside."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eutree.report import (
    RunReport,
    WatchedEpisode,
    WatchedTree,
    run_page,
)
from eutree.report.chart import chart, scatter, ticks
from eutree.report.html import LeafChange, changed_leaves
from tests.export.policies import EVASION, NASTY, policy_of, tree
from tests.report.browser import ENOUGH, Opened, grave_violations, open_page
from tests.report.pages import Outline, report
from tests.report.watched import episodes


def test_everything_is_shown() -> None:
    outline = Outline(run_page(report()))
    for words in ("EU-Tree, a run", "Success rate", "99 %", "9 leaves", "policy.json"):
        assert words in outline.text
    assert outline.tags.count("polyline") == 4  # the second measure knows one learner of two
    assert outline.tags.count("table") == 1
    assert outline.tags.count("h1") == 1
    assert ("href", "a%20folder/policy.json") in outline.attributes


@pytest.mark.parametrize("name", NASTY)
def test_any_name_is_harmless(name: str) -> None:
    ordinary, nasty = Outline(run_page(report("plain"))), Outline(run_page(report(name)))
    assert nasty.tags == ordinary.tags
    for key, value in nasty.attributes:
        assert not key.startswith("on")
        assert key != "style"
        if key == "href":
            assert re.fullmatch(r"#?[A-Za-z0-9%/_.~-]*", value or "")


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


@pytest.mark.parametrize(
    ("values", "choices", "low", "high"),
    [
        ((0.33, 0.999), {"percent": True}, 0.0, 1.0),  # reached 120 %
        ((1.0, 1.0), {"percent": True}, 0.0, 1.0),
        ((8.0, 9.0), {"whole": True}, 0, 100),  # had 8.4 leaves
        ((48.8, 48.8), {}, 40.0, 60.0),  # went from 48.3 to 49.3
    ],
)
def test_axes_show_what_can_be(values, choices, low, high) -> None:
    points = [(float(x), value, value, value) for x, value in enumerate(values)]
    drawing = chart("measure", {"one": points}, **choices)
    texts = re.findall(r'text-anchor="end">([^<]*)<', drawing)
    marks = [float(text.removesuffix(" %")) / (100 if "%" in text else 1) for text in texts]
    assert low <= marks[0] <= min(values)
    assert max(values) <= marks[-1] <= high
    assert marks[-1] - marks[0] > 0.09 * max(values)
    assert not choices.get("whole") or all(mark == int(mark) for mark in marks)


def test_the_axes_of_a_front_count_leaves_and_show_shares_as_percentages() -> None:
    drawing = scatter("leaves", "share", [(8.0, 0.992, "a"), (9.0, 0.999, "b")], percent=True)
    said = re.findall(r"<text[^>]*>([^<]*)</text>", drawing)
    assert said[-3:] == ["8", "9", "leaves"]
    assert said[0] == "90 %"
    assert said[-4] == "100 %"


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


def opened_report(chromium: Any, tmp_path: Path, width: int = 1280) -> Opened:
    (tmp_path / "run.html").write_text(run_page(report()), encoding="utf-8")
    opened = open_page(chromium, tmp_path / "run.html", width=width)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    return opened


def test_changed_leaves_are_marked_and_the_verdict_points_at_them(
    chromium: Any, tmp_path: Path
) -> None:
    opened = opened_report(chromium, tmp_path)
    changed = opened.page.locator(".node.changed")
    assert changed.count() == 2
    words = sorted(node.locator(".was").inner_html() for node in changed.all())
    assert words == ["was go in 25 %", "was stop"]
    assert "decided otherwise before" in opened.page.locator("#key").inner_text()
    link = opened.page.locator(".verdict a")
    assert opened.page.locator(link.get_attribute("href") or "").is_visible()
    changed.first.click()
    assert "Before: " in opened.page.locator("#details").inner_text()
    opened.assert_quiet()
    opened.page.close()


def test_an_episode_of_somebody_else_says_where_this_tree_differs(
    chromium: Any, tmp_path: Path
) -> None:
    policy = policy_of(tree(9, 3), EVASION)
    (own,) = episodes(policy, count=1, steps=3)
    other = replace(own.episode, actions=1 - own.episode.actions)
    played = [own, WatchedEpisode(other, own.frames, by="Somebody")]
    page = run_page(RunReport("Two", watched=WatchedTree(policy, played)))
    (tmp_path / "run.html").write_text(page, encoding="utf-8")
    opened = open_page(chromium, tmp_path / "run.html")
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    assert "this tree" not in opened.page.locator("#status").inner_text()
    opened.page.select_option("#episode", "1")
    action = policy.schema.actions[own.episode.actions[0]]
    assert f"this tree: {action}" in opened.page.locator("#status").inner_text()
    assert opened.page.locator("#details").inner_text().count("Somebody") == 0
    opened.page.close()


def test_without_episodes_the_tree_has_the_whole_width(chromium: Any, tmp_path: Path) -> None:
    watched = WatchedTree(policy_of(tree(2, 3), EVASION))
    (tmp_path / "run.html").write_text(
        run_page(RunReport("One", watched=watched)), encoding="utf-8"
    )
    opened = open_page(chromium, tmp_path / "run.html")
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    assert not opened.page.locator("#episode-panel").is_visible()
    widths = "['#tree-panel', '.beside'].map(s => document.querySelector(s).clientWidth)"
    inner, outer = opened.page.evaluate(widths)
    assert inner == outer
    said = opened.page.locator("#tree-panel, #details").all_inner_texts()
    assert said
    assert "%" not in "".join(said)  # nothing is known of visits: 0 % would be false
    assert "recorded steps" not in "".join(said)
    opened.assert_quiet()
    opened.page.close()


def test_on_paper_the_whole_tree_is_there(chromium: Any, tmp_path: Path) -> None:
    opened = opened_report(chromium, tmp_path, width=390)
    opened.page.emulate_media(media="print", color_scheme="dark")
    opened.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    frame = opened.page.locator("#canvas").bounding_box()
    for node in opened.page.locator(".node .box").all():
        box = node.bounding_box()
        assert frame["x"] - 1 <= box["x"]
        assert box["x"] + box["width"] <= frame["x"] + frame["width"] + 1
    assert not opened.page.locator("#play").is_visible()
    paper = "getComputedStyle(document.body).backgroundColor"
    assert opened.page.evaluate(paper) == "rgb(255, 255, 255)"
    opened.page.close()


def test_which_leaves_changed() -> None:
    """A stump at 18 against one leaf that always goes: one leaf differs, on all of its rows."""
    before = policy_of(tree(1, 3), EVASION)
    before = replace(before, actions=[1])
    stump = tree(1, 3).split(0, 0, 18.0)
    after = replace(policy_of(stump, EVASION), actions=[0, 1])
    rows = [[1.0, 0.0, 0.0], [17.0, 0.0, 0.0], [20.0, 0.0, 0.0]]
    assert changed_leaves(before, after, rows) == {0: LeafChange(1, 1.0)}
    assert changed_leaves(after, before, rows) == {0: LeafChange(0, 2 / 3)}
    assert changed_leaves(after, after, rows) == {}


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
