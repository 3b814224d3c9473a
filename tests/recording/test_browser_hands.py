"""Fingers, Tab and Enter, and the click of a screen reader: each acts like the keys."""

from contextlib import contextmanager

import pytest

from eutree.recording import Recorder, SessionSettings
from tests.recording.people import Corridor
from tests.recording.serving import in_a_thread, serving
from tests.recording.typists import PHONE, Person

CENTRE = """(selector) => {
  const box = document.querySelector(selector).getBoundingClientRect();
  return { x: box.x + box.width / 2, y: box.y + box.height / 2 };
}"""


@contextmanager
def playing(chromium, folder, keys, *, countdown=0.2, options=None):
    """Yield somebody in the middle of an episode without an end."""
    env = Corridor(length=1000, limit=100_000)
    settings = SessionSettings(target=3, countdown=countdown, fps=10.0)
    recorder = Recorder(env, folder / "demos", keys=keys, settings=settings)
    with in_a_thread(recorder) as served:
        person = Person(chromium, served, **options or {}).until(state="opening")
        person.page.locator("button[data-command=start]").click()
        yield person.until(state="playing"), served


class Fingers:
    """Fingers on the pads of a page, each of its own number."""

    def __init__(self, person):
        self._page, self._down = person.page, {}
        self._devices = person.context.new_cdp_session(person.page)

    def put(self, number, selector):
        self._down[number] = {**self._page.evaluate(CENTRE, selector), "id": number}
        self._touch("touchStart", self._down.values())

    def lift(self, number):
        one = self._down.pop(number)
        self._touch("touchEnd", [one] if self._down else [])

    def _touch(self, kind, points):
        event = {"type": kind, "touchPoints": list(points)}
        self._devices.send("Input.dispatchTouchEvent", event)


def test_a_finger_that_stays_holds_what_another_held_before(chromium, tmp_path) -> None:
    """The action became "none" with the first finger that was lifted."""
    with playing(chromium, tmp_path, "left=0,left+up=2,none=1", options=PHONE) as (person, _):
        fingers = Fingers(person)
        fingers.put(0, ".pad[data-key=left]")
        person.until(action=0)
        fingers.put(1, ".pad[data-key='left+up']")
        person.until(action=2)
        fingers.lift(0)
        step = int(person.data("step"))
        person.until(step=step + 3)
        assert person.data("action") == "2"
        fingers.lift(1)
        person.until(action=1)


def tab_to(person, selector):
    for _ in range(40):
        person.page.keyboard.press("Tab")
        if person.page.evaluate("(s) => document.activeElement.matches(s)", selector):
            return
    raise AssertionError(f"Tab never reaches {selector}")


@pytest.mark.parametrize("key", ["Enter", "Space"])
def test_a_button_that_has_the_focus_is_held_by_enter_or_space(chromium, tmp_path, key) -> None:
    """They did nothing on it, and Space even another action where it is the key of one."""
    with playing(chromium, tmp_path, "left=0,space=2,none=1") as (person, served):
        tab_to(person, ".pad[data-action=left]")
        person.down(key).until(action=0)
        assert person.page.locator(".pad[data-action=left]").get_attribute("aria-pressed") == "true"
        person.until(step=int(person.data("step")) + 5)  # the key repeats meanwhile
        assert person.data("action") == "0"
        person.up(key).until(action=1)
        assert person.page.evaluate("() => document.activeElement.id") == "pad-left"
        assert served.heard == [("left", True), ("left", False)]
        person.page.locator("#picture").click()
        person.down("Space").until(action=2)
        person.up("Space").until(action=1)


@pytest.mark.parametrize("key", ["Enter", "Space"])
def test_a_button_that_has_the_focus_lets_a_paused_episode_go_on(chromium, tmp_path, key) -> None:
    """It kept Enter and Space to itself while nothing played."""
    with playing(chromium, tmp_path, "left=0,right=2,none=1") as (person, served):
        tab_to(person, ".pad[data-action=left]")
        person.tap("p").until(state="paused")
        assert person.page.evaluate("() => document.activeElement.id") == "pad-left"
        person.tap(key).until(state="playing")
        assert ("left", True) not in served.heard
        person.down(key).until(action=0)
        person.up(key).until(action=1)


