"""A full disk, a read-only folder, a missing permission: one line, and earlier data intact."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import pytest

import eutree
from eutree.data import Demonstrations
from tests.patience import ENOUGH

pytestmark = pytest.mark.skipif(os.name == "nt", reason="needs POSIX permissions")

SOURCE = str(Path(eutree.__file__).parents[1])
LEARN = ("learn", "--demos", "{demos}", "--episodes", "3", "--evaluation-episodes", "2",
         "--front-steps", "0", "--out")  # fmt: skip
RECORD = ("record", "eutree/Evasion2-v0", "--expert", "gate", "--episodes", "2", "--out")
COMMANDS = {
    "learn": (*LEARN, "{place}/run"),
    "fit": ("fit", "{demos}", "--out", "{place}/expert.json"),
    "record": (*RECORD, "{place}/new"),
    "export": ("export", "{expert}", "--format", "c", "--out", "{place}/tree.c"),
    "demos export": ("demos", "export", "{demos}", "{place}/demos.csv"),
}

# Python as a user whom permissions bind: root gives up the right to pass over them, which takes
# effect in the program that it becomes.
BOUND = """
import ctypes, os, sys
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2
if os.geteuid() == 0:
    for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""


def call(*words):
    """Run Python in a process of its own; return what it has done."""
    environment = {**os.environ, "PYTHONPATH": SOURCE, "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True, text=True, env=environment, timeout=ENOUGH, check=False,
    )  # fmt: skip


def command(line, *before, **names):
    """Run a command line in a process of its own; return its exit code and standard error."""
    done = call(*before, "-m", "eutree", *(part.format(**names) for part in line))
    return done.returncode, done.stderr


EACH = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout
from eutree.cli.main import run
said = {}
for name, line in json.loads(sys.argv[1]).items():
    with redirect_stderr(io.StringIO()) as err, redirect_stdout(io.StringIO()):
        code = run(line)
    said[name] = code, err.getvalue()
print(json.dumps(said))
"""


def each_command(*before, **names):
    """Run all commands, one after the other in one process; yield exit code and standard error."""
    lines = {name: [part.format(**names) for part in line] for name, line in COMMANDS.items()}
    done = call(*before, "-c", EACH, json.dumps(lines))
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert list(said) == list(COMMANDS)
    yield from said.values()


def contents(folder):
    """Return every file of a folder with its content; locks aside, whose content is a number."""
    return {
        path: path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != ".lock"
    }


@pytest.mark.promise(10)
def test_a_read_only_folder_gives_one_line(tmp_path, demonstrations, expert):
    place = tmp_path / "place"
    place.mkdir()
    (place / "tree.c").write_text("earlier")
    place.chmod(0o555)
    names = {"demos": demonstrations, "expert": expert, "place": place}
    for code, err in each_command("-c", BOUND, **names):
        lines = [line for line in err.splitlines() if line.startswith("error: ")]
        assert code == 2, err
        assert lines == err.splitlines()[-1:]
        assert str(place) in lines[0]
        assert "no permission; choose another folder or change its permissions" in lines[0]
        assert "Traceback" not in err
    assert [path.name for path in place.iterdir()] == ["tree.c"]
    assert (place / "tree.c").read_text() == "earlier"


@pytest.mark.slow
@pytest.mark.promise(10)
def test_a_run_that_one_may_not_write_stays_as_it_is(tmp_path, demonstrations):
    names = {"demos": demonstrations, "place": tmp_path}
    assert command(COMMANDS["learn"], **names)[0] == 0
    before = contents(tmp_path / "run")
    (tmp_path / "run").chmod(0o555)
    code, err = command((*COMMANDS["learn"], "--resume"), "-c", BOUND, **names)
    assert code == 2
    assert err.splitlines()[-1].startswith("error: cannot write")
    assert "no permission" in err
    assert contents(tmp_path / "run") == before


@pytest.mark.promise(9)
def test_a_recording_that_is_killed_keeps_its_episodes(tmp_path):
    """After kill -9 in the 600th of 3,000 episodes there was nothing."""
    line = ["record", "eutree/Evasion2-v0", "--expert", "gate", "--episodes", "100000"]
    environment = {**os.environ, "PYTHONPATH": SOURCE}
    process = subprocess.Popen(
        [sys.executable, "-m", "eutree", *line, "--out", str(tmp_path / "demos")], env=environment
    )
    try:
        deadline = time.monotonic() + ENOUGH
        while len(list((tmp_path / "demos").glob("episode-*.npz"))) < 20:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.05)
    finally:
        process.kill()
        process.wait()
    kept = Demonstrations.load(tmp_path / "demos")
    assert len(kept) >= 20
    env = gymnasium.make("eutree/Evasion2-v0")
    again = eutree.record(env, eutree.experts.wait_at_crossing, episodes=20)
    pairs = zip(again, kept, strict=False)
    assert all(mine.equals(found) for mine, found in pairs)


@pytest.fixture
def small_disk(tmp_path):
    """Return a disk of one megabyte."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
    if sys.platform != "linux" or os.geteuid() != 0:
        pytest.skip("only root can mount a small disk; injected faults are tested in tests/files")
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no permission to mount a small disk; see tests/files for injected faults")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def fill(place):
    """Fill the disk to its last byte."""
    with open(place / "filling", "wb", buffering=0) as file:
        try:
            while file.write(bytes(4096)):
                pass
        except OSError:
            return


@pytest.mark.promise(10)
def test_a_full_disk_gives_one_line(small_disk, demonstrations, expert):
    (small_disk / "tree.c").write_text("earlier")
    fill(small_disk)
    names = {"demos": demonstrations, "expert": expert, "place": small_disk}
    for code, err in each_command(**names):
        assert code == 2, err
        lines = [line for line in err.splitlines() if line.startswith("error: ")]
        assert lines == err.splitlines()[-1:]
        assert "the disk is full; what was there before is intact" in lines[0]
    assert (small_disk / "tree.c").read_text() == "earlier"
    left = {path.name for path in small_disk.rglob("*")} - {"run"}
    assert left <= {"tree.c", "filling", ".lock", "config.json"}


@pytest.mark.slow
@pytest.mark.promise(10)
def test_a_disk_that_fills_up_during_a_run_leaves_a_run_that_goes_on(
    small_disk, demonstrations, tmp_path
):
    names = {"demos": demonstrations, "expert": None}
    assert command(COMMANDS["learn"], place=small_disk, **names)[0] == 0
    before = contents(small_disk / "run")
    fill(small_disk)
    longer = ("learn", "--demos", "{demos}", "--episodes", "6", "--evaluation-episodes", "2")
    code, err = command((*longer, "--out", "{place}/run", "--resume"), place=small_disk, **names)
    assert code == 2
    assert "the disk is full" in err.splitlines()[-1]
    assert contents(small_disk / "run") == before
    (small_disk / "filling").unlink()
    for place in (small_disk, tmp_path):
        code, err = command((*longer, "--out", "{place}/run", "--resume"), place=place, **names)
        assert code == 0, err
    for path in ("policy.json", "curve.csv"):
        assert (small_disk / "run" / path).read_text().count("\n") > 2
