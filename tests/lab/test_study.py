"""The table of a study: a row for each person, means with intervals, differences in pairs."""

import csv
import io
import json
import lzma
import shutil
import sys
import zipfile
import zlib

import gymnasium
import pytest

import eutree
from eutree.cli.main import run
from eutree.errors import FormatError, InvalidArgumentError
from eutree_lab.study.archive import pack, unpack
from eutree_lab.study.table import StudyTable, study_table

TASK = "eutree/Evasion2-v0"


def person_of(study, code, *, answer, tmp_path):
    """Write the archive of a person who took part by script."""
    env = gymnasium.make(TASK)
    shown = eutree.record(env, eutree.experts.wait_at_crossing, episodes=3, seed=int(code, 16))
    folder = tmp_path / code
    shown.save(folder / "demos")
    eutree.fit_expert_tree(shown).save(folder / "fitted.json")
    document = {
        "format": "eutree/person", "version": 1, "made_by": "eutree", "person": code,
        "protocol": "p", "environment": {"id": TASK, "arguments": {}},
        "plan": {"questions": [{"text": "As I would?", "points": 5}]}, "versions": {},
        "seconds": {"showing": 90.0, "questions": 30.0}, "results": [], "answers": [answer],
        "part": "thanks",
    }  # fmt: skip
    (folder / "person.json").write_text(json.dumps(document))
    (study / "study.toml").write_text("episodes = 2\n")
    (study / "consent.md").write_text("yes")
    (folder.rename(study / code))
    pack(study / code, study)


def test_the_table_has_a_row_for_each_person_and_means(tmp_path, capsys) -> None:
    study = tmp_path / "study"
    study.mkdir()
    for code, answer in (("0000000a", "2"), ("0000000b", "4"), ("0000000c", "")):
        person_of(study, code, answer=answer, tmp_path=tmp_path)
    table = study_table(study, episodes=30)
    assert [row["person"] for row in table.rows] == ["0000000a", "0000000b", "0000000c"]
    assert all(row["own"] == 1.0 and row["minutes"] == 2.0 for row in table.rows)
    assert all(row["taken-over"] is None and row["practised"] is None for row in table.rows)
    tree = eutree.TreePolicy.load(study / "0000000a" / "fitted.json")
    again = eutree.evaluate(tree, gymnasium.make(TASK), episodes=30, seed=1_000_003)
    assert table.rows[0]["fitted"] == again.success_rate
    mean, low, high, n = table.means()["answer 1"]
    assert (mean, n) == (3.0, 2)
    assert low < 2.0 < 4.0 < high
    assert "taken-over less fitted" not in table.means()
    assert (
        run(["study", "table", str(study), "--episodes", "10", "--csv", f"{tmp_path}/p.csv"]) == 0
    )
    assert "3 people; mean, 95 % interval" in capsys.readouterr().out
    assert (tmp_path / "p.csv").read_text().startswith("person,own,fitted,taken-over,practised")
    with pytest.raises(InvalidArgumentError, match=r"got no \.zip"):
        study_table(tmp_path)


def test_a_file_of_no_person_is_named_and_left_out_of_the_table(tmp_path) -> None:
    study = tmp_path / "study"
    study.mkdir()
    person_of(study, "0000000a", answer="2", tmp_path=tmp_path)
    (study / "._0000000a.zip").write_bytes(b"of a system")
    (study / "notes.zip").write_bytes(b"no zip")
    with pytest.warns(UserWarning, match=r"notes\.zip is left out") as warned:
        table = study_table(study, episodes=1)
    assert [row["person"] for row in table.rows] == ["0000000a"]
    assert len(warned) == 1


