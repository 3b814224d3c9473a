"""The recorder's window: posted events without a display, and real keys under Xvfb."""

import subprocess
import sys
import time

import gymnasium
import numpy as np
import pygame
import pytest

import eutree  # noqa: F401 - registers the environments
from eutree.data import Demonstrations
from eutree.interaction.events import KeyDown, KeyUp
from eutree.interaction.recorder import Recorder
from eutree.interaction.replay import replay
from eutree.interaction.settings import SessionSettings
from eutree.interaction.window import Gamepad, Window, key_name
from eutree.interaction.window_screen import (
    CARD_TOP,
    MOST_LINES,
    SIZE,
    STAGE,
    fitting,
    pill,
    words,
)
from tests.interaction.people import Corridor
from tests.interaction.xvfb import display

ENOUGH = 60.0


class Clock:
    """The window's time: it goes on with each look, however long that takes a busy machine."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


CLOCK = Clock()


@pytest.fixture(autouse=True)
def clock(monkeypatch) -> None:
    monkeypatch.setattr("eutree.interaction.window.time", CLOCK)
    monkeypatch.setattr("eutree.interaction.window_screen.time", CLOCK)


class Person:
    """Posts pygame's events and looks at the window."""

    def __init__(self, folder, env=None, **settings) -> None:
        defaults = {"target": 2, "countdown": 0.1, "hud": True}
        self.recorder = Recorder(
            env or Corridor(), folder, settings=SessionSettings(**defaults | settings)
        )
        self.window = Window(self.recorder)
        pygame.event.clear()
        self.look()

    def look(self):
        self.view = self.window.tick().view
        CLOCK.now += 1 / 120
        return self

    def post(self, kind, **fields):
        pygame.event.post(pygame.event.Event(kind, **fields))
        return self.look()

    def down(self, key):
        return self.post(pygame.KEYDOWN, key=key)

    def up(self, key):
        return self.post(pygame.KEYUP, key=key)

    def tap(self, key):
        return self.down(key).up(key)

    def until(self, state):
        end = CLOCK.now + ENOUGH
        while self.view.state != state:
            assert CLOCK.now < end, f"still {self.view.state}, not {state}"
            self.look()
        return self

    def rest(self, seconds=0.8):
        end = CLOCK.now + seconds
        while CLOCK.now < end:
            self.look()
        return self


@pytest.fixture
def person(tmp_path):
    person = Person(tmp_path / "demos")
    yield person
    person.recorder.close()
    person.window.close()


def test_a_person_records_with_the_keyboard(person, tmp_path) -> None:
    assert person.view.state == "opening"
    person.tap(pygame.K_RETURN).until("playing")
    person.down(pygame.K_RIGHT).until("review").up(pygame.K_RIGHT)
    person.rest().tap(pygame.K_r).until("playing")
    person.down(pygame.K_RIGHT).until("review").up(pygame.K_RIGHT)
    person.rest().tap(pygame.K_RETURN).until("playing").rest(0.3).tap(pygame.K_DELETE)
    person.rest().tap(pygame.K_RETURN).until("playing").rest(0.3).tap(pygame.K_e)
    person.rest().tap(pygame.K_RETURN).until("finished")
    person.recorder.close()
    stored = Demonstrations.load(tmp_path / "demos")
    assert [(e.kept, e.ending, e.comment) for e in stored.episodes] == [
        (False, "terminated", "redone"),
        (True, "terminated", ""),
        (False, "stopped", "discarded"),
        (True, "stopped", ""),
    ]
    assert stored.episodes[0].extras["viewer"] == ""
    episode = stored.episodes[0]
    assert np.all(episode.steps["frame"] == episode.steps["picture"])  # each was seen at once
    assert all(result.is_equal for result in replay(stored, Corridor()))


