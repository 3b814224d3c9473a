"""What a person of a study did stays, whatever becomes of the recorder or of the disk."""

import os
import shutil
import warnings

import pytest

from eutree.errors import FileError, FormatError, InvalidArgumentError, RunFolderError
from eutree.files import atomic, read_document
from eutree.fitting import page_tree
from eutree_lab.study import archive, lead
from eutree_lab.study.archive import PersonDocument, unpack
from eutree_lab.study.plan import open_plan
from tests.lab.participants import Participant, study_of, taking_part

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


@pytest.fixture(autouse=True)
def few_episodes(monkeypatch):
    for name, number in (("FITTED", 20), ("PLAYED", 20), ("PRACTICE", 4), ("PER_POINT", 2)):
        monkeypatch.setattr(page_tree, name, number)


def code_of(parts):
    return parts[0].folder.path.parent.name


def asked(parts):
    """Lead a person to the questions."""
    return Participant(*parts).say("agree").say("begin").drive().until("questions")


def test_what_could_not_be_packed_stays_and_is_packed_later(tmp_path, monkeypatch) -> None:
    study, pack = study_of(tmp_path / "study", BRIEF), archive.pack

    def full(folder, study):
        raise FileError("write", study, "no space left on device")

    monkeypatch.setattr(archive, "pack", full)
    with pytest.raises(FileError), taking_part(study) as parts:
        asked(parts).say("answer", 0, "4").say("send").until("thanks")
    assert not parts[2].is_finished
    code = code_of(parts)
    assert {path.name for path in study.iterdir()} == {code, "consent.md", "study.toml"}
    monkeypatch.setattr(archive, "pack", pack)
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
        said = rf"{code} is in use by process \d+: another recorder leads this person"
        with pytest.raises(RunFolderError, match=said):
            taking_part(study, person=code).__enter__()
        person = Participant(*parts).say("agree").say("begin").play()
        with pytest.raises(RunFolderError, match="is in use"):
            taking_part(study, person=code).__enter__()
        assert list((study / code / "demos").glob("episode-*"))
        person.until("questions")
    with taking_part(study, person=code) as parts:
        assert parts[2].part == "questions"


@pytest.mark.parametrize("end", ["decline", "delete", "keys"])
def test_no_lock_stays_where_open_files_cannot_be_deleted(tmp_path, monkeypatch, end) -> None:
    study, rmtree, close = study_of(tmp_path / "study", BRIEF), shutil.rmtree, os.close
    held, locked = [], lead.locked

    def without_open_files(folder, **options):
        rmtree(folder, **options)
        if held:
            folder.mkdir()
            (folder / ".lock").touch()

    def closed(descriptor):
        if descriptor in held:
            held.remove(descriptor)
        close(descriptor)

    monkeypatch.setattr(lead.shutil, "rmtree", without_open_files)
    monkeypatch.setattr(lead.os, "close", closed)
    monkeypatch.setattr(lead, "locked", lambda *args: held.append(found := locked(*args)) or found)
    if end == "keys":
        with pytest.raises(InvalidArgumentError):
            taking_part(study, keys="nonsense=99").__enter__()
    else:
        with taking_part(study) as parts:
            person = Participant(*parts)
            if end == "delete":
                person.say("agree").say("withdraw")
            person.say(end)
            assert [path.name for path in (study / code_of(parts)).iterdir()] == [".lock"]
    assert not held
    assert {path.name for path in study.iterdir()} == {"consent.md", "study.toml"}


@pytest.mark.parametrize("again", [False, True])
def test_a_lock_of_a_file_that_was_deleted_is_none(tmp_path, monkeypatch, again) -> None:
    def deleted(descriptor):
        (tmp_path / ".lock").unlink()
        if again:
            (tmp_path / ".lock").write_text("")

    monkeypatch.setattr(atomic, "lock", deleted)
    with pytest.raises(RunFolderError, match="is in use by process"):
        atomic.locked(tmp_path)


def test_who_believes_that_nobody_agreed_deletes_nothing_of_whoever_did(tmp_path) -> None:
    study = study_of(tmp_path / "study", BRIEF)
    with taking_part(study) as parts:
        Participant(*parts).say("agree")
        parts[2].part = "consent"
    assert (study / code_of(parts) / "person.json").exists()


@pytest.mark.parametrize("edited", ["before", "after"])
def test_the_archive_has_the_text_that_the_person_agreed_to(tmp_path, edited) -> None:
    study = study_of(tmp_path / "study", BRIEF)
    (study / "consent.md").write_text("# Shown\n")
    with taking_part(study) as parts:
        assert parts[2].view()["text"] == "# Shown\n"
        if edited == "before":
            (study / "consent.md").write_text("# Never shown\n")
            (study / "study.toml").write_text("episodes = 99\n")
        person = asked(parts)
        (study / "consent.md").unlink(missing_ok=True)
        (study / "study.toml").unlink()
        person.say("send").until("thanks")
    unpack(study / f"{code_of(parts)}.zip", tmp_path / "out")
    assert (tmp_path / "out" / "consent.md").read_text() == "# Shown\n"
    assert (tmp_path / "out" / "study.toml").read_text() == BRIEF


