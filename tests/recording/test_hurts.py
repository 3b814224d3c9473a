"""Seconds that hurt, at the page: cut, flip, show again; what was done is never lost."""

import asyncio
import threading
import time
from contextlib import closing
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from eutree.data import DemonstrationFolder, Demonstrations
from eutree.data.episode import CUT
from eutree.recording.browser import PageServer
from eutree.recording.events import EpisodeChanged, EpisodeEnded, SessionSettings
from eutree.recording.recorder import Recorder
from eutree.recording.tree_making import HurtView, Segment
from tests.patience import ENOUGH
from tests.recording.people import Corridor, Person
from tests.recording.typists import ScriptedMaker

RIGHT = 2


def hurt(what="flip", episode=0, start=1, stop=3, **fields):
    segment = Segment(
        episode=episode,
        start=start,
        stop=stop,
        seconds=None,
        **({"action": RIGHT, "becomes": 0} | fields),
    )
    return HurtView(what=what, title="", why="", reached="", segments=(segment,), strips=())


@pytest.fixture
def person():
    """Somebody who has shown two episodes, to the right all along, and whose tree is made."""
    somebody = Person(target=2, makes=True).walk().walk()
    somebody.session.wishes.take()
    somebody.session.lessons.hurts = (hurt(), hurt("cut", 1, 0, 2), hurt("show again", 0, 2, 3))
    somebody.outputs.clear()
    return somebody


def taught(person):
    return [episode.taught.tolist() for episode in person.session.episodes]


def actions(person):
    return [episode.actions.tolist() for episode in person.session.episodes]


def test_what_is_cut_or_flipped_is_stored_and_a_tree_is_made_of_what_is_left(person) -> None:
    before = actions(person)
    assert before[0][:4] == [RIGHT] * 4
    person.do("flip", 0.0)
    assert person.session.wishes.take() == "without"
    assert taught(person)[0][:4] == [RIGHT, 0, 0, RIGHT]
    (changed,) = person.outputs
    assert isinstance(changed, EpisodeChanged)
    assert changed.episode.taught.tolist() == taught(person)[0]
    person.do("cut", 1.0)
    assert taught(person)[1][:3] == [CUT, CUT, RIGHT]
    assert actions(person) == before


def test_the_last_change_is_taken_back_and_no_other(person) -> None:
    person.do("flip", 0.0).do("accept").do("cut", 1.0)
    person.session.wishes.take()
    person.do("undo")
    assert person.session.wishes.take() == "undo"
    assert taught(person)[0][:4] == [RIGHT, 0, 0, RIGHT]
    assert taught(person)[1] == actions(person)[1]


def test_all_at_once_are_changed_and_taken_back_together(person) -> None:
    person.do("all")
    assert taught(person)[0][:4] == [RIGHT, 0, 0, RIGHT]  # its piece to show again is not cut
    assert taught(person)[1][:3] == [CUT, CUT, RIGHT]
    person.do("undo")
    assert taught(person) == actions(person)


def test_a_discarded_episode_or_one_that_is_another_now_is_left_alone(person) -> None:
    person.session.lessons.hurts = (hurt(action=1), hurt(episode=7), hurt(episode=1))
    person.do("drop", 1.0)
    person.outputs.clear()
    for number in (0.0, 1.0, 2.0, 9.0):
        person.do("cut", number).do("again", number)
    assert person.outputs == []
    assert person.session.wishes.take() == ""
    assert person.view.state == "review"


def test_while_a_tree_is_made_nothing_is_changed(person) -> None:
    person.session.wishes.is_busy = True
    person.do("cut", 0.0).do("again", 0.0)
    assert person.outputs == []


def test_a_wish_right_after_the_last_tree_is_taken_up(tmp_path, monkeypatch) -> None:
    """It was dropped while the thread that had made that tree was still ending."""
    leave = threading.Event()

    class Lingering(threading.Thread):
        def run(self):
            super().run()
            leave.wait(ENOUGH)

    async def press(*wishes):
        recorder = Recorder(Corridor(), tmp_path / "demos")
        server = PageServer(recorder, maker=maker)
        for wish in wishes:
            server._begin_work(wish)
            while recorder.session.wishes.is_busy:
                await asyncio.sleep(0.01)
        leave.set()
        recorder.close()

    maker = ScriptedMaker()
    slow = SimpleNamespace(Thread=Lingering)
    monkeypatch.setattr("eutree.recording.browser.server.threading", slow)
    asyncio.run(press("hurting", "without", "undo"))
    assert maker.calls == ["look", "make_without", "undo"]


