"""``eutree export``: files, standard output, JSON, and one line for each mistake."""

import json
import subprocess
from pathlib import Path

import pytest

from eutree.cli.main import run
from eutree.export import FORMATS, export
from eutree.policies import TreePolicy
from tests.export.policies import EVASION, policy_of, tree
from tests.export.readers import C_FLAGS
from tests.export.tools import need


@pytest.fixture
def policy(tmp_path: Path) -> TreePolicy:
    policy = policy_of(tree(9, 3), EVASION, statistics=True)
    policy.save(tmp_path / "policy.json")
    return policy


@pytest.mark.parametrize("format", FORMATS)
def test_file_holds_what_the_function_returns(
    format: str, policy: TreePolicy, tmp_path: Path, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    out = tmp_path / f"decide{FORMATS[format].suffix}"
    arguments = ["export", str(tmp_path / "policy.json"), "--format", format]
    content = export(policy, format)
    data = content if isinstance(content, bytes) else content.encode()
    assert run([*arguments, "--out", str(out), "--json"]) == 0
    printed = json.loads(capsysbinary.readouterr().out)
    assert printed["files"] == [str(out)]
    assert printed["bytes"] == len(data)
    assert out.read_bytes() == data
    assert run(arguments) == 0
    printed_data = capsysbinary.readouterr().out
    assert printed_data == (content if isinstance(content, bytes) else content.encode())


def test_source_header_and_self_test_compile_and_agree(policy: TreePolicy, tmp_path: Path) -> None:
    out = tmp_path / "evasion.c"
    arguments = [str(tmp_path / "policy.json"), "--out", str(out), "--header", "--self-test"]
    options = ["--number", "int32", "--scale", "position=1000", "--scale", "opponent_1=500"]
    assert run(["export", *arguments, *options]) == 0
    command = [need("gcc"), *C_FLAGS, "evasion.c", "evasion_test.c", "-o", "test"]
    subprocess.run(command, cwd=tmp_path, check=True)
    subprocess.run(["./test"], cwd=tmp_path, check=True, capture_output=True)
    assert "int evasion(const int32_t *observation)" in out.read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--format must be one of c, onnx,"),
        (["--format", "cpp"], "unknown format 'cpp'"),
        (["--format", "dot", "--name", "x"], "format dot takes no options, got 'name'"),
        (["--format", "c", "--header"], "--header and --self-test need --format c and --out"),
        (["--format", "c", "--number", "int32", "--scale", "x"], "--scale must be [FEATURE=]NUM"),
        (["--format", "onnx", "--json"], "--json with the binary format onnx needs --out"),
    ],
)
def test_mistakes_are_one_line(
    arguments: list[str],
    message: str,
    policy: TreePolicy,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["export", str(tmp_path / "policy.json"), *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("error: ")
    assert message in captured.err
    assert captured.err.count("\n") == 1


def test_content_in_json(
    policy: TreePolicy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["export", str(tmp_path / "policy.json"), "--format", "text", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["content"] == export(policy, "text")
