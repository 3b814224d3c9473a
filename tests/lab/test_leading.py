"""A study: one part after the other, one archive for each person, nothing personal in it."""

import getpass
import platform
import re
import time
import zipfile
from importlib import import_module
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.data import Demonstrations
from eutree.errors import FormatError, InvalidArgumentError
from eutree.fitting import page_tree
from eutree.recording import SessionSettings
from eutree.recording.events import Command, KeyDown
from eutree.schema import EnvironmentSpec
from eutree_lab.study.archive import unpack
from eutree_lab.study.lead import conduct
from eutree_lab.study.plan import PLAN, open_plan, usual
from tests.lab.participants import SHORT, SPEC, Participant, study_of, taking_part


@pytest.fixture(autouse=True)
def few_episodes(monkeypatch):
    for name, number in (("FITTED", 20), ("PLAYED", 20), ("PRACTICE", 4), ("PER_POINT", 2)):
        monkeypatch.setattr(page_tree, name, number)


def test_a_person_goes_through_all_parts_and_leaves_one_archive(tmp_path) -> None:
    study = study_of(tmp_path / "study")
    with taking_part(study) as parts:
        person = Participant(*parts)
        assert person.guide.view()["is_card"]
        assert "Would you like" in person.guide.view()["text"]
        person.show_all()
        assert person.guide.part == "questions"
        person.say("answer", 0, "4").say("answer", 1, "quite").say("send").until("thanks")
        code = parts[0].folder.path.parent.name
        assert code in person.guide.view()["text"]
        person.say("leave")
        assert parts[0].session.is_over
    assert person.parts == [
        "consent", "practice", "showing", "making", "watching", "correcting", "questions",
        "thanks",
    ]  # fmt: skip
    assert [path.name for path in study.iterdir() if code in path.name] == [f"{code}.zip"]
    assert all(not (view.commands or view.ways or view.may_gain) for view in person.shown)
    found = unpack(study / f"{code}.zip", tmp_path / "out")
    assert found.person == code
    assert found.answers == ["4", "quite"]
    assert set(found.seconds) == {*person.parts[1:-1], "waiting"}
    assert found.seconds["showing"] > 1.0
    assert [result.tree for result in found.results] == ["fitted", "taken-over", "practised"]
    demos = Demonstrations.load(tmp_path / "out" / "demos")
    comments = [episode.comment for episode in demos.episodes]
    assert comments == ["practice", "", "", ""]
    assert [episode.by_hand is not None for episode in demos.episodes] == [False] * 3 + [True]
    for result in found.results:
        tree = eutree.TreePolicy.load(tmp_path / "out" / f"{result.tree}.json")
        assert tree.n_leaves == result.leaves


def test_everybody_meets_the_same_starts(tmp_path) -> None:
    study = study_of(tmp_path / "study")
    seeds = []
    for _ in range(2):
        with taking_part(study) as parts:
            person = Participant(*parts)
            person.say("agree").say("begin").drive().say("begin").drive()
            seeds.append([episode.seed for episode in parts[0].session.episodes])
    assert seeds[0] == seeds[1]
    assert len(set(seeds[0])) == 3


def test_the_archive_says_nothing_of_the_person_or_the_machine(tmp_path) -> None:
    study = study_of(tmp_path / "study")
    before = time.time()
    with taking_part(study) as parts:
        person = Participant(*parts).show_all().say("send").until("thanks").say("leave")
    assert person.guide.is_finished
    (path,) = study.glob("*.zip")
    assert path.stat().st_mtime == 0.0
    personal = [str(tmp_path), str(Path.home()), platform.node(), getpass.getuser(), "127.0.0.1"]
    with zipfile.ZipFile(path) as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        texts = {entry.filename: archive.read(entry) for entry in archive.infolist()}
    plain = b"\n".join(texts.values())
    with zipfile.ZipFile(path) as archive:  # the episodes are archives themselves
        for name in archive.namelist():
            if name.endswith(".npz"):
                with archive.open(name) as file, zipfile.ZipFile(file) as inner:
                    plain += b"".join(inner.read(member) for member in inner.namelist())
    for word in personal:
        assert not re.search(rb"(?<![a-z])" + re.escape(word.encode()) + rb"(?![a-z])", plain), word
    unpack(path, tmp_path / "out")
    for episode in Demonstrations.load(tmp_path / "out" / "demos").episodes:
        assert float(np.max(episode.steps["time"])) < before / 1000.0  # no time of day
        assert all(edge[2] < before / 1000.0 for edge in episode.extras["edges"])


