"""The recording engine under a scripted person and a clock of the test's own."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.classic_control import AcrobotEnv, CartPoleEnv
from hypothesis import given
from hypothesis import strategies as st

import eutree  # noqa: F401 - registers the environments
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.interaction.episode import Stream, episode_seed
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.spaces import describe
from eutree.recording.controls import MOST_TURNS, SPEEDS, takes_turns
from eutree.recording.events import (
    Away,
    Command,
    EpisodeAbandoned,
    EpisodeChanged,
    EpisodeEnded,
    EpisodeStarted,
    KeyDown,
    KeyUp,
    Seen,
    StepTaken,
)
from eutree.recording.keys import keys_of_environment, parse_keys
from eutree.recording.session import Session
from eutree.recording.views import episode_views, task_description
from tests.interaction.versions import CLIFF, TAXI
from tests.recording.broken import Broken
from tests.recording.people import TICK, Corridor, Person


def kinds(outputs):
    return [type(output) for output in outputs]


def test_an_episode_from_opening_to_review() -> None:
    person = Person()
    assert person.view.state == "opening"
    assert [(a.name, a.keys, a.is_idle) for a in person.view.actions] == [
        ("left", ["left"], False),
        ("stay", ["left+right"], True),
        ("right", ["right"], False),
    ]
    person.tap("enter")
    assert (person.view.state, person.view.countdown) == ("countdown", 3)
    person.wait(1.5)
    assert person.view.countdown == 2
    person.until("playing").press("right").until("review")
    episode = person.session.episodes[0]
    assert episode.terminated
    assert episode.is_success
    assert episode.kept
    assert set(episode.actions) == {2} or episode.actions[0] == 1  # the first came before the key
    assert episode.observations[-1][0] == 5
    assert (person.view.saved, person.view.target) == (1, 3)
    assert kinds(person.outputs) == [EpisodeStarted, *[StepTaken] * len(episode), EpisodeEnded]


def test_decisions_come_at_the_pace_of_the_environment() -> None:
    person = Person().walk()
    gaps = np.diff(person.session.episodes[0].steps["time"])
    assert gaps == pytest.approx(np.full(len(gaps), 0.1), abs=TICK)


def test_the_first_decision_comes_one_interval_after_the_countdown() -> None:
    """Who reacted to what they saw showed the idle action at the start of every episode."""
    person = Person()
    person.tap("enter").until("playing").wait(0.04)
    began = person.now - 0.04
    assert person.view.step == 0
    person.press("right").wait(0.05)
    assert person.view.coming == 2  # the key is seen to count, before it is taken
    person.until("review")
    episode = person.session.episodes[0]
    assert episode.steps["time"][0] - began == pytest.approx(0.1, abs=2 * TICK)
    assert set(episode.actions) == {2}


def test_a_key_held_while_it_counts_is_the_first_decision() -> None:
    person = Person()
    person.tap("enter").press("left").until("playing").wait(0.15).do("end")
    assert person.session.episodes[0].actions.tolist() == [0]


class Falling(Corridor):
    """Has no idle action: standing still is not among its choices."""

    action_names = ("left", "stand", "right")

    def get_keys_to_action(self):
        return {(276,): 0, (274,): 1, (275,): 2}


@pytest.mark.parametrize("toggle", [False, True])
def test_without_an_idle_action_the_first_key_begins(toggle: bool) -> None:
    """CartPole at full speed was over in 0.2 s, untouched."""
    person = Person(Falling()).do("toggle", toggle)
    person.tap("enter").until("playing").wait(30.0)
    assert (person.view.state, person.view.step, person.view.awaits_key) == ("playing", 0, True)
    person.press("right").wait(0.35)
    assert not person.view.awaits_key
    person.do("end")
    assert set(person.session.episodes[0].actions) == {2}


def test_a_quick_task_is_offered_slowly_first() -> None:
    quick = Corridor()
    quick.metadata = {**quick.metadata, "render_fps": 50}
    view = Person(quick).view
    assert (view.speed, view.is_slowed) == (0.25, True)
    assert Person(quick, fps=50.0).view.speed == 1.0  # a pace that somebody chose
    assert Person().view.speed == 1.0


def test_the_view_says_how_much_of_the_interval_is_over() -> None:
    person = Person(fps=1.0)
    person.tap("enter").until("playing").wait(0.5).tap("p")
    person.tap("p").until("playing")
    assert person.view.beat == pytest.approx(0.5, abs=2 * TICK)
    person.wait(0.6)
    assert (person.view.step, person.view.beat) == (1, 0.0)


@pytest.mark.parametrize("speed", SPEEDS)
def test_speed_changes_the_pace_and_nothing_else(speed: float) -> None:
    person = Person().do("speed", speed).walk()
    episode = person.session.episodes[0]
    gaps = np.diff(episode.steps["time"])
    assert gaps == pytest.approx(np.full(len(gaps), 0.1 / speed), abs=TICK + 1e-9)
    assert set(episode.steps["speed"]) == {speed}


def test_keys_change_the_speed() -> None:
    person = Person()
    for key, speed in [("+", 1.5), ("+", 2.0), ("+", 2.0), ("-", 1.5), ("-", 1.0), ("-", 0.75)]:
        assert person.tap(key).view.speed == speed


def test_the_picture_of_a_step_precedes_its_action() -> None:
    """Each step's picture shows its observation and was given out before its action was read."""
    person = Person().walk()
    episode = person.session.episodes[0]
    frames = {frame.number: (when, frame.pixels) for when, frame in person.frames}
    for step in range(len(episode)):
        when, pixels = frames[int(episode.steps["picture"][step])]
        assert when < episode.steps["time"][step]
        assert pixels[0, 0, 0] == int(episode.observations[step, 0] * 10)


