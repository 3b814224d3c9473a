"""The course of an episode without a session: it says which action is due, and takes none."""

import numpy as np
import pytest

from eutree.interaction.guard import GuardedEnv
from eutree.recording.controls import Controls, Pace
from eutree.recording.episodes import Recording, Trial
from eutree.recording.events import Command, SessionSettings
from eutree.recording.keys import keys_of_environment
from eutree.recording.play import (
    COUNTDOWN,
    PAUSED,
    PLAYING,
    REVIEW,
    REVIEW_SECONDS,
    Pictures,
    Play,
)
from tests.recording.people import Corridor

STAY, RIGHT = 1, 2


@pytest.fixture
def env() -> GuardedEnv:
    return GuardedEnv(Corridor())


@pytest.fixture
def play(env: GuardedEnv) -> Play:
    """Return an episode that is about to be counted in, at ten decisions a second."""
    keys = keys_of_environment(env.env, env.schema)
    play = Play(Controls(keys, Pace(10.0)), Pictures(env), countdown=3.0)
    play.show(Trial(env.reset(0), 0, {"keys": list(keys.keys)}))
    return play


def seen(play: Play, now: float) -> None:
    """Let the viewer draw what is there to be drawn."""
    frame = play.picture(now)
    if frame is not None:
        play.pictures.saw(frame.number, now)


def test_the_first_decision_comes_one_interval_after_the_countdown(play: Play) -> None:
    seen(play, 0.0)
    play.count_in(0.0)
    assert (play.decision(2.9), play.state) == (None, COUNTDOWN)
    assert (play.decision(3.0), play.state) == (None, PLAYING)
    assert play.decision(3.1) == STAY


def test_a_pause_holds_the_interval_and_is_counted_out_in_a_third_of_the_time(play: Play) -> None:
    seen(play, 0.0)
    play.count_in(0.0)
    play.key_down("right", 1, 1.0)
    play.decision(3.0)
    play.pause(3.04)
    assert (play.state, play.controls.held) == (PAUSED, {})
    play.count_down(10.0)
    assert play.decision(11.0) is None
    assert play.decision(11.05) is None  # 0.04 of the 0.1 s were over before the pause
    assert play.decision(11.07) == STAY


def test_in_turns_an_action_waits_for_its_key(play: Play) -> None:
    play.controls.set_mode(Command("turn_based", True))
    seen(play, 0.0)
    play.count_in(0.0)
    assert play.decision(0.0) is None
    assert (play.state, play.decision(60.0)) == (PLAYING, None)
    assert not play.key_down("right", 1, 60.0)  # no command: an action
    assert play.decision(60.0) == RIGHT
    assert play.decision(60.0) is None


def test_who_leaves_holds_no_key(play: Play) -> None:
    seen(play, 0.0)
    play.count_in(0.0)
    play.key_down("right", 1, 1.0)
    play.leave("gone", 2.0)
    assert (play.state, play.message, play.controls.held) == (PAUSED, "gone", {})


def test_a_key_right_after_the_end_is_not_meant_for_the_next(play: Play) -> None:
    play.review(5.0)
    assert play.state == REVIEW
    assert not play.was_reviewed(5.0 + REVIEW_SECONDS - 0.01)
    assert play.was_reviewed(5.0 + REVIEW_SECONDS)


def test_modes_follow_each_other(play: Play) -> None:
    modes = []
    for _ in range(3):
        play.controls.set_mode(Command("mode"))
        modes.append((play.controls.toggle, play.controls.pace.turn_based))
    assert modes == [(True, False), (False, True), (False, False)]


def test_an_episode_that_ended_before_its_first_step_leaves_its_start_to_the_next(env) -> None:
    recording = Recording(env, SessionSettings(first=4))
    recording.stop(recording.begin({}, []), kept=True)
    assert (recording.start, recording.last, recording.episodes) == (4, None, [])
    trial = recording.begin({}, [])
    recording.step(trial, RIGHT, 0.1, {})
    recording.stop(trial, kept=True)
    assert (recording.start, recording.last, recording.n_kept) == (5, 0, 1)
    assert recording.episodes[0].ending == "stopped"


def test_a_start_that_somebody_else_took_is_left_out(env: GuardedEnv) -> None:
    recording = Recording(env, SessionSettings(), free_start=lambda: 7)
    recording.choose_start()
    assert recording.start == 7
    first = recording.begin({}, [])
    assert not np.isnan(first.observation).any()
    recording.mark(3, kept=False)  # no such episode
    recording.stop(first, kept=False, comment="on fire", ending="fault")
    kinds = [type(output).__name__ for output in recording.take_outputs()]
    assert kinds == ["EpisodeStarted", "EpisodeAbandoned"]
    assert recording.take_outputs() == []