def test_each_screen_can_be_drawn(person) -> None:
    pictures = []
    for prepare in (
        lambda: person,
        lambda: person.tap(pygame.K_RETURN),
        lambda: person.until("playing").rest(0.2),
        lambda: person.tap(pygame.K_p),
        lambda: person.tap(pygame.K_e),
        lambda: person.rest().tap(pygame.K_ESCAPE),
    ):
        prepare()
        pictures.append(pygame.surfarray.array3d(pygame.display.get_surface()).tobytes())
    assert len(set(pictures)) == 6


def test_an_older_episode_is_discarded_and_kept(person, tmp_path) -> None:
    for _ in range(2):
        person.tap(pygame.K_RETURN).until("playing")
        person.down(pygame.K_RIGHT).until("review").up(pygame.K_RIGHT).rest()
    kept = lambda: [e.kept for e in Demonstrations.load(tmp_path / "demos").episodes]  # noqa: E731
    person.tap(pygame.K_k)  # nothing is chosen yet
    assert kept() == [True, True]
    person.tap(pygame.K_TAB).tap(pygame.K_TAB).tap(pygame.K_k)  # the last, the one before
    assert kept() == [False, True]
    assert [e.kept for e in person.view.episodes] == [False, True]
    person.tap(pygame.K_k)
    assert kept() == [True, True]
    box = next(box for box, row in person.window._screen._rows if row == 1)
    shown = pygame.display.get_surface().get_size()  # less than drawn, on a small desktop
    at = [place * part / whole for place, part, whole in zip(box.center, shown, SIZE, strict=True)]
    person.post(pygame.MOUSEBUTTONDOWN, pos=at, button=1).tap(pygame.K_k)
    assert kept() == [True, False]
    person.tap(pygame.K_RETURN).until("playing").tap(pygame.K_TAB).tap(pygame.K_k)
    assert kept() == [True, False]  # while an episode runs these keys do nothing


def test_a_long_list_stays_in_the_window_and_shows_the_chosen_one(person) -> None:
    person.tap(pygame.K_RETURN).until("playing")
    person.down(pygame.K_RIGHT).until("review").up(pygame.K_RIGHT).rest(0.1)
    recording = person.recorder.session.recording
    recording.episodes += recording.episodes * 29
    recording.numbers = list(range(30))
    for _ in range(30):
        person.tap(pygame.K_TAB)
        rows = person.window._screen._rows
        assert max(box.bottom for box, _ in rows) <= SIZE[1]
        assert person.window._screen.chosen in [row for _, row in rows]
    assert person.window._screen.chosen == 0


@pytest.mark.promise(26)
def test_losing_the_focus_pauses(person) -> None:
    person.tap(pygame.K_RETURN).until("playing").down(pygame.K_RIGHT).rest(0.2)
    person.post(pygame.WINDOWFOCUSLOST)
    assert (person.view.state, person.view.held) == ("paused", [])
    assert "focus" in person.view.message


def test_closing_the_window_keeps_the_episode_as_interrupted(tmp_path) -> None:
    person = Person(tmp_path / "demos", Corridor(length=100, limit=10_000))
    person.tap(pygame.K_RETURN).until("playing").rest(0.3)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    person.window.run()
    person.recorder.close()
    person.window.close()
    assert [e.ending for e in Demonstrations.load(tmp_path / "demos").episodes] == ["interrupted"]


def test_a_gamepad_acts(tmp_path) -> None:
    person = Person(tmp_path / "demos", Corridor(length=100, limit=10_000))
    person.post(pygame.JOYBUTTONDOWN, button=7).until("playing")
    person.post(pygame.JOYAXISMOTION, axis=0, value=0.9).rest(0.25)
    assert person.view.action == 2
    person.post(pygame.JOYAXISMOTION, axis=0, value=0.0).rest(0.25)
    assert person.view.action == 1
    person.post(pygame.JOYHATMOTION, value=(-1, 0)).rest(0.25)
    assert person.view.action == 0
    person.post(pygame.JOYBUTTONDOWN, button=6)
    assert person.view.state == "paused"
    person.recorder.close()
    person.window.close()