def test_the_picture_of_a_step_precedes_its_action_where_pictures_move() -> None:
    env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
    moving = env.unwrapped
    moving.render = lambda: np.full((2, 2, 3), 7, np.uint8)
    shares = []
    moving.render_between = lambda share: shares.append(share) or np.zeros((2, 2, 3), np.uint8)
    person = Person(env).do("speed", 2.0)
    person.tap("enter").until("playing").press("space").until("review")
    episode = person.session.episodes[0]
    full = {f.number: when for when, f in person.frames if f.pixels[0, 0, 0] == 7}
    for step in range(len(episode)):
        assert full[int(episode.steps["picture"][step])] < episode.steps["time"][step]
    assert len(shares) > 10 * len(episode)  # about 30 pictures a second
    assert all(0 < share < 1 for share in shares)
    assert np.diff(episode.steps["time"]) == pytest.approx(0.5, abs=TICK)


def test_a_late_viewer_is_recorded_as_late() -> None:
    """What the person saw is what the viewer last drew, not what was last sent."""
    person = Person().do("speed", 0.25)
    person.tap("enter").until("playing").wait(TICK)
    seen = person.frame
    person.sees = False
    person.wait(1.0)
    assert person.view.step >= 2
    person.do("end")
    episode = person.session.episodes[0]
    assert set(episode.steps["frame"][1:]) == {seen}
    assert list(episode.steps["picture"][1:]) > list(episode.steps["frame"][1:])


def test_a_key_is_stored_with_what_was_on_screen_when_it_went_down() -> None:
    person = Person()
    person.tap("enter").until("playing").wait(0.25)
    frame, when = person.frame, person.now
    person.tick(KeyDown("right", frame))
    person.wait(0.3).do("end")
    episode = person.session.episodes[0]
    assert ["right", True, when, frame] in episode.extras["edges"]
    first = int(np.argmax(episode.actions == 2))
    assert episode.steps["edge_frame"][first] == frame
    assert episode.steps["edge_time"][first] == when
    delay = episode.steps["time"][first] - when
    assert 0 <= delay <= 0.1 + TICK
    assert episode.extras["keys"] == ["left", "right"]
    assert episode.steps["keys"][first].tolist() == [False, True]


def test_a_picture_that_was_never_given_out_is_not_stored_as_seen() -> None:
    person = Person()
    person.tap("enter").until("playing").tick(KeyDown("right", 10**30))
    person.wait(0.3).do("end")
    episode = person.session.episodes[0]
    assert np.all(episode.steps["edge_frame"][1:] <= episode.steps["picture"][1:])