def test_a_tree_is_shown_when_its_maker_takes_the_next_wish(tmp_path, monkeypatch) -> None:
    """An answer to it was dropped where the machine was slow to end the work."""
    seen = []

    class Slow(ScriptedMaker):
        def make_without(self, show, stop):
            super().make_without(show, stop)
            time.sleep(0.2)

    async def press():
        with closing(Recorder(Corridor(), tmp_path / "demos")) as recorder:
            server, wishes = PageServer(recorder, maker=Slow()), recorder.session.wishes
            monkeypatch.setattr(
                server, "show_tree", lambda view, _: seen.append((view.phase, wishes.is_busy))
            )
            for wish in ("hurting", "without"):
                server._begin_work(wish)
                while wishes.is_busy:
                    await asyncio.sleep(0.01)

    asyncio.run(press())
    assert seen == [("fitting", True), ("ready", False), ("ready", False)]


def test_to_show_again_begins_where_the_segment_does(person) -> None:
    shown = person.session.episodes[0]
    person.session.lessons.hurts = (hurt("show again", 0, 3, 5),)
    person.do("again", 0.0).until("countdown")
    assert person.view.step == 3
    trial = person.session.play.trial
    assert trial.observation.tolist() == shown.observations[3].tolist()
    person.until("playing").press("right").until("review").release("right")
    (ended,) = [output.episode for output in person.outputs if isinstance(output, EpisodeEnded)]
    assert ended.taught[:3].tolist() == [CUT] * 3  # it teaches nothing once more
    assert (ended.taught[3:] == ended.actions[3:]).all()
    assert ended.seed == shown.seed
    assert not ended.is_evidence
    person.wait(1.0).tap("r").until("playing")  # once more, from there
    assert person.view.step >= 3
    person.tap("delete").wait(1.0).do("end").until("playing")  # and then from a start of its own
    assert person.session.play.trial.seed != shown.seed
    assert "shown_again" not in person.session.play.trial.extras


def test_where_the_environment_is_elsewhere_it_goes_on_from_there(person) -> None:
    episode = person.session.episodes[0]
    moved = np.array(episode.observations)
    moved[1] += 1.0
    person.session.episodes[0] = replace(episode, observations=moved)
    person.session.lessons.hurts = (hurt("show again", 0, 3, 5),)
    person.do("again", 0.0).until("countdown")
    assert person.view.step == 1


def test_of_two_recorders_in_a_folder_each_changes_its_own_episodes(tmp_path) -> None:
    """What was found in the first file was cut from the first episode of this recorder."""
    settings = SessionSettings(target=1, makes=True)
    recorders = [Recorder(Corridor(), tmp_path / "demos", settings=settings) for _ in range(2)]
    for recorder in recorders:
        person = Person(session=recorder.session, tick=recorder.tick).walk()
    lessons = person.session.lessons
    lessons.hurts = (hurt(), hurt(episode=1))
    person.do("cut", 0.0).do("again", 0.0)
    assert (taught(person), person.view.state) == (actions(person), "review")
    person.do("cut", 1.0)
    assert taught(person)[0][:4] == [RIGHT, CUT, CUT, RIGHT]
    person.do("again", 1.0).until("countdown")
    assert person.view.step == 1
    for recorder in recorders:
        recorder.close()
    first, second, _ = Demonstrations.load(tmp_path / "demos").episodes
    assert first.taught.tolist() == first.actions.tolist()
    assert second.taught[:4].tolist() == [RIGHT, CUT, CUT, RIGHT]


def test_what_is_cut_is_on_the_disk_and_outlives_a_mark(tmp_path) -> None:
    recorder = Recorder(
        Corridor(), tmp_path / "demos", settings=SessionSettings(target=1, makes=True)
    )
    person = Person(session=recorder.session, tick=recorder.tick).walk()
    recorder.session.lessons.hurts = (hurt(),)
    person.do("cut", 0.0).do("drop", 0.0).do("keep", 0.0)
    recorder.close()
    stored = DemonstrationFolder(tmp_path / "demos").read(0)
    assert stored.taught[:4].tolist() == [RIGHT, CUT, CUT, RIGHT]
    assert stored.actions[:4].tolist() == [RIGHT] * 4
    assert len(Demonstrations.load(tmp_path / "demos")) == 1
