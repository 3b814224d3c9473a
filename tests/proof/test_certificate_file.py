"""A certificate on file, and its sentence on top of what is exported."""

import hashlib
import json

import pytest

from eutree.cli.main import run
from eutree.errors import FormatError
from eutree.policies import TreePolicy
from eutree.proof import load_certificate
from tests.proof.policies import BAD, GOOD, policy_of


@pytest.fixture
def files(tmp_path):
    policy_of(GOOD).save(tmp_path / "car.json")
    policy_of(BAD).save(tmp_path / "other.json")
    question = "stays in position <= 0.7 for 3 steps"
    line = ["prove", str(tmp_path / "car.json"), question, "--out", str(tmp_path / "proof.json")]
    assert run(line) == 0
    return tmp_path


def test_the_sentence_is_a_comment_of_every_export(files, capsys):
    sentence = json.loads((files / "proof.json").read_text())["sentence"]
    for name, opens in (("c", "/* "), ("python", "# "), ("st", "(* ")):
        out = files / f"out.{name}"
        line = ["export", str(files / "car.json"), "--format", name, "--out", str(out)]
        assert run(line) == 0
        plain = out.read_text()
        assert run([*line, "--certificate", str(files / "proof.json")]) == 0
        first, rest = out.read_text().split("\n", 1)
        assert rest == plain
        assert first.startswith(f"{opens}Certificate, proven (proof): {sentence}")


def test_no_sentence_about_doubles_stands_on_code_that_rounds(files, capsys):
    """It said "proven" on top of integers with which no episode arrived."""
    out = files / "car.c"
    line = ["export", str(files / "car.json"), "--out", str(out), "--certificate"]
    line += [str(files / "proof.json"), "--number"]
    assert run([*line, "int32", "--scale", "10"]) == 2
    assert "--number must be double or float with --certificate" in capsys.readouterr().err
    assert not out.exists()
    assert run([*line, "float"]) == 0
    begins = "/* Certificate of the tree in double precision, proven (proof): "
    assert out.read_text().startswith(begins)


def test_a_certificate_of_another_tree_and_what_is_none(files, capsys):
    line = ["export", str(files / "other.json"), "--format", "c", "--certificate"]
    assert run([*line, str(files / "proof.json")]) == 2
    assert "must be a certificate of this policy" in capsys.readouterr().err
    assert run([*line, str(files / "car.json")]) == 2
    assert "expected 'eutree/certificate', got 'eutree/policy'" in capsys.readouterr().err
    line = ["export", str(files / "car.json"), "--format", "svg", "--certificate"]
    assert run([*line, str(files / "proof.json")]) == 2
    assert "needs --format c, python, st" in capsys.readouterr().err


def test_the_page_of_the_tree_shows_its_certificate(files, capsys):
    page = files / "car.html"
    line = ["show", str(files / "car.json"), "--html", str(page), "--episodes", "0"]
    assert run(line) == 0
    assert 'id="certificate"' not in page.read_text()
    assert run(["prove", str(files / "car.json"), "--out", str(files / "whole.json")]) == 0
    assert run([*line, "--certificate", str(files / "whole.json")]) == 0
    text = page.read_text()
    assert "proven (proof): from every start of MountainCar-v0 it arrives within 108 steps" in text
    assert "<td>83 to 108</td>" in text
    assert text.count("<rect x=") == 320
    line[1] = str(files / "other.json")
    assert run([*line, "--certificate", str(files / "whole.json")]) == 2
    assert "must be a certificate of this policy" in capsys.readouterr().err


def test_a_certificate_is_of_the_tree_and_of_no_version(files, monkeypatch):
    kept = files / "proof.json"
    monkeypatch.setattr("eutree.files.documents.__version__", "9.9.9")
    policy = TreePolicy.load(files / "car.json")
    assert load_certificate(kept, policy).proven


def test_a_certificate_that_was_changed_by_hand_is_refused(files):
    kept = files / "proof.json"
    kept.write_text(kept.read_text().replace("for 3 steps", "for 300 steps"))
    with pytest.raises(FormatError, match="changed after eutree wrote it: prove again"):
        load_certificate(kept)


def test_first_certificates_have_no_checksum_and_the_hash_of_a_version(files):
    kept, policy = files / "proof.json", policy_of(GOOD)
    document = json.loads(kept.read_text())
    del document["checksum"]
    document["policy"] = hashlib.sha256(policy.to_bytes()).hexdigest()
    kept.write_text(json.dumps(document))
    assert load_certificate(kept, policy).proven