def test_half_an_episode_is_not_dropped() -> None:
    person = Person().walk().do("drop", 0.5)
    assert [row.kept for row in person.view.episodes] == [True]


def test_both_keys_mean_their_combination() -> None:
    person = Person()
    person.tap("enter").until("playing").press("left").press("right").wait(0.35)
    assert person.view.action == 1
    person.release("left").wait(0.15)
    assert person.view.action == 2


def test_toggle_mode_switches_on_and_off() -> None:
    person = Person().do("toggle", True)
    person.tap("enter").until("playing").tap("right").wait(0.15)
    assert person.view.action == 2
    person.tap("right").wait(0.15)
    assert person.view.action == 1
    person.tap("left").wait(0.15).tap("right").wait(0.15)
    assert person.view.action == 2


def test_a_key_goes_through_the_modes() -> None:
    person = Person()
    modes = [(v.toggle, v.turn_based) for v in (person.tap("m").view for _ in range(3))]
    assert modes == [(True, False), (False, True), (False, False)]
    person.tap("enter").until("playing").tap("m")
    assert not person.view.toggle  # not in the middle


def test_turn_based_mode_waits_for_each_key() -> None:
    person = Person().do("turn_based", True)
    person.tap("enter").until("playing").wait(5.0)
    assert person.view.step == 0
    person.tap("right").wait(1.0).tap("right").wait(1.0)
    assert person.view.step == 2
    person.tap(person.view.controls["wait"]).wait(1.0).do("end")
    assert person.session.episodes[0].actions.tolist() == [2, 2, 1]
    assert person.session.episodes[0].extras["turn_based"] is True


class Grid(Corridor):
    """Observes one of six squares."""

    observation_space = gymnasium.spaces.Tuple([gymnasium.spaces.Discrete(100)] * 2)

    def _observation(self):
        return int(self.place), self.steps


class Bare(Grid):
    """All of its actions move."""

    action_names = ("left", "jump", "right")

    def get_keys_to_action(self):
        return {("left",): 0, ("space",): 1, ("right",): 2}


@pytest.mark.parametrize(
    ("env", "fps", "turns"),
    [(Bare(), None, True), (Bare(), 4.0, False), (Grid(), None, False), (Corridor(), None, False)],
)
def test_a_grid_world_starts_with_one_step_a_key(env, fps, turns) -> None:
    """Where one can wait, or asks for a pace, time passes."""
    assert Person(env, fps=fps).view.turn_based is turns


@pytest.mark.parametrize("name", ["FrozenLake-v1", CLIFF, TAXI])
def test_toy_tasks_of_gymnasium_take_turns(name: str) -> None:
    env = GuardedEnv(gymnasium.make(name, render_mode="ansi").unwrapped)
    assert takes_turns(env, keys_of_environment(env.env, env.schema))


def test_a_turn_before_the_picture_is_not_taken() -> None:
    env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
    person = Person(env).do("turn_based", True)
    person.tap("enter").until("playing").wait(0.1)
    person.tap("space").tap("space").tap("space").wait(1.0)
    assert person.view.step == 1


def in_turns(**fields):
    """Return somebody on a grid, quicker than its pace, with the keys that they pressed."""
    person = Person(Bare(**{"length": 90, "limit": 90} | fields))
    return person.tap("enter").until("playing")


def test_each_of_many_quick_presses_is_one_step() -> None:
    """Ten presses, 90 ms apart, were six steps."""
    person, pressed = in_turns(), ["right", "space", "left", "right", "right"] * 2
    for key in pressed:
        person.press(key).wait(2 * TICK).release(key).wait(TICK)
    person.wait(1.0).do("end")
    (episode,) = person.session.episodes
    keys = {"left": 0, "space": 1, "right": 2}
    assert episode.actions.tolist() == [keys[key] for key in pressed]
    assert np.all(np.diff(episode.steps["time"]) > 0.1 - TICK)
    assert np.all(np.diff(episode.steps["picture"]) == 1)  # each one from a picture of its own


def test_a_held_key_is_one_step_and_only_so_many_wait() -> None:
    person = in_turns()
    for _ in range(30):
        person.press("right")  # the keyboard repeats it
    assert person.wait(1.0).view.step == 1
    person.release("right")
    for _ in range(30):
        person.tap("right")
    assert person.wait(3.0).view.step == 2 + MOST_TURNS