@pytest.mark.parametrize("part", ["practice", "questions", "thanks"])
def test_whoever_withdraws_leaves_nothing(tmp_path, part) -> None:
    study = study_of(tmp_path / "study")
    with taking_part(study) as parts:
        person = Participant(*parts)
        if part == "practice":
            person.say("agree").say("begin").person.until("playing").wait(0.5)
        else:
            person.show_all()
        if part == "thanks":
            person.say("send").until("thanks")
            assert list(study.glob("*.zip"))
        person.say("withdraw")
        assert person.guide.view()["part"] == "asked"
        person.say("delete")
        assert parts[0].session.is_over
        assert "Nothing of what you did" in person.guide.view()["text"]
    assert sorted(path.name for path in study.iterdir()) == ["consent.md", "study.toml"]


@pytest.mark.parametrize("says", ["decline", "nothing"])
def test_who_does_not_agree_leaves_nothing_either(tmp_path, says) -> None:
    study = study_of(tmp_path / "study")
    with taking_part(study) as parts:
        Participant(*parts).say(says)
    assert sorted(path.name for path in study.iterdir()) == ["consent.md", "study.toml"]


def test_deleting_is_asked_and_stops_the_episode_meanwhile(tmp_path) -> None:
    with taking_part(study_of(tmp_path / "study")) as parts:
        person = Participant(*parts).say("agree").say("begin")
        person.person.until("playing").wait(0.3)
        person.say("delete")  # nobody was asked
        assert person.guide.part == "practice"
        person.say("withdraw")
        assert person.person.view.state == "paused"
        person.person.do("start").wait(0.3)
        assert person.person.view.state == "paused"
        person.say("stay")
        person.person.do("start").until("playing")


def test_only_what_belongs_to_a_part_is_obeyed(tmp_path) -> None:
    with taking_part(study_of(tmp_path / "study")) as parts:
        session = parts[0].session
        person = Participant(*parts)
        for name in ("start", "make", "finish", "toggle"):
            person.person.do(name).wait(0.3)
        assert session.state == "opening"
        person.say("send").say("begin").say("leave").say("answer", 0, "4")
        assert person.guide.part == "consent"
        assert person.guide.answers == ["", ""]
        person.say("agree")
        assert parts[0].session.task in person.guide.view()["text"]
        person.say("begin").person.until("playing")
        for name in ("end", "redo", "discard", "speed", "mode", "bind"):
            person.person.do(name, 2.0).wait(0.1)
        person.person.tick(KeyDown("delete"))
        assert session.state == "playing"
        assert session.play.controls.pace.speed == 1.0
        person.drive()
        person.person.tick(Command("start"))
        assert person.guide.part == "showing"
        assert len(session.episodes) == 1


def test_an_answer_is_one_of_those_offered_and_may_be_taken_back(tmp_path) -> None:
    with taking_part(study_of(tmp_path / "study")) as parts:
        person = Participant(*parts).show_all()
        person.say("answer", 0, "9")
        assert person.guide.answers[0] == ""
        person.say("answer", 0, "5").say("answer", 0, "").say("answer", 7, "1")
        person.say("answer", 1, "x" * 5000)
        assert person.guide.answers == ["", "x" * 400]


