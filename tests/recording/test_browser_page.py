"""The real page in a real browser: what a scripted person does there is what is stored."""

import re
import time
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree  # noqa: F401 - registers the environments
from eutree.data import Demonstrations
from eutree.interaction.episode import replay
from eutree.recording import Recorder, SessionSettings
from eutree.recording.browser.server import HIDDEN
from tests.recording.people import Corridor
from tests.recording.serving import ENOUGH, in_a_thread, serving
from tests.recording.typists import (
    DRAWING,
    DRAWN,
    PATIENCE,
    Person,
    ScriptedMaker,
    box,
    evasion,
    goes_on_and_on,
)


@pytest.mark.slow
@pytest.mark.promise(9)
@pytest.mark.promise(26)
def test_a_person_records_redoes_discards_leaves_and_comes_back(chromium, tmp_path) -> None:
    with serving(tmp_path, evasion(), fps=10.0) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing").down().until(state="review").up()

        person.rest().tap("Enter").until(state="playing")
        for _ in range(4):
            person.down().rest(0.13).up().rest(0.07)
        person.down().until(state="review").up()

        person.rest().tap("r").until(state="playing").down()  # redo
        person.until(state="review").up()

        person.rest().tap("Enter").until(state="playing").rest(0.5).tap("Delete")  # discard
        person.until(state="review")

        person.rest().tap("Enter").until(state="playing").down().rest(0.3)
        person.page.close()  # in the middle
        person.open().until(state="paused")
        step = int(person.data("step"))
        assert step >= 1
        person.tap("Enter").until(state="playing").down().until(state="review").up()
        assert person.page.locator("#title").is_visible()
        person.rest().down("Enter").until(state="finished")  # which ends the session
        assert person.data("saved") == "3"
        assert person.page.locator("#episodes button").first.is_disabled()  # nobody listens now
        assert person.messages == []

    stored = Demonstrations.load(tmp_path / "demos")
    episodes = stored.episodes
    assert [(e.kept, e.comment) for e in episodes] == [
        (True, ""), (False, "redone"), (True, ""), (False, "discarded"), (True, ""),
    ]  # fmt: skip
    assert episodes[1].seed == episodes[2].seed
    assert len({e.seed for e in episodes}) == 4
    assert (episodes[3].ending, episodes[3].terminated, episodes[3].truncated) == (
        "stopped", False, False,
    )  # fmt: skip
    assert {e.ending for e in stored} <= {"goal", "collision"}
    assert len(episodes[4]) > step

    assert served.heard == person.keys  # every key edge arrived, in order
    for episode in episodes:  # what happened during an episode is stored with it
        space = [down for key, down, _, _ in episode.extras["edges"] if key == "space"]
        assert space == [place % 2 == 0 for place in range(len(space))]
    assert [len(episodes[k].extras["edges"]) for k in (0, 2)] == [2, 2]
    for episode in episodes:
        assert np.all(np.diff([when for _, _, when, _ in episode.extras["edges"]]) >= 0)
        held = episode.steps["keys"][:, episode.extras["keys"].index("space")]
        assert held.astype(int).tolist() == episode.actions.tolist()  # holding Space is "go"
        assert np.all(episode.steps["frame"] <= episode.steps["picture"])
    assert all(result.is_equal for result in replay(stored))


@pytest.mark.promise(25)
@pytest.mark.promise(24)
def test_the_page_asks_nothing_of_the_outside_and_hides_its_token(chromium, tmp_path) -> None:
    with serving(tmp_path) as served:
        person = Person(chromium, served).until(state="opening")
        person.page.locator("body[data-frame]").wait_for(timeout=PATIENCE)
        assert served.token not in person.page.url
        assert person.requests
        for url in person.requests:
            assert re.match(rf"(http|ws)://127\.0\.0\.1:{served.port}/", url)
            assert served.token not in url.partition("#")[0]
        person.page.reload()
        person.until(state="opening", role="acting")
        assert person.messages == []
        no_script = "() => { const s = document.createElement('script');"
        no_script += "s.textContent = 'document.title = \"run\"'; document.body.append(s);"
        no_script += "return document.title }"
        assert person.page.evaluate(no_script) != "run"
        assert any("Content Security Policy" in message for message in person.messages)