@pytest.mark.parametrize("how", ["pause", "away", "end"])
def test_presses_that_wait_are_dropped_where_the_episode_is_left(how: str) -> None:
    person = in_turns()
    for _ in range(4):
        person.tap("right")
    if how == "away":
        person.tick(Away("gone"))
    else:
        person.do(how)
    assert person.wait(1.0).view.step == 1
    assert person.tap("enter").until("playing").wait(1.0).view.step == (0 if how == "end" else 1)


def test_presses_after_the_end_are_not_of_the_next_episode() -> None:
    person = in_turns(limit=2)
    for _ in range(5):
        person.tap("right")
    person.until("review").wait(1.0).tap("enter").until("playing").wait(1.0)
    assert (person.view.step, len(person.session.episodes[0])) == (0, 2)


def test_a_person_who_stops_does_not_truncate() -> None:
    person = Person()
    person.tap("enter").until("playing").wait(0.5).tap("e")
    episode = person.session.episodes[0]
    assert person.view.state == "review"
    assert (episode.ending, episode.terminated, episode.truncated) == ("stopped", False, False)
    assert episode.is_success is None
    assert episode.kept


def test_who_ends_an_episode_that_has_just_ended_begins_no_other() -> None:
    """The key was taken for one more episode, in which nobody acted, and which was kept."""
    person = Person(Corridor(limit=4))
    person.tap("enter").until("playing").press("left").until("review").tap("e").wait(0.3)
    assert person.view.state == "review"
    assert person.wait(1.0).tap("e").view.state != "review"


def test_a_time_limit_truncates() -> None:
    person = Person(Corridor(limit=4)).walk("left")
    episode = person.session.episodes[0]
    assert (episode.ending, episode.terminated, episode.truncated) == ("truncated", False, True)


def test_pause_keeps_the_moment() -> None:
    person = Person()
    person.tap("enter").until("playing").press("right").wait(0.25).tap("p")
    step = person.view.step
    assert person.view.state == "paused"
    assert person.view.held == []
    person.wait(10.0)
    assert person.view.step == step
    person.tap("p").until("playing").wait(0.3)
    assert person.view.step > step
    assert person.view.action == 1  # the key that was held counts as released


@pytest.mark.promise(26)
@pytest.mark.parametrize("when", ["countdown", "playing"])
def test_losing_the_viewer_releases_all_keys_and_pauses(when: str) -> None:
    person = Person()
    person.tap("enter")
    if when == "playing":
        person.until("playing").press("right").wait(0.15)
    person.tick(Away("gone"))
    assert (person.view.state, person.view.held, person.view.message) == ("paused", [], "gone")
    if when == "playing":
        assert person.view.action == 2
        person.tap("enter").until("playing").wait(0.15)
        assert person.view.action == 1


@pytest.mark.promise(26)
def test_a_viewer_that_draws_nothing_pauses_the_episode() -> None:
    person = Person(Corridor(length=20, limit=100))
    person.tap("enter").until("playing").press("right").wait(0.12)
    person.sees = False
    person.wait(2.0)
    assert person.view.state == "paused"
    assert "answer" in person.view.message


def test_an_end_is_spoken_of_when_it_has_been_seen() -> None:
    """Counter and list once said "collision" while the picture still moved towards it."""
    person = Person()
    person.tap("enter").until("playing").press("right")
    person.wait(0.05)
    while not person.session.play.trial.is_over:
        person.wait(TICK)
    person.sees = False  # the last picture is on its way, and takes half a second
    for _ in range(30):
        person.wait(TICK)
        assert (person.view.state, person.view.saved, person.view.episodes) == ("playing", 0, [])
    person.sees = True
    person.wait(0.3)
    assert (person.view.state, person.view.saved) == ("review", 1)
    assert [row.result for row in person.view.episodes] == ["terminated"]


def test_a_viewer_that_never_shows_the_end_keeps_nobody_waiting() -> None:
    person = Person()
    person.tap("enter").until("playing").press("right")
    while not person.session.play.trial.is_over:
        person.wait(TICK)
    person.sees = False
    person.until("review", limit=2.0)