def test_a_recorder_that_dies_is_gone_on_with(tmp_path) -> None:
    study = study_of(tmp_path / "study")
    with taking_part(study) as parts:
        person = Participant(*parts).say("agree").say("begin").drive().say("begin")
        person.person.until("playing").wait(0.5)
        code = parts[0].folder.path.parent.name
        parts[0].close()
    with taking_part(study, person=code) as parts:
        person = Participant(*parts)
        assert person.guide.part == "showing"
        person.say("begin").drive()
        kept = [episode for episode in parts[0].session.episodes if episode.kept]
        assert len(kept) == 2
        assert not any(episode.ending == "interrupted" for episode in kept)
    with (
        pytest.raises(InvalidArgumentError, match="has no person 'deadbeef'"),
        taking_part(study, person="deadbeef"),
    ):
        pass


@pytest.mark.parametrize("part", ["practice", "showing"])
def test_who_has_done_all_of_a_part_before_a_recorder_dies_goes_on(tmp_path, part) -> None:
    """They stayed in it for good: it awaited the end of an episode, and obeyed no command."""
    study = study_of(tmp_path / "study")
    with taking_part(study) as parts:
        person = Participant(*parts).say("agree").say("begin")
        if part == "showing":
            person.drive().say("begin").play()
        person.play()
        assert (person.guide.part, person.person.view.state) == (part, "review")
        parts[0].close()
    with taking_part(study, person=parts[0].folder.path.parent.name) as parts:
        person = Participant(*parts)
        assert not person.guide.view()["is_card"]
        person.until("showing" if part == "practice" else "watching")


@pytest.mark.parametrize("corrected", [0, 1])
def test_practice_after_a_recorder_died_makes_no_tree_twice(tmp_path, corrected) -> None:
    """It stored the tree that it made again as one that had been taken over."""
    plan = SHORT.replace("taken_over = 1", f"taken_over = {corrected}")
    study = study_of(tmp_path / "study", plan)
    with taking_part(study) as parts:
        person = Participant(*parts).say("agree").say("begin").drive().say("begin").drive()
        person.until("watching").drive()
        if corrected:
            person.say("begin").drive()
        person.until("questions")
        while len(parts[1].results) < 1 + corrected:
            person.person.wait(0.1)
        guide, folder = parts[2], parts[0].folder.path.parent
        del parts[1].results[1 + corrected :]  # it died before the practice was over
        guide._store()
        parts[0].close()
    with taking_part(study, person=folder.name) as parts:
        Participant(*parts).until("questions").say("send").until("thanks")
        known = [result.tree for result in parts[1].results]
    assert known == ["fitted", *["taken-over"] * corrected, "practised"]


def test_who_had_put_right_less_than_all_puts_right_the_rest(tmp_path, monkeypatch) -> None:
    """The rest was left out without a word."""
    module, made_of = import_module("eutree.fitting.fit"), []
    monkeypatch.setattr(module, "fit", lambda known, *args, fit=module.fit, **options: (
        made_of.append([one.by_hand is not None for one in known]) or fit(known, *args, **options)
    ))  # fmt: skip
    study = study_of(tmp_path / "study", SHORT.replace("taken_over = 1", "taken_over = 2"))
    with taking_part(study) as parts:
        person = Participant(*parts).say("agree").say("begin").drive().say("begin").drive()
        person.until("watching").drive().say("begin")
        session, folder = parts[0].session, parts[0].folder.path.parent
        person.person.press("space")
        while not (session.driving.waits and len(session.episodes) == 4):
            person.person.wait(0.1)
        parts[0].close()
    with taking_part(study, person=folder.name) as parts:
        person = Participant(*parts).until("watching").drive()
        person.say("begin").until("questions")
        driven = [episode.by_hand is not None for episode in parts[0].session.episodes]
        assert driven == [False] * 3 + [True] * 2
        person.say("send").until("thanks")
    assert made_of == [[False] * 2, [False] * 2, [False] * 2 + [True] * 2]
    assert [result.tree for result in parts[1].results] == ["fitted", "taken-over", "practised"]