def test_what_a_gamepad_means() -> None:
    pad = Gamepad(["space"])
    assert pad.button(0, down=True) == [KeyDown("space")]
    assert pad.button(0, down=False) == [KeyUp("space")]
    assert pad.button(3, down=True) == []
    assert pad.axis("stick", 0, 0.2) == []
    assert pad.axis("stick", 0, -0.8) == [KeyDown("left")]
    assert pad.axis("stick", 0, -0.9) == []
    assert pad.axis("stick", 0, 0.9) == [KeyUp("left"), KeyDown("right")]
    assert pad.axis("stick", 1, 1.0) == [KeyDown("down")]
    assert pad.axis("hat", 1, 1.0) == [KeyDown("up")]
    assert pad.axis("stick", 4, 1.0) == []
    pad.release()
    assert pad.axis("stick", 0, 0.0) == []


def test_names_of_keys() -> None:
    names = [key_name(pygame.key.name(code)) for code in (
        pygame.K_RETURN, pygame.K_SPACE, pygame.K_LEFT, pygame.K_EQUALS, pygame.K_a, pygame.K_LCTRL,
        pygame.K_KP_PLUS, pygame.K_F8,
    )]  # fmt: skip
    assert names == ["enter", "space", "left", "+", "a", "", "+", "f8"]


def test_evasion_moves_at_thirty_pictures_a_second(tmp_path) -> None:
    env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
    person = Person(tmp_path / "demos", env)
    person.tap(pygame.K_RETURN).until("playing").down(pygame.K_SPACE)
    while person.view.step == 0:  # nothing moves before the first decision
        person.look()
    first = person.window._frame
    person.rest(2.0)
    assert 58 <= person.window._frame - first <= 62
    person.recorder.close()
    person.window.close()


@pytest.mark.slow
def test_real_keys_in_a_real_window(tmp_path) -> None:
    command = [sys.executable, "-m", "eutree", "record", "eutree/Evasion2-v0", "--window"]
    command += ["--episodes", "1", "--fps", "5", "--out", str(tmp_path / "demos")]
    with display() as screen:
        recorder = subprocess.Popen(command, env=screen.environment, stdout=subprocess.DEVNULL)
        try:
            screen.focus_window_of(recorder, 2 * ENOUGH)
            time.sleep(1.0)
            screen.xdotool("key", "Return")
            time.sleep(3.3)
            screen.xdotool("keydown", "space")
            end = time.monotonic() + 2 * ENOUGH
            while not list((tmp_path / "demos").glob("*.npz")):
                assert time.monotonic() < end
                time.sleep(0.1)
            screen.xdotool("keyup", "space")
            time.sleep(1.5)
            screen.xdotool("key", "Escape")
            time.sleep(0.5)
            screen.xdotool("key", "q")
            assert recorder.wait(ENOUGH) == 0
        finally:
            recorder.kill()
            recorder.wait()
    (episode,) = Demonstrations.load(tmp_path / "demos").episodes
    assert episode.ending in ("goal", "collision")
    assert episode.extras["viewer"] == "window"
    assert any(episode.actions == 1)


def test_a_small_desktop_shows_the_whole_window(person) -> None:
    """At 1024 x 600 it was cut off."""
    assert fitting((1920, 1080)) == SIZE
    width, height = fitting((1024, 600))
    assert (width <= 942, height <= 552) == (True, True)
    assert width / height == pytest.approx(SIZE[0] / SIZE[1], rel=0.01)
    shown, desktop = pygame.display.get_surface().get_size(), pygame.display.get_desktop_sizes()[0]
    assert all(part <= whole for part, whole in zip(shown, desktop, strict=True))


def test_a_key_that_changes_its_name_is_released(person) -> None:
    """Shift, or another layout, between down and up: the key let go is the key that was held."""
    person.post(pygame.KEYDOWN, key=pygame.K_1, scancode=30)
    assert person.view.held == ["1"]
    person.post(pygame.KEYUP, key=pygame.K_EXCLAIM, scancode=30)
    assert person.view.held == []