def test_who_leaves_while_a_tree_is_made_is_asked() -> None:
    person = Person(target=1, makes=True)
    person.walk().session.wishes.is_busy = True
    assert person.tap("escape").view.leaving
    assert person.view.state == "review"
    assert not person.tap("enter").view.leaving  # which means: wait for it
    assert person.view.state == "review"
    person.tap("escape").do("stay")
    assert not person.view.leaving
    person.tap("escape").session.wishes.is_busy = False  # it is ready meanwhile
    assert not person.wait(TICK).view.leaving
    person.session.wishes.is_busy = True
    assert person.tap("escape").tap("escape").view.state == "finished"


def test_redo_gives_the_same_start_and_keeps_the_old_one_marked() -> None:
    person = Person().walk()
    person.tap("r").until("playing").press("right").until("review")
    old, new = person.session.episodes
    assert (old.kept, old.comment, new.kept) == (False, "redone", True)
    assert old.seed == new.seed
    assert person.view.saved == 1
    changed = [output for output in person.outputs if isinstance(output, EpisodeChanged)]
    assert [(c.index, c.episode.kept) for c in changed] == [(0, False)]


def test_redo_in_the_middle() -> None:
    person = Person()
    person.tap("enter").until("playing").wait(0.3).tap("r")
    assert person.view.state == "countdown"
    person.until("playing").press("right").until("review")
    old, new = person.session.episodes
    assert (old.ending, old.kept, old.comment) == ("stopped", False, "redone")
    assert old.seed == new.seed


def test_discard_goes_on_with_another_start() -> None:
    person = Person()
    person.tap("enter").until("playing").wait(0.3).tap("delete")
    assert person.view.state == "review"
    person.wait(1.0).walk()
    old, new = person.session.episodes
    assert (old.kept, old.comment, new.kept) == (False, "discarded", True)
    assert old.seed == episode_seed(0, 0, Stream.PERSON)
    assert new.seed == episode_seed(0, 1, Stream.PERSON)


def test_discard_and_keep_in_the_list() -> None:
    person = Person().walk().walk()
    person.do("drop", 0.0)
    assert [row.kept for row in person.view.episodes] == [False, True]
    person.do("keep", 0.0).do("keep", 5.0).do("drop", -1.0)
    assert [row.kept for row in person.view.episodes] == [True, True]


def test_an_episode_without_a_step_is_not_stored() -> None:
    person = Person()
    person.tap("enter").wait(1.0).tap("p").tap("e")
    assert person.view.state == "review"
    assert person.session.episodes == []
    assert kinds(person.outputs) == [EpisodeStarted, EpisodeAbandoned]


def test_the_action_taken_is_shown_where_the_wished_one_is_masked() -> None:
    class Walled(Corridor):
        def action_masks(self) -> np.ndarray:
            return np.array([True, True, self.place < 3])

    person = Person(Walled())
    person.tap("enter").until("playing").press("right").until("playing").wait(1.2)
    assert person.session.play.trial.observation[0] < 4
    walked = [output.action for output in person.outputs if isinstance(output, StepTaken)]
    assert set(walked[-3:]) == {0, 2}  # to the wall, and back, as left is the first allowed one
    for _ in range(4):
        step = person.view.step
        while person.view.step == step:
            person.wait(1 / 60)
        taken = [output.action for output in person.outputs if isinstance(output, StepTaken)][-1]
        assert person.view.action == taken
        assert person.view.coming == (2 if person.session.play.trial.observation[0] < 3 else 0)


def test_without_an_idle_action_the_one_taken_goes_on_not_the_one_masked() -> None:
    class Walled(Corridor):
        def action_masks(self) -> np.ndarray:
            return np.array([True, True, self.place != 1])

    keys = parse_keys("left=0,right=2", describe(Walled()))
    keys = replace(keys, idle=None)
    person = Person(session=Session(GuardedEnv(Walled()), keys=keys))
    person.session.recording.start = next(
        k for k in range(20) if GuardedEnv(Corridor()).reset(episode_seed(0, k, Stream.PERSON))[0]
    )
    person.tap("enter").until("playing").press("right").wait(0.05).release("right").wait(0.3)
    taken = [output.action for output in person.outputs if isinstance(output, StepTaken)]
    assert len(taken) > 2
    assert set(taken) == {0}


