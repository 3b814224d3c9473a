"""What a session says is to be stored is in the folder, whatever happens to the process."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from eutree.data import DemonstrationFolder, Demonstrations
from eutree.errors import EnvironmentFault, FileError, InvalidArgumentError
from eutree.files import atomic
from eutree.recording.events import SessionSettings
from eutree.recording.recorder import Recorder
from tests.recording.broken import Broken
from tests.recording.people import Corridor, Person

ROOT = Path(__file__).parents[2]


def person_in(folder: Path, env=None, **settings) -> tuple[Person, Recorder]:
    defaults = {"target": 3, "countdown": 0.1}
    recorder = Recorder(env or Corridor(), folder, settings=SessionSettings(**defaults | settings))
    return Person(session=recorder.session, tick=recorder.tick), recorder


def test_what_was_done_is_what_is_stored(tmp_path) -> None:
    person, recorder = person_in(tmp_path / "demos")
    person.walk().walk()
    person.tap("r").until("playing").press("right").until("review").release("right")  # redo
    person.wait(1.0).walk().tap("delete")  # discard
    person.tap("escape")
    recorder.close()
    stored = Demonstrations.load(tmp_path / "demos")
    assert [episode.kept for episode in stored.episodes] == [True, False, True, False]
    assert [episode.comment for episode in stored.episodes] == ["", "redone", "", "discarded"]
    for mine, theirs in zip(person.session.episodes, stored.episodes, strict=True):
        assert mine.equals(theirs)
    assert len(stored) == 2
    assert sorted(path.suffix for path in (tmp_path / "demos").iterdir()) == [".json"] + [
        ".npz"
    ] * len(stored.episodes)


def test_a_finished_episode_is_stored_at_once(tmp_path) -> None:
    person, _ = person_in(tmp_path / "demos")
    person.tap("enter").until("playing").press("right")
    while not person.session.episodes:
        person.wait(1 / 60)
    assert person.view.state == "playing"  # the last picture has still to be looked at
    assert len(Demonstrations.load(tmp_path / "demos").episodes) == 1


def test_a_folder_is_continued(tmp_path) -> None:
    person, recorder = person_in(tmp_path / "demos")
    person.walk().tap("escape")
    recorder.close()
    person, recorder = person_in(tmp_path / "demos")
    assert (person.view.saved, len(person.view.episodes)) == (1, 1)
    person.walk().walk()
    recorder.close()
    stored = Demonstrations.load(tmp_path / "demos")
    assert len(stored) == 3
    assert len({episode.seed for episode in stored}) == 3


@pytest.mark.promise(9)
def test_an_episode_that_is_left_comes_back_interrupted(tmp_path) -> None:
    person, recorder = person_in(tmp_path / "demos")
    person.walk()
    person.tap("enter").until("playing").wait(0.35)
    steps = person.view.step
    recorder.close()
    stored = Demonstrations.load(tmp_path / "demos")
    assert [episode.ending for episode in stored.episodes] == ["terminated", "interrupted"]
    assert len(stored.episodes[1]) == steps
    assert stored.episodes[1].steps["keys"].shape == (steps, 2)


def test_two_recorders_in_one_folder_play_different_starts(tmp_path) -> None:
    first, mine = person_in(tmp_path / "demos")
    second, theirs = person_in(tmp_path / "demos")
    first.tap("enter").tap("p").tap("e").wait(1.0)  # ended before its first step
    for _ in range(2):
        first.walk()
        second.walk()
    first.tap("r").until("playing").press("right").until("review")  # the same start on purpose
    mine.close()
    theirs.close()
    episodes = Demonstrations.load(tmp_path / "demos").episodes
    assert len({episode.seed for episode in episodes if episode.kept}) == 4
    redone = [episode for episode in episodes if not episode.kept]
    assert redone[0].seed in {episode.seed for episode in episodes if episode.kept}


def test_the_numbers_on_the_page_are_those_of_the_folder(tmp_path) -> None:
    """Each of two recorders in one folder counted its own."""
    people = [person_in(tmp_path / "demos") for _ in range(2)]
    for _ in range(2):
        for person, _ in people:
            person.walk()
    people[1][0].tap("enter").until("playing").wait(0.3)
    people[0][0].tap("enter").until("playing").wait(0.3).do("end")
    people[1][0].do("end")  # the first view that shows it says its number
    for (person, recorder), numbers in zip(people, ([0, 2, 5], [1, 3, 4]), strict=True):
        assert [row.number for row in person.view.episodes] == numbers
        for number, episode in zip(numbers, person.session.episodes, strict=True):
            assert recorder.folder.read(number).equals(episode)
        recorder.close()


def test_another_environment_is_refused(tmp_path) -> None:
    person_in(tmp_path / "demos")[1].close()

    class Other(Corridor):
        action_names = ("back", "stay", "forth")

    with pytest.raises(InvalidArgumentError, match="other features or actions"):
        Recorder(Other(), tmp_path / "demos")


def test_wrong_keys_leave_no_folder(tmp_path) -> None:
    with pytest.raises(InvalidArgumentError, match="unknown action 'fly'"):
        Recorder(Corridor(), tmp_path / "demos", keys="up=fly")
    assert not (tmp_path / "demos").exists()


def test_a_fault_keeps_what_was_saved(tmp_path) -> None:
    person, recorder = person_in(tmp_path / "demos", Broken())
    person.tap("enter").until("failed")
    with pytest.raises(EnvironmentFault, match="motor"):
        recorder.raise_failure()
    stored = Demonstrations.load(tmp_path / "demos")
    assert [(e.ending, e.kept, len(e)) for e in stored.episodes] == [("fault", False, 3)]


@pytest.mark.promise(10)
def test_a_full_disk_ends_the_session_and_keeps_the_rest(tmp_path, monkeypatch) -> None:
    person, recorder = person_in(tmp_path / "demos", Corridor(length=50, limit=500))
    person.tap("enter").until("playing").wait(0.5).tap("e").wait(1.0)
    person.tap("enter").until("playing").wait(0.35)
    steps = person.view.step
    own = atomic.write_all

    def full(descriptor: int, content: bytes) -> None:
        own(descriptor, content[:7])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic, "write_all", full)
    person.until("failed")
    monkeypatch.undo()
    assert "the disk is full" in person.view.message
    with pytest.raises(FileError, match="the disk is full"):
        recorder.raise_failure()
    recorder.close()
    stored = Demonstrations.load(tmp_path / "demos")
    assert [(e.ending, len(e)) for e in stored.episodes][1] == ("interrupted", steps)
    assert stored.episodes[0].ending == "stopped"


@pytest.mark.parametrize("what", ["step", "end", "discard", "start"])
def test_when_the_disk_is_full_the_page_says_what_is_on_it(tmp_path, monkeypatch, what) -> None:
    """It said that the episode under way was not used, which every learner used."""
    person, recorder = person_in(tmp_path / "demos", Corridor(length=50, limit=500))
    person.tap("enter").until("playing").wait(0.5).tap("e").wait(1.0)
    if what in ("step", "end"):
        person.tap("enter").until("playing").wait(0.35)

    def full(descriptor: int, content: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic, "write_all", full)
    names = {"step": "faster", "end": "discard"}
    person.do(names.get(what, what)).until("failed")
    monkeypatch.undo()
    recorder.close()
    folder = DemonstrationFolder(tmp_path / "demos")
    rows = [(row.number, row.result, row.kept, row.length) for row in person.view.episodes]
    assert rows == [
        (number, one.ending, one.kept, len(one)) for number, one in folder.read_all().items()
    ]
    assert person.view.saved == len(rows) == (1 if what in ("discard", "start") else 2)


SCRIPT = textwrap.dedent(
    """
    import sys
    from tests.recording.people import Corridor
    from tests.recording.test_recorder import person_in

    person, recorder = person_in(sys.argv[1], Corridor(length=40, limit=500), target=1000)
    while True:
        before = len(person.session.episodes)
        person.tap("enter").until("playing").press("right")
        while person.view.state == "playing":
            person.wait(1 / 60)
            finished = len(person.session.episodes)
            running = finished == before
            print(finished, person.view.step if running else 0, flush=True)
        person.release("right").wait(1.0)
    """
)


@pytest.mark.promise(9)
@pytest.mark.parametrize("patience", [0.02, 0.3, 0.7])
def test_kill_9_loses_at_most_the_step_in_flight(tmp_path, patience) -> None:
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "demos")]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT}"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        first = process.stdout.readline()
        time.sleep(patience)
        process.send_signal(signal.SIGKILL)
        said = first + process.stdout.read()
    whole = said[: said.rindex("\n")].splitlines()  # the kill may cut the last line
    finished, steps = map(int, whole[-1].split())
    stored = Demonstrations.load(tmp_path / "demos").episodes
    done = [episode for episode in stored if episode.ending != "interrupted"]
    assert len(done) >= finished
    assert len(stored) - len(done) <= 1
    if len(done) == finished and steps:
        assert stored[-1].ending == "interrupted"
        assert len(stored[-1]) >= steps
    env = Corridor(length=40, limit=500)
    for episode in stored:
        seen = [env.reset(seed=episode.seed)[0], *(env.step(a)[0] for a in episode.actions)]
        assert np.array_equal(seen, episode.observations)


def test_nothing_is_made_for_what_cannot_be_seen(tmp_path) -> None:
    """A folder was left that stood in the way of the next recording."""
    env = Corridor()
    env.render_mode = None
    with pytest.raises(InvalidArgumentError, match="env must be made with render_mode"):
        Recorder(env, tmp_path / "demos")
    assert not (tmp_path / "demos").exists()


class SometimesMasked(Corridor):
    """Says what is allowed after every other step."""

    def step(self, action):
        *answer, info = super().step(action)
        said = {"action_mask": np.array([1, 0, 1], dtype=np.int8)} if self.steps % 2 else {}
        return *answer, info | said


def test_masks_that_are_said_at_some_steps_alone_are_stored(tmp_path) -> None:
    """The episode was lost at its end, and its folder could not be opened again."""
    person, recorder = person_in(tmp_path / "demos", SometimesMasked())
    person.walk().tap("escape")
    recorder.close()
    (stored,) = Demonstrations.load(tmp_path / "demos").episodes
    assert stored.allowed[:4].tolist() == [[True] * 3, [True, False, True]] * 2
