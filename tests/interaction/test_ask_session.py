"""A person is asked for a stretch: the engine, on the test's own clock."""

import pytest

from eutree.interaction.ask_session import GRACE_SECONDS, Desk
from eutree.interaction.events import Away, Present
from eutree.interaction.play import ASKED, WAITING
from eutree.interaction.settings import SessionSettings
from tests.interaction.asking import Asked
from tests.interaction.people import Person


def desk_of(asked, **options):
    settings = SessionSettings(countdown=1.0)
    return Desk(asked.env.env, settings=settings, **options)


@pytest.fixture
def asked():
    return Asked()


@pytest.fixture
def person(asked):
    desk = desk_of(asked, patience=30.0)
    person = Person(session=desk.session, tick=desk.tick)
    person.desk = desk
    return person


def ask(person, asked):
    person.desk.put(asked.request, asked.stretch)
    return person.wait(0.1)


def test_nothing_is_shown_or_done_before_a_request(person, asked):
    person.wait(1.0).tap("enter").tap("escape").wait(1.0)
    assert person.view.state == WAITING
    assert person.frames == []
    assert not person.desk.is_open


def test_a_stretch_from_request_to_its_end(person, asked):
    ask(person, asked)
    assert person.view.state == ASKED
    assert person.view.message == f"{asked.request.reason} It would take right."
    assert (person.view.saved, person.view.target) == (2, 7)
    assert person.view.countdown == 30
    assert len(person.frames) == 1  # the situation, not a fresh start
    person.wait(2.0)
    assert person.view.countdown == 28
    assert asked.actions == []
    person.tap("enter").press("right").until("playing").until(WAITING)
    assert asked.actions == [2, 2, 2]
    assert asked.stretch.is_over
    assert not person.desk.is_open
    n_frames = len(person.frames)
    person.wait(3.0)
    assert asked.actions == [2, 2, 2]
    assert len(person.frames) == n_frames  # the environment is the learner's again


def test_each_step_was_seen_before_the_next(person, asked):
    ask(person, asked).tap("enter").press("right").until(WAITING)
    places = [int(frame.pixels[0, 0, 0]) for _, frame in person.frames]
    start = int(asked.request.observations[-1][0]) * 10
    assert places == [start, start + 10, start + 20, start + 30]


def test_handing_back_and_declining(person, asked):
    ask(person, asked).tap("enter").until("playing").wait(0.15).tap("escape")
    assert person.view.state == WAITING
    assert len(asked.actions) in (1, 2)
    second = Asked()
    person.session.env = second.env
    ask(person, second).tap("escape")
    assert person.view.state == WAITING
    assert second.actions == []


def test_no_answer_is_a_refusal(person, asked):
    ask(person, asked).wait(29.0)
    assert person.desk.is_open
    person.wait(1.5)
    assert not person.desk.is_open
    assert asked.actions == []


def test_a_closed_page_is_awaited_for_a_moment_only(person, asked):
    ask(person, asked).tick(Away("closed", gone=True))
    person.wait(GRACE_SECONDS - 1.0)
    assert person.desk.is_open
    person.tap("enter").until("playing")  # it came back
    person.tick(Away("closed", gone=True))
    assert person.view.state == "paused"
    person.wait(GRACE_SECONDS + 0.5)
    assert not person.desk.is_open


def test_a_page_that_stays_closed_is_not_awaited_again(person, asked):
    """It was awaited for the whole patience at every further request."""
    person.tick(Away("closed", gone=True))
    person.wait(GRACE_SECONDS + 1.0)
    ask(person, asked)
    assert not person.desk.is_open
    person.tick(Present())
    ask(person, Asked()).wait(20.0)
    assert person.desk.is_open
    person.wait(11.0)
    assert not person.desk.is_open


def test_who_comes_back_in_time_has_all_of_it(person, asked):
    ask(person, asked).tick(Away("closed", gone=True))
    person.wait(2.0).tick(Present())
    person.wait(20.0)
    assert person.desk.is_open


def test_a_lost_focus_pauses_and_goes_on(person, asked):
    ask(person, asked).tap("enter").press("right").until("playing").wait(0.05)
    person.tick(Away("hidden"))
    before = list(asked.actions)
    person.wait(5.0)
    assert person.view.state == "paused"
    assert asked.actions == before
    person.tap("enter").until("playing").press("right").until(WAITING)
    assert asked.stretch.is_over


@pytest.mark.parametrize("name", ["redo", "discard", "end", "keep", "drop"])
def test_what_makes_no_sense_here_does_nothing(person, asked, name):
    ask(person, asked).tap("enter").until("playing").do(name, 0)
    assert person.view.state == "playing"
    assert set(person.view.controls) == {
        "pause", "finish", "slower", "faster", "mode", "wait",
    }  # fmt: skip


def test_turns_are_taken_one_by_one(person, asked):
    person.do("turn_based", True)
    ask(person, asked).tap("enter").until("playing").wait(3.0)
    assert asked.actions == []
    person.tap("right").wait(1.0).tap("left").wait(1.0)
    assert asked.actions == [2, 0]


def test_the_end_of_the_episode_ends_the_stretch():
    asked = Asked(max_steps=50)
    desk = desk_of(asked)
    person = Person(session=desk.session, tick=desk.tick)
    person.desk = desk
    ask(person, asked).tap("enter").press("right").until(WAITING)
    assert asked.stretch.is_over
    assert len(asked.actions) == 9 - int(asked.request.observations[-1][0])


def test_a_fault_is_kept_for_the_learner(person, asked):
    def broken(action):
        raise RuntimeError("broken")

    ask(person, asked)
    asked.env.env.step = broken
    person.tap("enter").press("right").until("failed")
    assert "broken" in str(person.session.fault)
    assert not person.desk.is_open