@pytest.mark.parametrize("mode", ["hold", "toggle", "turn"])
def test_a_click_without_a_pointer_is_one_press(chromium, tmp_path, mode) -> None:
    with playing(chromium, tmp_path, "left=0,right=2,none=1") as (person, served):
        if mode != "hold":
            person.tap("p").until(state="paused")
            person.page.locator("#mode").select_option(mode)
            person.tap("Enter") if mode == "turn" else person.page.locator("button.first").click()
            person.until(state="playing")
        served.heard.clear()
        click = "() => document.querySelector('.pad[data-action=right]').click()"
        person.page.evaluate(click)
        person.until(action=2)
        if mode == "toggle":
            person.rest(0.4)
            assert person.data("action") == "2"
            person.page.evaluate(click)
        if mode != "turn":
            person.until(action=1)
        assert served.heard == [("right", True), ("right", False)] * (1 + (mode == "toggle"))


def test_a_pointer_presses_once_and_leaves_the_keys_their_meaning(chromium, tmp_path) -> None:
    with playing(chromium, tmp_path, "left=0,space=2,none=1") as (person, served):
        person.page.locator(".pad[data-action=left]").click(delay=400)
        person.rest(0.3)
        assert served.heard == [("left", True), ("left", False)]
        person.down("Space").until(action=2)
        person.up("Space").until(action=1)


def test_what_was_switched_off_by_leaving_is_not_shown_as_on(chromium, tmp_path) -> None:
    with playing(chromium, tmp_path, "left=0,right=2,none=1", countdown=3.0) as (person, _):
        person.tap("p").until(state="paused")
        person.page.locator("#mode").select_option("toggle")
        person.page.locator("button.first").click()
        person.until(state="playing").tap("ArrowRight").until(action=2)
        assert person.page.locator(".pad.on").inner_text().startswith("right")
        person.page.evaluate("() => dispatchEvent(new Event('blur'))")
        person.until(state="paused").tap("Enter").until(state="countdown", action=2)
        assert person.page.locator(".pad.on").count() == 0
        assert person.page.locator("#acting").inner_text() == "stay"
        person.until(state="playing", action=1)


def test_a_second_tap_on_change_leaves_the_key_as_it_was(chromium, tmp_path) -> None:
    """Without a keyboard there was no way out of it."""
    with serving(tmp_path) as served:
        person = Person(chromium, served, **PHONE).until(state="opening")
        row = person.page.locator("#keys tr[data-action='0']")
        keys = row.inner_text()
        row.get_by_role("button").tap()
        assert "press a key" in row.inner_text()
        row.get_by_role("button", name="Cancel").tap()
        assert row.inner_text() == keys
        row.get_by_role("button", name="Change").tap()
        person.tap("k")
        person.page.wait_for_function(
            "() => document.querySelector('#keys').innerText.includes('K')"
        )


def test_a_key_that_cannot_be_chosen_is_named(chromium, tmp_path) -> None:
    with serving(tmp_path) as served:
        person = Person(chromium, served).until(state="opening")
        row = person.page.locator("#keys tr[data-action='0']")
        keys = row.inner_text()
        row.get_by_role("button", name="Change").click()
        person.tap("Home")
        told = person.page.get_by_text("Not changed: unknown key 'home'.")
        told.wait_for()
        assert row.inner_text() == keys
        row.get_by_role("button", name="Change").click()
        person.tap("k")
        told.wait_for(state="detached")


@pytest.mark.parametrize("key", ["Enter", "Space"])
def test_enter_and_space_on_cancel_leave_the_key_as_it_was(chromium, tmp_path, key) -> None:
    """They were bound, the opposite of what the button says that has the focus."""
    with serving(tmp_path) as served:
        person = Person(chromium, served).until(state="opening")
        row = person.page.locator("#keys tr[data-action='0']")
        keys = row.inner_text()
        row.get_by_role("button").press(key)
        assert "press a key" in row.inner_text()
        assert person.page.evaluate("() => document.activeElement.textContent") == "Cancel"
        person.tap(key)
        person.page.wait_for_function(
            "() => !document.querySelector('#keys').innerText.includes('press a key')"
        )
        assert row.inner_text() == keys
        assert person.page.evaluate("() => document.activeElement.textContent") == "Change"
        row.get_by_role("button", name="Change").press(key)
        person.tap("Tab")  # on to where the key is free
        assert "press a key" in row.inner_text()
        person.page.locator("#picture").focus()
        person.tap(key)
        row.locator("kbd", has_text=key).wait_for()


@pytest.mark.parametrize("key", ["Enter", "Space"])
def test_after_a_pointer_on_change_enter_and_space_are_keys(chromium, tmp_path, key) -> None:
    with serving(tmp_path) as served:
        person = Person(chromium, served).until(state="opening")
        row = person.page.locator("#keys tr[data-action='0']")
        row.get_by_role("button", name="Change").click()
        person.tap(key)
        row.locator("kbd", has_text=key).wait_for()
        assert person.data("state") == "opening"