def test_target_reached_and_finished() -> None:
    person = Person(target=2).walk().walk()
    assert (person.view.saved, person.view.state) == (2, "review")
    person.tap("enter")
    assert person.view.state == "finished"
    assert person.session.is_over


def test_one_more_than_the_target() -> None:
    person = Person(target=1).walk().do("end")
    person.until("playing").press("right").until("review")
    assert (person.view.saved, person.view.target) == (2, 1)


def test_escape_leads_to_the_end_step_by_step() -> None:
    person = Person()
    person.tap("enter").until("playing").wait(0.3)
    states = [person.tap("escape").wait(1.0).view.state for _ in range(3)]
    assert states == ["paused", "review", "finished"]
    assert person.session.episodes[0].ending == "stopped"


def test_who_leaves_has_not_shown_an_episode() -> None:
    """Esc twice in the first second was 1 of 15 saved."""
    person = Person(Corridor(length=1000, limit=1000))
    person.tap("enter").until("playing").wait(0.35).tap("escape").tap("escape")
    [episode] = person.session.episodes
    assert (episode.kept, episode.comment, person.view.saved) == (False, "left early", 0)
    assert person.do("keep", 0).view.saved == 1


def test_a_key_of_the_episode_does_not_skip_the_review() -> None:
    env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
    person = Person(env).do("speed", 2.0)
    person.tap("enter").until("playing").press("space").until("review").release("space")
    assert person.tap("space").view.state == "review"
    assert person.wait(1.0).tap("space").view.state == "countdown"


def test_control_keys_give_way_to_action_keys() -> None:
    controls = Person().view.controls
    assert controls["redo"] == "r"  # left is an action
    assert controls["end"] == "e"  # right is one too
    assert not set(controls.values()) & {"left", "right"}


@pytest.mark.parametrize("arrows", [None, "a=left,d=right,none=stay"])
def test_no_arrow_key_ends_or_changes_an_episode(arrows) -> None:
    """Left redid the episode and Right ended it: a reflex was enough."""
    env = Corridor()
    keys = None if arrows is None else parse_keys(arrows, describe(env))
    controls = Session(GuardedEnv(env), keys=keys).tick(0.0).view.controls
    harmful = {controls[name] for name in ("end", "redo", "discard", "finish")}
    assert not harmful & {"left", "right", "up", "down"}


class Described(gymnasium.Env):
    """An environment with the docstring of another."""

    def __init__(self, text) -> None:
        type(self).__doc__ = text


def test_gymnasium_s_own_tasks_are_told_in_plain_words() -> None:
    """Also those that need a package, and those whose actions need a grid."""
    entries = [str(spec.entry_point).split(":") for spec in gymnasium.registry.values()]
    kinds_of_tasks = ("classic_control", "toy_text", "box2d")
    names = {entry[1] for entry in entries if set(kinds_of_tasks) & set(entry[0].split("."))}
    assert len(names) > 9
    for name in names - {"CarRacing"}:  # which observes a picture, and is refused
        told = task_description(type(name, (gymnasium.Env,), {})())
        assert told.endswith("."), name
        assert len(told) < 140
        assert not set("`[*") & set(told)


def ended(name, rewards, *, terminated):
    """Return what the list of episodes says of an episode of a task of Gymnasium."""
    env = gymnasium.make(name)
    width = GuardedEnv(env).schema.n_features
    length = len(rewards)
    episode = Episode(
        np.zeros((length + 1, width)), np.zeros(length, np.int64), rewards, terminated,
        not terminated, ending="terminated" if terminated else "truncated",
    )  # fmt: skip
    view = episode_views([0], [episode], env)[0]
    return view.result, view.success