def test_a_damaged_archive_of_a_person_is_named_and_makes_no_table(tmp_path, capsys) -> None:
    """The means were of the others alone."""
    study = tmp_path / "study"
    study.mkdir()
    for code in ("0000000a", "0000000b"):
        person_of(study, code, answer="2", tmp_path=tmp_path)
    path = study / "0000000b.zip"
    plain = path.read_bytes()
    with zipfile.ZipFile(io.BytesIO(plain)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    kinds = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    for kind in kinds:
        with zipfile.ZipFile(path, "w", kind) as archive:
            for name, data in members.items():
                archive.writestr(name, data)
        data = bytearray(path.read_bytes())
        data[60:300] = bytes(byte ^ 0x5A for byte in data[60:300])
        path.write_bytes(data)
        assert run(["study", "table", str(study), "--episodes", "1"]) == 2
        assert "0000000b.zip: is no archive of a person" in capsys.readouterr().err
    path.rename(study / "b.zip")
    with pytest.warns(UserWarning, match=r"b\.zip is left out"):
        assert len(study_table(study, episodes=1).rows) == 1


@pytest.mark.parametrize("error", [zlib.error, ValueError, OSError, lzma.LZMAError])
def test_whatever_a_damaged_archive_raises_it_is_named(tmp_path, monkeypatch, error) -> None:
    def damaged(self, entry):
        raise error("damaged")

    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("person.json", "{}")
    monkeypatch.setattr(zipfile.ZipFile, "read", damaged)
    with pytest.raises(FormatError, match=r"a\.zip: is no archive of a person: damaged"):
        unpack(tmp_path / "a.zip", tmp_path / "out")


def test_who_lies_there_twice_is_not_counted_twice(tmp_path) -> None:
    study = tmp_path / "study"
    study.mkdir()
    person_of(study, "0000000a", answer="2", tmp_path=tmp_path)
    shutil.copy(study / "0000000a.zip", study / "0000000a (1).zip")
    said = r"each person once, got one in '0000000a \(1\)\.zip' and '0000000a\.zip'"
    with pytest.raises(InvalidArgumentError, match=said):
        study_table(study, episodes=1)


def test_counts_are_said_in_full_and_one_person_has_no_interval() -> None:
    row = dict.fromkeys(["own", "fitted", "taken-over", "practised"])
    row |= {"steps shown": 1534.0, "watched": 13100.0, "minutes": 13.24}
    said = str(StudyTable((row,), {}))
    assert "e+" not in said
    assert said.splitlines()[1].split()[-3:] == ["1534", "13100", "13.2"]
    assert "steps shown: 1534, 1" in said.splitlines()
    two = str(StudyTable((row, row | {"steps shown": 2534.0}), {}))
    assert "steps shown: 2034 (" in two


def test_what_people_write_is_no_formula_and_stays_in_its_row() -> None:
    said = [
        "=1+1",
        "+cmd|' /C calc'!A0",
        "-2+3",
        "@SUM(1)",
        " =1",
        "\t=1",
        "-0.5",
        "so,\nand \u2028so",
    ]
    trees = dict.fromkeys(["own", "fitted", "taken-over", "practised"])
    table = StudyTable(tuple(trees | {"answer 1": text} for text in [*said, -0.5, None]), {})
    cells = [row[-1] for row in csv.reader(io.StringIO(table.to_csv()))][1:]
    assert cells == [*(f"'{text}" for text in said[:6]), "-0.5", said[7], "-0.5", ""]
    assert "so, and so" in str(table).splitlines()[8]


def test_the_table_plays_in_an_environment_of_a_module(tmp_path, monkeypatch, capsys) -> None:
    study = tmp_path / "study"
    study.mkdir()
    person_of(study, "0000000a", answer="2", tmp_path=tmp_path)
    module = "import gymnasium, sys\nassert 'eutree/Evasion2-v0' in gymnasium.registry\n"
    (tmp_path / "registers_a_task.py").write_text(module)
    monkeypatch.chdir(tmp_path)
    line = ["study", "table", str(study), "--episodes", "2", "--json", "--import"]
    assert run([*line, "registers_a_task"]) == 0
    assert json.loads(capsys.readouterr().out)["people"][0]["person"] == "0000000a"
    assert "registers_a_task" in sys.modules
    assert run([*line, "registers_no_task"]) == 2
