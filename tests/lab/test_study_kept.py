"""What a person of a study did stays, whatever becomes of the recorder or of the disk."""

import pytest

from eutree.errors import FileError, RunFolderError
from eutree_lab.study import lead
from eutree_lab.study.archive import unpack
from tests.lab.test_leading import (
    Participant,
    few_episodes,  # noqa: F401 - a fixture
    study_of,
    taking_part,
)

BRIEF = """
practice = 0
episodes = 1
watched = 0
taken_over = 0
practises = false
[[questions]]
text = "As I would?"
points = 5
[[questions]]
text = "In words?"
"""


def code_of(parts):
    return parts[0].folder.path.parent.name


def asked(parts):
    """Lead a person to the questions."""
    return Participant(*parts).say("agree").say("begin").drive().until("questions")


def test_what_could_not_be_packed_stays_and_is_packed_later(tmp_path, monkeypatch) -> None:
    study, pack = study_of(tmp_path / "study", BRIEF), lead.pack

    def full(folder, study):
        raise FileError("write", study, "no space left on device")

    monkeypatch.setattr(lead, "pack", full)
    with pytest.raises(FileError), taking_part(study) as parts:
        asked(parts).say("answer", 0, "4").say("send").until("thanks")
    assert not parts[2].is_finished
    code = code_of(parts)
    assert sorted(path.name for path in study.iterdir()) == [code, "consent.md", "study.toml"]
    monkeypatch.setattr(lead, "pack", pack)
    with taking_part(study, person=code) as parts:
        Participant(*parts).until("thanks")
        assert parts[2].is_finished
    assert not (study / code).exists()
    found = unpack(study / f"{code}.zip", tmp_path / "out")
    assert (found.answers, found.part) == (["4", ""], "thanks")
    assert [result.tree for result in found.results] == ["fitted"]


def test_a_person_is_led_by_one_recorder_at_a_time(tmp_path) -> None:
    study = study_of(tmp_path / "study", BRIEF)
    with taking_part(study) as parts:
        code = code_of(parts)
        with pytest.raises(RunFolderError, match=f"{code} is in use by process"):
            taking_part(study, person=code).__enter__()
        person = Participant(*parts).say("agree").say("begin").play()
        with pytest.raises(RunFolderError, match="is in use"):
            taking_part(study, person=code).__enter__()
        assert list((study / code / "demos").glob("episode-*"))
        person.until("questions")
    with taking_part(study, person=code) as parts:
        assert parts[2].part == "questions"


def test_who_believes_that_nobody_agreed_deletes_nothing_of_whoever_did(tmp_path) -> None:
    study = study_of(tmp_path / "study", BRIEF)
    with taking_part(study) as parts:
        Participant(*parts).say("agree")
        parts[2].part = "consent"
    assert (study / code_of(parts) / "person.json").exists()