@pytest.mark.promise(24)
def test_without_its_token_the_page_says_what_is_missing(chromium, tmp_path) -> None:
    with serving(tmp_path) as served:
        page = chromium.new_context().new_page()
        page.goto(f"http://127.0.0.1:{served.port}/")
        page.get_by_text("lacks the recorder's token").wait_for(timeout=PATIENCE)
        assert page.locator("body").get_attribute("data-state") == "connecting"


@pytest.mark.promise(26)
def test_losing_the_focus_pauses(chromium, tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing").down("ArrowRight").until(action=2)
        person.page.evaluate("() => { window.dispatchEvent(new Event('blur')); }")
        person.until(state="paused")
        person.page.get_by_text(HIDDEN, exact=True).wait_for()
        assert served.session.tick(1e9).view.held == []
        person.tap("Enter").until(state="playing", action=1)


@pytest.mark.parametrize("script", ["study.js", "hurts.js"])
def test_a_script_that_comes_late_is_waited_for(chromium, tmp_path, script) -> None:
    """A view that came before it was shown by half, and no second one came."""
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        first = Person(chromium, served).until(state="opening")
        first.context.route(f"**/{script}", lambda route: (time.sleep(1.0), route.continue_()))
        first.page.close()
        second = first.open().until(state="opening")
        assert second.page.locator("button[data-command=start]").count() == 1
        assert second.messages == []


@pytest.mark.promise(26)
def test_two_tabs_one_acts(chromium, tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        first = Person(chromium, served).until(state="opening", role="acting")
        second = Person(chromium, served).until(state="opening", role="watching")
        assert second.page.locator("button[data-command=start]").is_disabled()
        second.tap("Enter").rest(0.2)
        assert served.session.state == "opening"
        first.page.bring_to_front()
        first.tap("Enter").until(state="playing")
        second.until(state="playing")
        second.page.get_by_role("button", name="Take over").click()
        second.until(role="acting", state="paused")
        first.until(role="watching")
        assert "Another page is acting" in first.page.locator("#banner").inner_text()
        second.page.close()
        first.until(role="idle")  # nobody acts, and nobody is said to
        assert "Nobody is acting" in first.page.locator("#banner").inner_text()
        first.page.get_by_role("button", name="Act here").click()
        first.until(role="acting")


@pytest.mark.promise(26)
def test_a_duplicated_tab_watches_and_a_reloaded_one_goes_on(chromium, tmp_path) -> None:
    """A browser copies the tab's session storage, by which the page knows itself."""
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        first = Person(chromium, served).until(state="opening", role="acting")
        with first.context.expect_page() as opened:
            first.page.evaluate("() => { window.open(location.href); }")
        opened.value.locator("body[data-role=watching]").wait_for(timeout=PATIENCE)
        assert first.data("role") == "acting"
        first.page.reload()
        first.until(role="acting")
        opened.value.locator("body[data-role=watching]").wait_for(timeout=PATIENCE)


def test_a_new_address_pasted_into_the_old_tab_connects(chromium, tmp_path) -> None:
    """As one does after a crash: the address changes in its fragment only."""
    with serving(tmp_path) as served:
        page = chromium.new_context().new_page()
        page.goto(f"http://127.0.0.1:{served.port}/#an-earlier-token")
        page.get_by_text("does not know this address").wait_for(timeout=PATIENCE)
        page.evaluate("(url) => { location.href = url; }", served.server.url)
        page.locator("body[data-state=opening][data-connection=open]").wait_for(timeout=PATIENCE)
        assert page.locator("#banner").is_hidden()


def test_a_recorder_that_is_gone_is_told_from_one_that_refuses(chromium, tmp_path) -> None:
    with serving(tmp_path) as served:
        page = chromium.new_context().new_page()
        page.goto(f"http://127.0.0.1:{served.port}/#an-earlier-token")
        page.get_by_text("does not know this address").wait_for(timeout=PATIENCE)
    page.get_by_text("The recorder does not answer").wait_for(timeout=PATIENCE)


class Numbered(Corridor):
    """Its keys are digits and a letter, as a person may choose them."""

    def get_keys_to_action(self):
        return {(ord("1"),): 0, (ord("p"),): 2}


def test_a_key_that_changes_its_name_is_released(chromium, tmp_path) -> None:
    """Press 1, press Shift, let go of 1: the keyboard reports !, and going went on."""
    with serving(tmp_path, Numbered(length=100, limit=10_000)) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing")
        for key in ("Digit1", "Shift"):
            person.page.keyboard.down(key)
        person.until(action=0)
        person.page.keyboard.up("Digit1")  # with Shift held it is reported as !
        person.until(action=1)
        person.page.keyboard.up("Shift")


@pytest.mark.parametrize("letter", ["\u0437", "\u03c0"])  # P's place in Russian and in Greek
def test_other_layouts_keep_their_letter_keys(chromium, tmp_path, letter) -> None:
    with serving(tmp_path, Numbered(length=100, limit=10_000)) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing")
        event = {"key": letter, "code": "KeyP", "bubbles": True, "cancelable": True}
        press = "(event) => document.body.dispatchEvent(new KeyboardEvent({}, event))"
        person.page.evaluate(press.format("'keydown'"), event)
        person.until(action=2)
        person.page.evaluate(press.format("'keyup'"), event)
        person.until(action=1)


def test_what_ended_early_is_said_to_count(chromium, tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing").rest(0.4).tap("e").until(state="review", saved=1)
        person.page.get_by_text("1 ended early").wait_for(timeout=PATIENCE)
        person.page.get_by_role("button", name="Discard episode 0").click()
        person.until(saved=0)
        person.page.locator("#early").wait_for(state="hidden", timeout=PATIENCE)


def test_a_network_cut_pauses_and_the_page_comes_back_by_itself(chromium, tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing").down("ArrowRight").until(action=2)
        driver = served.server._driver.connection
        driver.loop.call_soon_threadsafe(driver.transport.abort)
        person.until(state="paused", role="acting", connection="open")
        person.up("ArrowRight").tap("Enter").until(state="playing", action=1)


def test_a_pad_of_two_keys_holds_both(chromium, tmp_path) -> None:
    """The pad of "coast", left and right, drove to the left."""
    env = Corridor(length=100, limit=10_000)
    settings = SessionSettings(target=3, countdown=0.2)
    recorder = Recorder(env, tmp_path, keys="left=0,left+right=1,right=2", settings=settings)
    with in_a_thread(recorder) as served:
        person = Person(chromium, served).until(state="opening")
        person.page.locator("button[data-command=start]").click()
        person.until(state="playing")
        person.page.locator(".pad[data-action=right]").hover()
        person.page.mouse.down()
        person.until(action=2)
        person.page.mouse.up()
        person.page.locator(".pad[data-key='left+right']").hover()
        person.page.mouse.down()
        person.until(action=1)
        assert person.page.locator(".pad[data-key='left+right'].on").count() == 1
        person.page.mouse.up()
        person.page.locator("button[data-command=end]").click()
        person.until(state="review")
        edges = served.session.episodes[0].extras["edges"]
        both = [(key, down) for key, down, _, _ in edges][2:]
        assert sorted(both) == [("left", False), ("left", True), ("right", False), ("right", True)]


def test_a_pointer_or_finger_acts_like_the_key(chromium, tmp_path) -> None:
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        person = Person(chromium, served).until(state="opening")
        person.page.locator("button[data-command=start]").click()
        person.until(state="playing", action=1)
        person.page.locator(".pad[data-action=right]").hover()
        person.page.mouse.down()
        person.until(action=2)
        person.page.mouse.up()
        person.until(action=1)
        person.page.locator("button[data-command=end]").click()
        person.until(state="review")
        edges = served.session.episodes[0].extras["edges"]
        assert [(key, down) for key, down, _, _ in edges] == [("right", True), ("right", False)]


def test_everything_works_by_keyboard(chromium, tmp_path) -> None:
    """Tab reaches each control, Enter presses it; the select boxes change pace and mode."""
    with serving(tmp_path, Corridor(length=100, limit=10_000)) as served:
        person = Person(chromium, served).until(state="opening")
        reached = []
        for _ in range(20):
            person.page.keyboard.press("Tab")
            reached.append(
                person.page.evaluate(
                    "() => document.activeElement.id || document.activeElement.dataset.command"
                    " || document.activeElement.getAttribute('aria-label')"
                    " || document.activeElement.dataset.action"
                )
            )
        assert {"start", "finish", "speed", "mode", "Change the key of right"} <= set(reached)
        person.page.locator("#mode").select_option("turn")
        person.page.get_by_role("button", name="Change the key of right").press("Enter")
        person.page.keyboard.press("l")
        person.page.locator("#keys tr[data-action='2'] kbd", has_text="L").wait_for()
        person.page.locator("button[data-command=start]").press("Enter")
        person.until(state="playing", step=0)
        person.tap("l").until(step=1).rest(0.4).tap("l").until(step=2)
        assert served.session.play.controls.keys.keys_of(2) == ["l"]


def test_a_list_entry_is_discarded_and_kept(chromium, tmp_path) -> None:
    with serving(tmp_path) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
        person.up("ArrowRight").until(saved=1)
        person.page.get_by_role("button", name="Discard episode 0").click()
        person.until(saved=0)
        person.page.get_by_role("button", name="Keep episode 0").click()
        person.until(saved=1).rest(0.8).tap("Enter").until(state="playing")  # it is not discarded
        end = time.monotonic() + ENOUGH
        while not served.session.episodes[0].kept:
            assert time.monotonic() < end
            time.sleep(0.01)
        person.tap("p").until(state="paused").tap("Escape").until(state="review")
        person.page.get_by_role("button", name="Discard episode 0").focus()
        person.tap("Enter").until(saved=0)  # by keyboard the focus stays
        assert person.page.evaluate("document.activeElement.id") == "use-0"


CONTRAST = """() => {
  const linear = (v) => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const channel = (v) => linear(v / 255);
  const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  const parse = (text) => text.match(/[\\d.]+/g).map(Number);
  const ground = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const color = parse(getComputedStyle(e).backgroundColor);
      if (color.length === 3 || color[3] > 0.8) return color;
    }
    return [255, 255, 255];
  };
  const bad = [];
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    const apart = e.disabled || e.closest("#veil, option, .unseen");
    if (!own || apart || !e.checkVisibility()) continue;
    const ink = parse(getComputedStyle(e).color);
    const [a, b] = [light(ink), light(ground(e))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < 4.5) bad.push(`${e.textContent.trim().slice(0, 20)} ${ratio.toFixed(2)}`);
  }
  return bad;
}"""


def test_text_is_readable_and_nothing_overflows(chromium, tmp_path) -> None:
    wide = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"
    grounds = set()

    def looked_at(page):
        for width in (1180, 390):
            page.set_viewport_size({"width": width, "height": 800})
            page.evaluate(DRAWN)
            assert page.evaluate(wide) == 0
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                assert page.evaluate(CONTRAST) == []
                grounds.add(page.evaluate("getComputedStyle(document.body).backgroundColor"))

    with serving(tmp_path) as served:
        person = Person(chromium, served).until(state="opening")
        looked_at(person.page)
        person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
        looked_at(person.page)
        assert len(grounds) == 2


@pytest.mark.parametrize(("width", "height"), [(1180, 800), (1920, 1080), (390, 844)])
def test_panels_keep_their_places_and_nothing_covers_the_picture(
    chromium, tmp_path, width, height
) -> None:
    with serving(tmp_path, evasion(), fps=10.0) as served:
        person = Person(chromium, served).until(state="opening")
        person.page.set_viewport_size({"width": width, "height": height})
        places = {}
        for state, go_on in (
            ("opening", "Enter"),
            ("playing", "p"),
            ("paused", "e"),
            ("review", ""),
        ):
            person.until(state=state)
            places[state] = [box(person, f"#{name}-section") for name in ("keys", "episodes")]
            places[state] = [(at["x"], at["y"]) for at in places[state]]
            picture, card = box(person, "#picture"), box(person, "#card")
            assert card["y"] >= picture["y"] + picture["height"]  # below it, not over it
            person.page.keyboard.press(go_on) if go_on else None
        if width > 900:  # on a phone the panels are below the buttons, which differ in number
            assert len({tuple(at) for at in places.values()}) == 1
        assert picture["width"] >= {1180: 640, 1920: 1000, 390: 360}[width]


# How much of the line to the next decision is full, twice within the wait for one decision.
TWO_SHARES = """async () => {
  const width = (id) => document.getElementById(id).getBoundingClientRect().width;
  for (;;) {
    const step = document.body.dataset.step;
    const shares = [];
    for (const pause of [100, 300]) {
      await new Promise((done) => setTimeout(done, pause));
      shares.push(width("beat-fill") / width("beat"));
    }
    if (document.body.dataset.step === step) return shares;
  }
}"""


def test_the_screen_shows_what_a_key_will_do_and_when(chromium, tmp_path) -> None:
    """One decision in two seconds: a key that is pressed meanwhile must not seem dead."""
    with serving(tmp_path, Corridor(length=100, limit=10_000), fps=0.5) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing")
        person.down("ArrowRight").until(acting="stay", coming="right").until(action=2)
        first, second = person.page.evaluate(TWO_SHARES)
        assert 0.0 < first < second <= 1.0
        assert person.page.locator("#coming").is_hidden()
        assert box(person, "#pill")["width"] < 200  # in the corner of the picture
        person.up("ArrowRight")


def test_the_first_decision_is_what_one_sees_and_does_after_the_count(chromium, tmp_path) -> None:
    """It falls one interval after the countdown, so that a reaction is in time for it."""
    with serving(tmp_path, Corridor(length=100, limit=10_000), fps=0.5) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing", step=0)
        person.down("ArrowRight").until(step=1).up("ArrowRight").tap("e").until(state="review")
    demos = Demonstrations.load(tmp_path / "demos")
    assert demos.episodes[0].actions[0] == 2
    times, edges = demos.episodes[0].steps["time"], demos.episodes[0].extras["edges"]
    assert edges[0][2] < times[0]  # it had not been decided before the key


def test_a_key_that_is_held_while_it_counts_is_the_first_decision(chromium, tmp_path) -> None:
    """It counts until the key is known to be held."""
    long = Corridor(length=100, limit=10_000)
    with serving(tmp_path, long, fps=2.0, countdown=1e6) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="countdown").down("ArrowLeft")
        end = time.monotonic() + ENOUGH
        while "left" not in served.session.play.controls.held:
            assert time.monotonic() < end
            time.sleep(0.01)
        served.session.play._countdown_end = 0.0
        person.until(state="playing", step=2).up("ArrowLeft").tap("e").until(state="review")
    assert Demonstrations.load(tmp_path / "demos").episodes[0].actions[:2].tolist() == [0, 0]


def test_without_an_idle_action_nothing_happens_before_the_first_key(chromium, tmp_path) -> None:
    """CartPole has 50 decisions a second, and untouched at full speed it is over in 0.2 s."""
    cart = gymnasium.make("CartPole-v1", render_mode="rgb_array")
    with serving(tmp_path, cart) as served:
        person = Person(chromium, served).until(state="opening")
        assert person.page.locator("#speed").input_value() == "0.25"
        assert "shown slowly at first" in person.page.locator("#how").inner_text()
        assert "Keep the pole upright" in person.page.locator("#text").inner_text()
        person.tap("Enter").until(state="playing").rest(1.0)
        assert person.data("step") == "0"
        assert person.page.locator("#title").inner_text() == "Press a key to begin"
        assert person.page.locator("#pill").is_hidden()  # nothing is under way
        person.down("ArrowRight").until(acting="right").until(state="review").up("ArrowRight")
        assert person.page.locator("#title").inner_text() != "Nothing was recorded"
        person.rest().tap("Enter").until(state="playing").tap("e").until(state="review")
        assert person.page.locator("#title").inner_text() == "Nothing was recorded"
        assert not person.data("result")
    episode = Demonstrations.load(tmp_path / "demos").episodes[0]
    assert set(episode.actions) == {1}
    assert set(episode.steps["speed"]) == {0.25}


def test_arrow_keys_harm_nothing(chromium, tmp_path) -> None:
    with serving(tmp_path, evasion(), fps=2.0) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing", step=1)
        for key in ("ArrowLeft", "ArrowUp", "ArrowDown", "ArrowRight"):
            person.tap(key)
        person.until(step=2)
        assert person.data("state") == "playing"
        assert served.session.episodes == []


def test_the_opening_says_the_task_and_the_focus_can_be_seen(chromium, tmp_path) -> None:
    with serving(tmp_path, evasion(), countdown=1e6) as served:
        person = Person(chromium, served).until(state="opening")
        assert person.page.locator("#text").inner_text().startswith("Bring the blue disc to")
        assert (
            person.page.locator("#how")
            .inner_text()
            .startswith("Hold → or Space: go; no key: stop.")
        )
        assert not person.page.locator("#controls").is_visible()
        person.page.get_by_text("Shortcuts").click()
        assert person.page.locator("#controls").is_visible()
        person.page.locator("button[data-command=start]").click()
        person.until(state="countdown")
        assert "Hold the key while it counts" in person.page.locator("#text").inner_text()
        ring = "() => getComputedStyle(document.getElementById('screen')).outlineWidth"
        assert person.page.evaluate(ring) == "3px"
        pause = person.page.get_by_role("button", name="Pause", exact=True)
        assert pause.get_attribute("aria-keyshortcuts") == "P"  # no part of the button's name


def test_failures_that_are_kept_are_marked_and_explained(chromium, tmp_path) -> None:
    with serving(tmp_path, evasion(), fps=20.0) as served:
        person = Person(chromium, served).until(state="opening")
        while not any(e.ending == "collision" for e in served.session.episodes):
            person.page.locator("body[data-state=opening], body[data-state=review]").wait_for()
            person.rest(0.8).tap("Enter").until(state="playing").down().until(state="review").up()
            if served.session.episodes[-1].ending == "goal":
                person.rest(0.8).tap("Delete")  # three that are kept would be enough
        person.page.locator("#episodes .mark.bad", has_text="✕").first.wait_for()
        assert "failed and kept" in person.page.locator("#failures").inner_text()
        assert "failures may stay" in person.page.locator("#how").inner_text()


WIDE_DRAWING = DRAWING.replace('width="80"', 'width="4000"')


def test_the_end_is_one_button(chromium, tmp_path) -> None:
    maker = ScriptedMaker()
    with serving(tmp_path, maker=maker) as served:
        person = Person(chromium, served).until(state="opening")
        for _ in range(3):
            person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
            person.up("ArrowRight").rest(0.8)
        first = person.page.locator("#buttons button.first")
        assert first.inner_text().startswith("Make my tree")
        person.tap("Enter").until(tree="ready")
        assert person.page.locator("#verdict").inner_text() == "you 13 of 15; this tree 56 of 100"
        picture = person.page.locator("#tree")
        assert picture.get_attribute("width") == "80"
        assert "one leaf" in picture.get_attribute("aria-label")
        commands = person.page.locator("#commands code")
        assert commands.all_inner_texts() == list(maker.ready.commands)
        person.page.get_by_role("button", name="Copy: eutree show demos-tree.json").click()
        person.page.get_by_text("Copied").wait_for()
        person.page.get_by_role("button", name="Let it practise").click()
        person.page.locator("#verdict", has_text="96 of 100").wait_for(timeout=PATIENCE)
        assert person.page.locator("#curve circle").count() == 2
        assert person.page.get_by_role("button", name="Let it practise").count() == 0
        rows = person.page.locator("#ways tr").all_inner_texts()
        assert [row.split("\t")[:3] for row in rows] == [
            ["you", "13 of 15", "35.6"],
            ["your tree", "56 of 100", "33.0"],
            ["practised", "96 of 100", "17.6"],
        ]
        assert person.page.get_by_role("button", name="Kept").is_disabled()
        said = "4.0\u00a0% of your steps: more where x \u2264 5\u00a0m"
        assert said in person.page.locator("#changes").text_content()
        person.page.get_by_role("button", name="Keep mine").click()
        person.page.locator("#verdict", has_text="kept 1").wait_for(timeout=PATIENCE)
        assert maker.calls == ["make", "practise", "choose 1"]
        assert person.page.evaluate(CONTRAST) == []
        assert person.messages == []
        person.tap("Escape").until(state="finished")


def test_the_tree_drives_as_soon_as_it_is_made(chromium, tmp_path) -> None:
    """Its failure first and in words, its way lit; then *Let it practise*, and once more."""
    env = evasion()
    maker = goes_on_and_on(env)
    with serving(tmp_path, env, fps=20.0, maker=maker) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing", step=1).tap("e").until(state="review").rest(0.8)
        person.page.get_by_role("button", name="Make my tree").click()
        person.until(state="watching", acting="go")
        person.until(seen="over 1")
        assert person.page.locator("#text").inner_text() == "It never looks."
        assert person.page.locator("#announce").inner_text() == "Collision. It never looks."
        assert person.page.locator("#way li").all_inner_texts()[-1] == "so: go"
        lit = person.page.locator("#tree [data-node].lit")
        assert lit.evaluate_all("nodes => nodes.map(n => n.dataset.node)") == ["0", "2"]
        assert person.page.locator("#tree path.lit").count() == 1
        assert person.page.locator("#verdict").is_visible()
        person.tap("Enter").until(seen="over 2").until(state="review")
        person.page.get_by_role("button", name="Watch it").click()
        person.until(state="watching")
        person.page.get_by_role("button", name="Let it practise").click()
        person.page.locator("#verdict", has_text="96 of 100").wait_for(timeout=PATIENCE)
        person.tap("Escape").until(state="review")
        assert person.page.locator("#way-section").is_hidden()
        assert person.messages == []
    assert len(Demonstrations.load(tmp_path / "demos").episodes) == 1


def test_what_is_missing_is_said_and_begun_with(chromium, tmp_path) -> None:
    with serving(tmp_path, maker=ScriptedMaker()) as served:
        person = Person(chromium, served).until(state="opening")
        settings = replace(served.session.settings, target=9)
        served.session.settings = served.session.recording._settings = settings
        for _ in range(3):
            person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
            person.up("ArrowRight").rest(0.8)
        assert "the second line" in person.page.locator("#how").inner_text()
        person.page.get_by_role("button", name="Show that next").click()
        person.until(state="playing").down("ArrowRight").until(state="review").up("ArrowRight")
    assert Demonstrations.load(tmp_path / "demos").episodes[-1].seed == 4711


@pytest.mark.parametrize(("key", "said"), [("ArrowRight", "Succeeded"), ("ArrowLeft", "Failed")])
def test_whether_it_succeeded_is_said_where_the_end_has_no_name(
    chromium, tmp_path, key, said
) -> None:
    with serving(tmp_path, Cliff()) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing").down(key).until(state="review").up(key)
        assert person.page.locator("#title").inner_text() == said


class Cliff(Corridor):
    """A corridor with an end to the left, too, where one falls."""

    def step(self, action):
        falls = self.place + action < 1
        observation, reward, there, late, info = super().step(action)
        return observation, reward, there or falls, late, info


@pytest.mark.parametrize("touch", [False, True])
def test_a_person_takes_over_from_the_tree_and_hands_back(chromium, tmp_path, touch) -> None:
    env = evasion()
    maker = goes_on_and_on(env)
    tree = replace(maker.programme, refit=lambda: maker.programme.policy)
    with serving(tmp_path, env, fps=5.0, maker=maker) as served:
        served.session.driving.offer(replace(tree, scenes=()))
        options = {"has_touch": True, "is_mobile": True} if touch else {}
        person = Person(chromium, served, **options).until(state="opening")
        person.page.get_by_role("button", name="Let it drive").click()
        person.until(state="driving", acting="tree: go")
        idle = person.page.locator("#keys tr[data-action='0']")
        assert idle.inner_text().split() == ["stop", "↓"]
        if touch:
            person.page.locator(".pad[data-action=''][data-key=down]").hover()
            person.page.mouse.down()
            person.until(acting="you: stop")
            person.page.mouse.up()
        else:
            person.down("ArrowDown").until(acting="you: stop").up("ArrowDown")
            for key in ("Enter", "Space"):
                person.tap("p")
                go_on = person.page.locator("#buttons [data-command=start]")
                assert go_on.inner_text().split() == ["Go", "onEnter"]
                person.tap(key)
                person.page.locator("#buttons [data-command=pause]").wait_for()
        person.until(acting="tree: go").until(seen="over 1")
        if not touch:
            assert "Drive on" in person.page.locator("#buttons").inner_text()
        assert "You acted in" in person.page.locator("#text").inner_text()
        person.tap("Escape").until(state="opening")
        assert "no key" in idle.inner_text()
        assert "driven by the tree" in person.page.locator("#episodes").inner_text()
        assert person.data("saved") == "0"
        person.tap("Escape").until(state="finished")
        assert person.page.locator("#title").inner_text() == "1 saved"
        assert "Everything is stored." in person.page.locator("#text").inner_text()
        assert person.messages == []
    (episode,) = (e for e in Demonstrations.load(tmp_path / "demos").episodes if e.kept)
    assert 0 < episode.by_hand.sum() < len(episode)
    assert set(episode.actions[episode.by_hand]) == {0}


@pytest.mark.parametrize("width", [1920, 390])
def test_a_large_tree_and_its_commands_can_be_read(chromium, tmp_path, width) -> None:
    maker = ScriptedMaker()
    long = f"eutree export {'demos/' * 20}demos-tree.json --format c"
    maker.ready = replace(maker.ready, svg=WIDE_DRAWING, commands=(long,))
    with serving(tmp_path, maker=maker) as served:
        person = Person(chromium, served).until(state="opening")
        person.page.set_viewport_size({"width": width, "height": 900})
        person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
        person.up("ArrowRight").rest(0.8)
        served.session.wishes.express("make")
        person.until(tree="ready")
        tree = person.page.locator("#tree")
        assert tree.evaluate("tree => tree.clientWidth / tree.getAttribute('width')") >= 0.75
        assert person.page.locator("#drawing").evaluate("d => d.scrollWidth > d.clientWidth")
        command = person.page.locator("#commands code")  # wrapped, so that no part is hidden
        assert command.evaluate("code => code.scrollWidth - code.clientWidth") <= 0
        wide = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert person.page.evaluate(wide) == 0


def test_an_option_of_a_command_is_not_broken_at_its_hyphens(chromium, tmp_path) -> None:
    maker = ScriptedMaker()
    line = "eutree learn --demos demos --expert demos-tree.json --out run"
    maker.ready = replace(maker.ready, commands=(line,))
    with serving(tmp_path, maker=maker) as served:
        person = Person(chromium, served).until(state="opening")
        person.page.set_viewport_size({"width": 390, "height": 844})
        person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
        served.session.wishes.express("make")
        person.up("ArrowRight").until(tree="ready")
        code = person.page.locator("#commands code")
        heights = code.evaluate("code => [...code.children].map((word) => word.offsetHeight)")
        assert code.inner_text() == line
        assert len(heights) == len(line.split())
        assert max(heights) == min(heights)
        assert code.evaluate("code => code.clientHeight") > 2 * max(heights)  # it is wrapped


def test_what_the_agent_senses_is_a_panel_only_with_numbers(chromium, tmp_path) -> None:
    with serving(tmp_path, hud=True) as served:
        person = Person(chromium, served).until(state="opening")
        assert not person.page.locator("#numbers-section").is_visible()
        person.tap("Enter").until(state="playing")
        assert "place" in person.page.locator("#numbers-section").inner_text()


def test_who_has_only_fingers_is_told_of_buttons(chromium, tmp_path) -> None:
    with serving(tmp_path) as served:
        person = Person(chromium, served, has_touch=True, is_mobile=True).until(state="opening")
        told = person.page.locator("#how").inner_text()
        assert told.startswith("Hold a button below: left, stay, right; no button: stay.")
        assert "\u2192" not in told
        start = person.page.get_by_role("button", name="Start", exact=True)
        assert start.get_attribute("aria-keyshortcuts") == "Enter"


def test_a_fault_in_making_the_tree_is_said(chromium, tmp_path) -> None:
    maker = ScriptedMaker()
    maker.calls = ["make", "practise"]
    with serving(tmp_path, maker=maker) as served:
        person = Person(chromium, served).until(state="opening")
        person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
        person.up("ArrowRight").rest(0.8)
        served.session.wishes.express("practise")
        person.until(tree="failed")
        assert person.page.locator("#verdict").inner_text() == "the folder is gone"
        assert person.data("state") == "review"  # and recording goes on
