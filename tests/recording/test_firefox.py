"""The recorder's page in Firefox: an episode by keys, the tree of it, watched and put right."""

import time
from dataclasses import replace
from importlib import resources

import pytest

from eutree.data import Demonstrations
from tests.recording.firefox import firefox
from tests.recording.people import Corridor
from tests.recording.serving import serving
from tests.recording.typists import FINDINGS, OUT_OF_SIGHT, evasion, goes_on_and_on

WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


@pytest.fixture(scope="module")
def page():
    with firefox() as started:
        yield started


def title(page):
    return page.evaluate("document.getElementById('title').textContent")


@pytest.mark.slow
def test_a_person_records_makes_watches_and_takes_over(page, tmp_path) -> None:
    env = evasion()
    maker = goes_on_and_on(env)
    with serving(tmp_path, env, fps=8.0, maker=maker) as served:
        page.open(served.server.url)
        page.shows(state="opening", role="acting").until("document.body.dataset.frame")
        assert served.token not in page.evaluate("location.href")
        page.tap("Enter").shows(state="playing").down()
        page.until("document.querySelector('.pad.on')")
        assert page.evaluate("document.activeElement.id") == "picture"
        page.shows(state="review", saved="1").up()
        assert title(page) in ("Goal reached", "Collision")
        page.until("document.querySelector('#buttons [data-command=make]')")
        time.sleep(1.0)  # until then a key or a click belongs to the episode
        page.click("#buttons [data-command=make]").shows(tree="ready", state="watching")
        page.until("Number(document.body.dataset.step) > 1")
        assert page.evaluate("document.querySelectorAll('#tree .lit').length") > 0
        assert page.evaluate("document.querySelector('#way li:last-child').textContent") == "so: go"
        page.shows(seen="over 1")
        assert page.evaluate("document.getElementById('text').textContent") == "It never looks."
        page.tap("Enter").until("document.body.dataset.seen === ''").tap("Escape")
        page.shows(state="review")
        again = replace(maker.programme, scenes=(), refit=lambda: maker.programme.policy)
        served.session.driving.offer(again)
        page.until("document.querySelector('#buttons [data-command=correct]')")
        page.click("#buttons [data-command=correct]").shows(state="driving")
        page.until("Number(document.body.dataset.step) > 0").down()
        page.until("document.getElementById('acting').textContent === 'you: go'").up()
        page.until("document.getElementById('acting').textContent === 'tree: go'").tap("Escape")
        page.shows(state="review").tap("Escape").shows(state="finished")
        assert page.messages == []
    episodes = Demonstrations.load(tmp_path / "demos").episodes
    assert ("space", True) in [(key, down) for key, down, _, _ in episodes[0].extras["edges"]]
    assert episodes[0].actions.sum() > 1
    assert any(episode.by_hand is not None for episode in episodes[1:])


@pytest.mark.parametrize(("width", "height"), [(1180, 800), (844, 390), (640, 430), (500, 844)])
def test_what_is_held_and_said_is_in_sight_and_axe_finds_nothing(
    page, tmp_path, width, height
) -> None:
    package = pytest.importorskip("axe_playwright_python", reason="needs the test requirements")
    axe = (resources.files(package) / "axe.min.js").read_text(encoding="utf-8")
    with serving(tmp_path, evasion(), fps=8.0) as served:
        page.open(served.server.url, width=width, height=height)
        page.shows(state="opening").until("document.body.dataset.frame")
        page.add(axe)
        for key, state in (("Enter", "playing"), ("p", "paused"), ("e", "review")):
            page.tap(key).shows(state=state)
            seen = ["#picture", "#title"] + (["#buttons .first"] if state != "playing" else [])
            assert page.evaluate(f"({OUT_OF_SIGHT})({seen})") == []
            assert page.evaluate(WIDE) == 0
            assert page.evaluate(f"({FINDINGS})()") == []


def test_a_reload_and_a_lost_focus_let_go_of_the_keys(page, tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        page.open(served.server.url)
        page.shows(state="opening").tap("Enter").shows(state="playing").down("ArrowRight")
        page.shows(action="2")
        page.evaluate("dispatchEvent(new Event('blur'))")
        page.shows(state="paused")
        page.up("ArrowRight").tap("Enter").shows(state="playing", action="1")
        page.reload().shows(state="paused", role="acting")