def test_a_layout_without_latin_letters_keeps_its_keys() -> None:
    assert key_name("з", pygame.KSCAN_P) == "p"
    assert key_name("π", pygame.KSCAN_P) == "p"
    assert key_name("z", pygame.KSCAN_Y) == "z"  # a German one: what is typed counts


def test_the_window_says_which_episodes_ended_early(person) -> None:
    person.tap(pygame.K_RETURN).until("playing").rest(0.3).tap(pygame.K_e).until("review")
    assert any("1 of them ended early" in line for line in words(person.view)[1])


def test_the_window_says_the_task_and_what_the_keys_do(tmp_path) -> None:
    env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
    person = Person(tmp_path / "demos", env, countdown=0.6)
    title, lines, _ = words(person.view)
    assert title == "Show how it is done"
    assert lines[0] == env.unwrapped.task_description
    assert lines[1] == "Hold Right or Space: go; no key: stop."
    person.tap(pygame.K_RETURN)
    assert person.view.state == "countdown"
    assert words(person.view)[1][0].startswith("Hold the key while it counts")
    person.recorder.close()
    person.window.close()


def test_no_action_is_named_before_the_first_key(tmp_path) -> None:
    cart = gymnasium.make("CartPole-v1", render_mode="rgb_array")
    person = Person(tmp_path / "demos", cart, countdown=0.4)
    person.tap(pygame.K_RETURN)
    assert (person.view.state, pill(person.view)) == ("countdown", ("", True))
    person.until("playing").rest(0.1)
    assert words(person.view)[0] == "Press a key to begin"
    assert pill(person.view) == ("", True)
    person.down(pygame.K_RIGHT).rest(0.3)
    assert pill(person.view) == ("right", False)
    person.recorder.close()
    person.window.close()


def test_what_to_press_stands_below_a_long_description(person) -> None:
    """Beside it the window says pace and mode: nothing is drawn over anything else."""
    screen, written = person.window._screen, []
    text = screen._text
    screen._text = lambda words, place, **more: (
        written.append((words, place)) or text(words, place, **more)
    )
    person.recorder.session.task = "Push the cart to where it has to be. " * 40
    person.rest(0.1)
    below = [(words, place) for words, place in written if place[1] >= CARD_TOP and place[0] < 700]
    last, (_, top) = below[-1]
    assert last == "Enter: start     Esc: finish"
    assert top + 21 <= SIZE[1]
    assert len({place for _, place in below}) == MOST_LINES + 1


def test_words_never_cover_the_picture(person) -> None:
    """All that a screen adds to the picture is the pill in its corner and the line at its edge."""
    left, top, width, height = STAGE
    surface, screen = person.window._screen._surface, person.window._screen
    middle = (slice(left + 200, left + width - 4), slice(top + 60, top + height - 8))

    def picture():
        bare = surface.copy()
        bare.fill((255, 254, 251), STAGE)
        bare.blit(screen._picture, screen._picture.get_rect(center=pygame.Rect(STAGE).center))
        return pygame.surfarray.array3d(bare)[middle]

    def shown():
        return pygame.surfarray.array3d(surface)[middle]

    assert np.array_equal(shown(), picture())
    for state in ("countdown", "playing"):
        if state == "countdown":
            person.tap(pygame.K_RETURN)
        person.until(state)
        assert np.array_equal(shown(), picture())
    person.tap(pygame.K_p).until("paused")
    assert np.array_equal(shown(), picture())
    person.tap(pygame.K_e).until("review")
    assert np.array_equal(shown(), picture())


def test_a_line_fills_until_the_next_decision(tmp_path) -> None:
    person = Person(tmp_path / "demos", Corridor(length=100, limit=10_000), fps=1.0)
    person.tap(pygame.K_RETURN).until("playing").rest(0.3)
    screen = person.window._screen
    first = screen._beat_width(person.view)
    person.rest(0.3)
    assert 0 < first < screen._beat_width(person.view) <= STAGE[2]
    person.recorder.close()
    person.window.close()