def test_a_mark_of_the_byte_order_is_no_fault_and_a_fault_names_its_file(tmp_path) -> None:
    study = study_of(tmp_path / "study")
    (study / "study.toml").write_text("episodes = 3\n", encoding="utf-8-sig")
    (study / "consent.md").write_text("# Für alle\n", encoding="utf-8-sig")
    plan, consent, _ = open_plan(study)
    assert (plan.episodes, consent) == (3, "# Für alle\n")
    (study / "consent.md").write_text("# Für alle\n", encoding="latin-1")
    with pytest.raises(FormatError, match=r"consent\.md: 'utf-8' codec"):
        open_plan(study)
    (study / "consent.md").write_text("# For all\n")
    (study / "study.toml").write_text("# Für alle\n", encoding="latin-1")
    with pytest.raises(FormatError, match=r"study\.toml: 'utf-8' codec"):
        open_plan(study)


def kept(parts):
    """What is on the disk, as after a kill."""
    return read_document(parts[0].folder.path.parent / "person.json", PersonDocument)


def test_each_answer_is_on_the_disk_as_soon_as_it_is_given(tmp_path) -> None:
    study = study_of(tmp_path / "study", BRIEF)
    with taking_part(study) as parts:
        person = asked(parts)
        person.person.wait(1.0)
        person.say("answer", 0, "4")
        assert kept(parts).answers == ["4", ""]
        person.say("answer", 1, "well").say("answer", 1, "well, no")
        person.person.wait(1.0)
        assert kept(parts).answers == ["4", "well, no"]
        person.say("answer", 0, "")
        person.say("answer", 1, "well")  # within the second, and then it stops
    assert kept(parts).answers == ["", "well"]
    with taking_part(study, person=code_of(parts)) as parts:
        assert parts[2].view()["answers"] == ["", "well"]


def test_what_could_not_be_stored_is_stored_next_time(tmp_path, monkeypatch) -> None:
    def full(path, document):
        raise FileError("write", path, "no space left on device")

    with taking_part(study_of(tmp_path / "study", BRIEF)) as parts:
        person = Participant(*parts)
        with monkeypatch.context() as patched:
            patched.setattr(lead, "write_document", full)
            with pytest.raises(FileError):
                parts[2].hear("agree")
        person.person.wait(0.1)
        assert kept(parts).part == "showing"


def test_a_disk_that_is_full_while_somebody_answers_ends_nothing(tmp_path, monkeypatch) -> None:
    failed, write = [], lead.write_document

    def full_once(path, document):
        if not failed:
            failed.append(path)
            raise FileError("write", path, "no space left on device")
        write(path, document)

    with taking_part(study_of(tmp_path / "study", BRIEF)) as parts:
        person = asked(parts)
        person.person.wait(1.0)
        monkeypatch.setattr(lead, "write_document", full_once)
        person.say("answer", 0, "4")
        assert (len(failed), kept(parts).answers) == (1, ["", ""])
        person.person.wait(1.0)
        assert kept(parts).answers == ["4", ""]


def test_the_time_of_a_part_is_that_of_all_recorders(tmp_path) -> None:
    study = study_of(tmp_path / "study", BRIEF.replace("episodes = 1", "episodes = 2"))
    with taking_part(study) as parts:
        person = Participant(*parts).say("agree")
        person.person.wait(5.0)
        person.say("begin").play()
        before = kept(parts).seconds["showing"]  # a kill would leave this
        assert before > 5.0
        person.person.wait(1.0)
    stopped = kept(parts).seconds["showing"]
    assert stopped == pytest.approx(before + 1.0, abs=0.2)
    with taking_part(study, person=code_of(parts)) as parts:
        Participant(*parts).say("begin").drive().until("questions")
        assert kept(parts).seconds["showing"] > stopped + 1.0


def test_nothing_is_stored_before_the_consent(tmp_path) -> None:
    with taking_part(study_of(tmp_path / "study", BRIEF)) as parts:
        Participant(*parts).person.wait(1.0)
        assert {path.name for path in parts[0].folder.path.parent.iterdir()} == {"demos", ".lock"}


def test_files_of_others_in_a_study_do_not_stop_the_next_person(tmp_path) -> None:
    study = study_of(tmp_path / "study", BRIEF)
    (study / "._0000000a.zip").write_bytes(b"of a system")
    (study / "notes").mkdir()
    (study / "notes" / "person.json").write_text("{}")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with taking_part(study):
            pass
    (study / "notes.zip").write_bytes(b"no zip")
    (study / "0000000b").mkdir()
    (study / "0000000b" / "person.json").write_text("{}")
    with pytest.warns(UserWarning, match="is left out") as warned, taking_part(study):
        pass
    said = [str(one.message) for one in warned]
    assert ["notes.zip" in said[0], "0000000b" in said[1], len(said)] == [True, True, 2]
