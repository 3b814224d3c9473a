"""A learner asks in a window: with posted events, and the real command under Xvfb."""

import subprocess
import sys
import time

import pygame
import pytest

from eutree.interaction.requests import DECLINED, HANDED_BACK
from eutree.interaction.settings import SessionSettings
from eutree.interaction.window_asking import AskInWindow
from tests.interaction.asking import Asked
from tests.interaction.xvfb import display

ENOUGH = 60.0


class Hands:
    """Presses a key at each of the given times; the window asks it whether to stop."""

    def __init__(self, *presses):
        self.began, self.presses = time.monotonic(), list(presses)

    def __call__(self):
        while self.presses and time.monotonic() - self.began > self.presses[0][0]:
            _, kind, key = self.presses.pop(0)
            pygame.event.post(pygame.event.Event(kind, **({"key": key} if key else {})))
        return False


def test_a_person_shows_a_stretch(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    asked = Asked()
    hands = Hands((0.3, pygame.KEYDOWN, pygame.K_RETURN), (0.4, pygame.KEYDOWN, pygame.K_RIGHT))
    window = AskInWindow(asked.env.env, settings=SessionSettings(countdown=0.5), stop=hands)
    assert window.show(asked.request, asked.stretch) == HANDED_BACK
    assert asked.actions == [2, 2, 2]


@pytest.mark.parametrize(
    "event", [(0.3, pygame.KEYDOWN, pygame.K_ESCAPE), (0.3, pygame.QUIT, None)]
)
def test_escape_and_the_close_button_decline(monkeypatch, event):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    asked = Asked()
    window = AskInWindow(asked.env.env, stop=Hands(event))
    assert window.show(asked.request, asked.stretch) == DECLINED
    assert asked.actions == []


@pytest.mark.slow
def test_the_command_asks_in_a_real_window(tmp_path):
    """Two requests under Xvfb: the first is answered with Enter and Space, the second declined."""
    command = [
        *(sys.executable, "-m", "eutree", "learn", "eutree/Evasion2-v0", "--preset", "paper"),
        *("--ask-after", "0", "--episodes", "2", "--evaluation-episodes", "2", "--ask", "window"),
        *("--ask-requests", "2", "--ask-steps", "2", "--out", str(tmp_path / "run")),
    ]
    with display() as screen:
        learner = subprocess.Popen(command, env=screen.environment, stdout=subprocess.DEVNULL)
        try:
            window = screen.focus_window_of(learner, ENOUGH)
            time.sleep(1.0)
            screen.xdotool("key", "Return")
            time.sleep(0.5)
            screen.xdotool("keydown", "space")
            screen.wait_for_end_of(window, ENOUGH)  # two steps of a second each
            screen.xdotool("keyup", "space")
            screen.focus_window_of(learner, ENOUGH)
            time.sleep(1.0)
            screen.xdotool("key", "Escape")
            assert learner.wait(ENOUGH) == 0
        finally:
            learner.kill()
            learner.wait()
    answers = (tmp_path / "run" / "answers.jsonl").read_text().splitlines()
    assert [line for line in answers if '"action":1' in line] == answers[:2]
    assert "declined" in answers[2]