@pytest.mark.parametrize(
    ("name", "rewards", "terminated", "told"),
    [
        ("FrozenLake-v1", [0.0, 1.0], True, ("goal", True)),
        ("FrozenLake-v1", [0.0, 0.0], True, ("fell into a hole", False)),
        ("FrozenLake-v1", [0.0, 0.0], False, ("truncated", False)),
        (CLIFF, [-100.0, -1.0], True, ("goal", True)),
        (TAXI, [-10.0, 20.0], True, ("delivered", True)),
        (TAXI, [-1.0], False, ("truncated", False)),
        ("Blackjack-v1", [1.0], True, ("won", True)),
        ("Blackjack-v1", [0.0], True, ("not won", False)),
        ("CartPole-v1", [1.0, 1.0], True, ("fell or left the track", False)),
        ("CartPole-v1", [1.0, 1.0], False, ("kept upright to the end", True)),
        ("MountainCar-v0", [-1.0], True, ("goal", True)),
        ("eutree/Evasion2-v0", [-1.0], True, ("terminated", None)),  # says so itself
    ],
)
def test_success_is_told_where_the_return_tells_it(name, rewards, terminated, told) -> None:
    assert ended(name, rewards, terminated=terminated) == told


def test_an_episode_that_the_person_ended_is_no_failure() -> None:
    env = gymnasium.make("FrozenLake-v1")
    stopped = Episode(np.zeros((2, 1)), [0], [0.0], False, False, ending="stopped")
    view = episode_views([0], [stopped], env)[0]
    assert (view.result, view.success) == ("stopped", None)


def test_a_task_without_an_end_says_so_before_the_first_episode() -> None:
    for name, arguments, endless in (
        (CLIFF, {}, True),
        (CLIFF, {"max_episode_steps": 200}, False),
        ("FrozenLake-v1", {}, False),
        ("Blackjack-v1", {}, False),  # has no limit, and needs none
    ):
        env = gymnasium.make(name, render_mode="rgb_array", **arguments)
        task = Session(GuardedEnv(env)).tick(0.0).view.task
        assert ("names no time limit" in task) == endless, name


def test_the_task_is_told_in_the_environment_s_own_words() -> None:
    env = Corridor()
    env.task_description = "Walk to the  end."
    assert Person(env).view.task == "Walk to the end."
    assert Person().view.task == ""
    cart = Described(CartPoleEnv.__doc__)
    told = task_description(cart)
    assert told.startswith("A pole is attached by an un-actuated joint to a cart")
    assert "the goal is to balance the pole" in told  # who is to show it has to know
    assert told.endswith(".")
    assert len(told) <= 420
    acrobot = Described(AcrobotEnv.__doc__)
    assert "swing the free end" in task_description(acrobot)
    assert "[" not in task_description(acrobot)
    evasion = gymnasium.make("eutree/Evasion2-v0", opponent_speed=2.0)
    assert "None of the 2 red discs may touch its ring" in task_description(evasion)


def test_a_tree_is_wished_for_when_enough_is_recorded() -> None:
    person = Person(target=1, makes=True).walk()
    assert person.session.wishes.take() == ""
    person.tap("enter")
    assert (person.view.state, person.session.wishes.take()) == ("review", "make")
    assert person.tap("enter").session.wishes.take() == ""  # once, and Enter does not end it
    person.do("practise")
    assert person.session.wishes.take() == "practise"
    assert person.tap("escape").view.state == "finished"


def test_without_an_episode_there_is_no_tree_to_wish_for() -> None:
    assert Person(makes=True).do("make").session.wishes.take() == ""


def test_keys_can_be_chosen_before_the_start() -> None:
    person = Person().do("bind", 2.0, "l").do("bind", 0.0, "no such key")
    assert person.view.actions[2].keys == ["l"]
    assert "no such key" in person.view.message
    person.walk("l")
    assert person.session.episodes[0].terminated


def test_numbers_are_hidden_unless_asked_for() -> None:
    assert Person().view.numbers is None
    person = Person(hud=True)
    person.tap("enter").until("playing").wait(0.3)
    assert person.view.numbers[0][0] == "place"
    assert person.view.numbers[0][1].endswith(" m")


def test_a_fault_of_the_environment_ends_in_a_clear_screen() -> None:
    person = Person(Broken())
    person.tap("enter").until("failed")
    assert "step 3: step raised KeyError: 'motor'" in person.view.message
    episode = person.session.episodes[0]
    assert (len(episode), episode.ending, episode.kept) == (3, "fault", False)
    assert kinds(person.outputs)[-1] is EpisodeEnded