def test_a_study_is_the_same_for_each_person(tmp_path) -> None:
    study = study_of(tmp_path / "study")
    with taking_part(study) as parts:
        Participant(*parts).say("agree")
    with taking_part(study):
        pass
    (study / "study.toml").write_text(SHORT.replace("episodes = 2", "episodes = 3"))
    with (
        pytest.raises(InvalidArgumentError, match="must be the same for each person"),
        taking_part(study),
    ):
        pass


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ("episodes = 0", "at least 1"),
        ("episodes = 'many'", "int"),
        ("repisodes = 3", "repisodes"),
        ("episodes =", "Invalid value"),
        ("[[questions]]\ntext = 'x'\npoints = 3\nchoices = ['a']", "2 to 11 points, or choices"),
    ],
)
def test_a_plan_that_cannot_be_meant_is_refused(tmp_path, plan, said) -> None:
    with pytest.raises(FormatError, match=said):
        open_plan(study_of(tmp_path, plan))


def test_the_usual_plan_is_written_to_be_changed(tmp_path) -> None:
    plan, consent, digest = open_plan(tmp_path / "new", SPEC)
    assert (tmp_path / "new" / "study.toml").read_text() == usual(PLAN)
    assert (plan.practice, plan.episodes, len(plan.questions)) == (2, 15, 3)
    assert "Delete what I did" in consent
    assert open_plan(tmp_path / "new", SPEC)[2] == digest
    assert open_plan(tmp_path / "new", "another")[2] != digest


def test_an_archive_of_others_is_read_with_suspicion(tmp_path) -> None:
    for name in ("../person.json", "demos/../../x", "run.py"):
        path = tmp_path / "bad.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(name, "{}")
        with pytest.raises(FormatError, match="does not belong there"):
            unpack(path, tmp_path / "out")
    path.write_bytes(b"no zip")
    with pytest.raises(FormatError, match="is no archive"):
        unpack(path, tmp_path / "out")


@pytest.mark.parametrize(
    "line", [["study", "lead", "{}", "ENV"], ["record", "ENV", "--study", "{}"]]
)
def test_one_person_after_the_other_is_led(tmp_path, monkeypatch, capsys, line) -> None:
    def finished(output, recorder, spec, out, *, lead, host, port) -> None:
        assert (host, port, str(spec)) == ("127.0.0.1", None, "eutree/Evasion2-v0")
        lead[1].hear("decline")

    monkeypatch.setattr("eutree_lab.command.record_on_page", finished)
    names = {"{}": str(tmp_path), "ENV": "eutree/Evasion2-v0"}
    assert run([*(names.get(word, word) for word in line), "--fps", "5"]) == 0
    said = capsys.readouterr()
    assert re.search(r"eutree study lead \S+ eutree/Evasion2-v0 --person [0-9a-f]{8}", said.err)
    assert re.search(r"person [0-9a-f]{8}: nothing is kept", said.out)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["consent.md", "study.toml"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--person", "00000000"], "has no person '00000000'"),
        (["--keys", "left"], "KEY=ACTION"),
    ],
)
def test_who_cannot_be_led_is_refused(tmp_path, capsys, options, said) -> None:
    assert run(["study", "lead", str(tmp_path), "eutree/Evasion2-v0", *options]) != 0
    assert said in capsys.readouterr().err


def test_what_need_not_end_is_no_task_of_a_study(tmp_path) -> None:
    endless = gymnasium.make("CliffWalking-v1", render_mode="rgb_array", max_episode_steps=-1)
    with (
        pytest.raises(InvalidArgumentError, match="must end by itself"),
        conduct(tmp_path, EnvironmentSpec("CliffWalking-v1"), endless, pace=SessionSettings()),
    ):
        pass


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--study", "s", "--out", "d"], "leave out --out"),
        (["--study", "s", "--episodes", "3"], "leave out --episodes"),
        (["--person", "00000000", "--out", "d"], "--person needs --study"),
    ],
)
def test_what_a_study_decides_is_not_given_to_record(capsys, options, said) -> None:
    assert run(["record", "eutree/Evasion2-v0", *options]) == 2
    assert said in capsys.readouterr().err
