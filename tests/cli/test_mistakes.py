"""Wrong command lines: each gives one line that says what is wrong, and writes nothing.

``mistakes.txt`` holds the command lines and their messages. After a change of a message, write
the file again and read the difference: ``python -m tests.cli.test_mistakes``.
"""

import json
import shlex
import shutil
from pathlib import Path

import pytest

from eutree.cli.main import run

GOLDEN = Path(__file__).with_name("mistakes.txt")


def golden():
    """Return the command lines with the messages that they must give."""
    entries = GOLDEN.read_text().split("$ ")[1:]
    return [(line, rest.strip()) for line, _, rest in (e.partition("\n") for e in entries)]


def make_folder_of_mistakes(folder, demonstrations, expert):
    """Put files into ``folder`` that are as they must be, and many that are not."""
    shutil.copytree(demonstrations, folder / "demos")
    shutil.copy(expert, folder / "expert.json")
    for name in ("nothing", "empty", "torn"):
        (folder / name).mkdir()
    for name in ("empty", "torn"):
        shutil.copy(demonstrations / "demonstrations.json", folder / name)
    episode = (demonstrations / "episode-00000.npz").read_bytes()
    (folder / "torn" / "episode-00000.npz").write_bytes(episode[: len(episode) // 2])
    text = expert.read_text()
    document = json.loads(text)
    (folder / "truncated.json").write_text(text[: len(text) // 2])
    (folder / "future.json").write_text(json.dumps(document | {"version": 99}))
    nodes = document["nodes"]
    threshold = json.dumps(nodes[0]["threshold"])
    (folder / "nan.json").write_text(text.replace(threshold, "NaN", 1))
    (folder / "infinite.json").write_text(text.replace(threshold, "1e999", 1))
    cycle = [nodes[0] | {"left": 0}, *nodes[1:]]
    (folder / "cyclic.json").write_text(json.dumps(document | {"nodes": cycle}))
    (folder / "text.txt").write_text("hello")
    line = ("learn", "--demos", "demos", "--episodes", 2, "--evaluation-episodes", 2)
    assert run([*map(str, line), "--out", "run"]) == 0
    assert run(["demos", "export", "demos", "good.csv"]) == 0
    rows = (folder / "good.csv").read_text().splitlines(keepends=True)
    cells = rows[1].split(",")
    numbers = [i for i, cell in enumerate(cells) if "." in cell]
    cells[numbers[0]] = "nan"
    (folder / "nan.csv").write_text(rows[0] + ",".join(cells) + "".join(rows[2:]))
    (folder / "ragged.csv").write_text("".join(rows[:3]) + "1,2\n")


def listing(folder):
    """Return every file of a folder with its content, and every folder."""
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.fixture(scope="module")
def place(tmp_path_factory, demonstrations, expert):
    folder = tmp_path_factory.mktemp("mistakes")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        make_folder_of_mistakes(folder, demonstrations, expert)
    return folder


def said(line, place, capsys):
    """Run a command line; return its exit code, and all that it said without the folder's name."""
    capsys.readouterr()
    try:
        code = run(shlex.split(line))
    except SystemExit as stop:
        code = stop.code
    captured = capsys.readouterr()
    return code, (captured.out + captured.err).replace(f"{place}/", "").strip()


@pytest.mark.promise(22)
@pytest.mark.parametrize(("line", "message"), golden(), ids=[line for line, _ in golden()])
def test_a_mistake_gives_one_line_and_writes_nothing(line, message, place, capsys, monkeypatch):
    monkeypatch.chdir(place)
    before = listing(place)
    code, text = said(line, place, capsys)
    assert (code, text) == (2, message)
    assert text.count("\n") == 0
    assert "Traceback" not in text
    assert listing(place) == before


@pytest.mark.promise(22)
def test_debug_shows_where(place, capsys, monkeypatch):
    """The control: the traceback that is looked for above is there with --debug."""
    monkeypatch.chdir(place)
    assert "Traceback" in said("evaluate missing.json --debug", place, capsys)[1]


def write_golden():
    """Write the messages that the command lines give now."""
    import contextlib
    import io
    import os
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        folder = Path(os.path.realpath(name))
        os.chdir(folder)
        run(["record", "eutree/Evasion2-v0", "--expert", "gate", "--episodes", "8", "--out", "d"])
        run(["fit", "d", "--out", "e.json"])
        (folder / "place").mkdir()
        os.chdir(folder / "place")
        make_folder_of_mistakes(folder / "place", folder / "d", folder / "e.json")
        entries = []
        for line, _ in golden():
            text = io.StringIO()
            with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
                code = run(shlex.split(line))
            message = text.getvalue().replace(f"{folder}/place/", "").strip()
            entries.append(f"$ {line}\n{message}\n" + ("" if code == 2 else f"EXIT CODE {code}\n"))
        os.chdir("/")
    GOLDEN.write_text("".join(entries))


if __name__ == "__main__":
    write_golden()