@pytest.mark.parametrize(("where", "reason"), [("reset", "no device"), ("render", "an image")])
def test_a_fault_before_the_start(where: str, reason: str) -> None:
    person = Person(Broken(where))
    assert person.view.state == "failed"
    assert reason in person.view.message
    assert person.outputs == []


def test_an_environment_without_pictures_is_refused() -> None:
    env = gymnasium.make("eutree/Evasion2-v0")
    with pytest.raises(InvalidArgumentError, match="render_mode='rgb_array'"):
        Session(GuardedEnv(env))


KEYS = ("left", "right", "enter", "space", "p", "e", "r", "delete", "+", "-", "q")
events = st.one_of(
    st.builds(KeyDown, st.sampled_from(KEYS), st.integers(-1, 500)),
    st.builds(KeyUp, st.sampled_from(KEYS), st.integers(-1, 500)),
    st.builds(Seen, st.integers(-1, 500)),
    st.builds(Away, st.just("gone")),
    st.builds(
        Command,
        st.sampled_from([c for c in Session.COMMANDS if c != "finish"]),
        st.sampled_from([None, 0.0, 1.0, 0.5, 7.0]),
        st.sampled_from(KEYS),
    ),
)


@given(st.lists(st.tuples(st.floats(0.0, 0.4), st.lists(events, max_size=3)), max_size=120))
def test_whatever_happens_the_record_is_whole(script) -> None:
    """Outputs alone rebuild the episodes; the environment replays them; nothing is lost."""
    person = Person(Corridor(limit=6), countdown=0.1)
    pressed: set[str] = set()  # since the pause began: all that may be held in it
    for seconds, what in script:
        person.now += seconds
        if person.view.state != "paused":
            pressed.clear()
        pressed |= {event.key for event in what if isinstance(event, KeyDown)}
        tick = person.tick(*what)
        assert tick.view.held == list(dict.fromkeys(tick.view.held))
        if tick.view.state == "paused" and tick.view.step:
            assert set(tick.view.held) <= pressed
    rebuilt, rows, running = {}, [], None
    for output in person.outputs:
        if isinstance(output, EpisodeStarted):
            assert running is None
            running, rows = output, []
        elif isinstance(output, StepTaken):
            rows.append(output)
        elif isinstance(output, EpisodeChanged):
            rebuilt[output.index] = output.episode
        elif isinstance(output, EpisodeEnded):
            assert output.episode.actions.tolist() == [row.action for row in rows]
            assert output.episode.observations[0].tolist() == running.observation.tolist()
            rebuilt[output.index], running = output.episode, None
        else:
            assert rows == []
            running = None
    assert list(rebuilt.values()) == person.session.episodes
    env = Corridor(limit=6)
    for episode in person.session.episodes:
        assert not (episode.terminated and episode.truncated)
        seen = [env.reset(seed=episode.seed)[0]]
        seen += [env.step(action)[0] for action in episode.actions]
        assert np.array_equal(seen, episode.observations)
        assert np.all(np.diff(episode.steps["time"]) >= 0)
        assert np.all(episode.steps["frame"] <= episode.steps["picture"])


class Late(Person):
    """Somebody whose machine is busy: each tick comes a little later than it should."""

    def play(self, seconds):
        jitter = np.random.default_rng(0)
        end = self.now + seconds
        while self.now < end:
            due = self.session.due(self.now)
            self.now = max(due, self.now + 0.001) + jitter.exponential(0.004)
            self.tick(self._next_seen)


def test_a_busy_machine_loses_no_decisions() -> None:
    """Thirty decisions a second stay thirty when each comes four milliseconds late on average."""
    person = Late(Corridor(length=10**6, limit=10**6), fps=30.0)
    person.tap("enter").until("playing").press("left")
    before = person.view.step
    person.play(20.0)
    assert person.view.step - before == pytest.approx(600, abs=3)


def test_a_busy_machine_shows_thirty_pictures_a_second() -> None:
    """In Evasion, which moves between its decisions."""
    env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
    person = Late(env)
    person.tap("enter").until("playing").wait(1.1)  # nothing moves before the first decision
    before = len(person.frames)
    person.play(10.0)
    assert len(person.frames) - before >= 290
