"""Whole files or nothing: the old content or the new after every fault."""

import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from eutree.errors import FileError, FormatError
from eutree.files import atomic
from tests.files.faults import Fault, faults_until_success, use_operations

OLD, NEW = b"old " * 5000, b"new " * 6000


@pytest.mark.promise(7)
def test_a_fault_at_every_operation_leaves_the_old_or_the_new_file(tmp_path):
    path = tmp_path / "file"

    def check(n, succeeded):
        content = path.read_bytes()
        assert content in (OLD, NEW)
        assert [p.name for p in tmp_path.iterdir()] == ["file"], "leftovers"
        if not succeeded and content == OLD:
            path.write_bytes(OLD)

    path.write_bytes(OLD)
    count = faults_until_success(lambda: atomic.write_bytes(path, NEW), check)
    assert count > 6  # four writes, two fsyncs, one replace
    assert path.read_bytes() == NEW


@pytest.mark.promise(7)
def test_the_fault_test_catches_a_plain_write(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(OLD)

    def plain():
        with open(path, "wb") as file:
            atomic.write_all(file.fileno(), NEW)

    with use_operations(Fault(3)), pytest.raises(OSError, match="space"):
        plain()
    assert path.read_bytes() not in (OLD, NEW)


EXIT = """
import os, sys
from eutree.files import atomic
from tests.files.faults import Operations, use_operations
class Exit(Operations):
    left = int(sys.argv[2])
    def step(self):
        self.left -= 1
        if self.left == 0:
            os._exit(9)
    def write(self, descriptor, data):
        self.step()
        return os.write(descriptor, data[:9000])
    def fsync(self, descriptor):
        self.step()
    def replace(self, source, target):
        self.step()
        os.replace(source, target)
with use_operations(Exit()):
    atomic.write_bytes(sys.argv[1], b"new " * 6000)
"""


def start(code, *arguments):
    environment = {**os.environ, "PYTHONPATH": "src"}
    return subprocess.Popen([sys.executable, "-c", code, *map(str, arguments)], env=environment)


@pytest.mark.promise(7)
def test_a_process_that_dies_at_any_operation_leaves_the_old_or_the_new_file(tmp_path):
    for n in range(1, 20):
        folder = tmp_path / str(n)
        folder.mkdir()
        path = folder / "file"
        path.write_bytes(OLD)
        code = start(EXIT, path, n).wait()
        assert path.read_bytes() in (OLD, NEW)
        orphans = [p for p in folder.iterdir() if p != path]
        atomic.write_bytes(folder / "other", b"")
        assert not any(orphan.exists() for orphan in orphans), "orphans must be cleaned up"
        if code == 0:
            assert n > 4
            return
    raise AssertionError("never succeeded")


KILLED = """
import sys
from eutree.files import atomic
contents = [letter.encode() * 400_000 for letter in "ab"]
print("ready", flush=True)
for k in range(10**9):
    {write}
"""
ATOMIC = "atomic.write_bytes(sys.argv[1], contents[k % 2])"
PLAIN = "open(sys.argv[1], 'wb').write(contents[k % 2])"


def _kills(folder, write, kills, rng):
    """Kill a process that writes without end, many times; return how often the file was bad."""
    path, bad = folder / "file", 0
    path.write_bytes(b"a" * 400_000)
    for _ in range(kills):
        process = subprocess.Popen(
            [sys.executable, "-c", KILLED.format(write=write), str(path)],
            env={**os.environ, "PYTHONPATH": "src"},
            stdout=subprocess.PIPE,
        )
        with process.stdout:
            process.stdout.readline()
            time.sleep(rng.random() * 0.05)
            process.send_signal(signal.SIGKILL)
            process.wait()
        content = path.read_bytes()
        bad += content not in (b"a" * 400_000, b"b" * 400_000)
    return bad


@pytest.mark.promise(7)
@pytest.mark.parametrize(
    "kills", [10, pytest.param(200, marks=[pytest.mark.slow, pytest.mark.timeout(900)])]
)
def test_kill_9_leaves_a_whole_file(tmp_path, kills):
    import random

    assert _kills(tmp_path, ATOMIC, kills, random.Random(1)) == 0


@pytest.mark.promise(7)
def test_the_kill_test_catches_a_plain_write(tmp_path):
    import random

    rng = random.Random(2)
    assert any(_kills(tmp_path, PLAIN, 1, rng) for _ in range(60))


@pytest.mark.promise(10)
def test_every_obstacle_gives_one_clear_line(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_bytes(b"")
    os.mkfifo(tmp_path / "pipe")
    cases = {
        "missing/file": "folder .*missing does not exist",
        "folder": "is a folder",
        "file/below": "not a folder|does not exist|is a file",
        "pipe": "not a regular file",
        "x" * 300: "too long",
        "null\0": "null",
    }
    for name, message in cases.items():
        with pytest.raises(FileError, match=message) as caught:
            atomic.write_bytes(tmp_path / name, b"x")
        assert "\n" not in str(caught.value)


@pytest.mark.promise(10)
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX permissions")
def test_a_read_only_folder_gives_one_clear_line(tmp_path):
    path = tmp_path / "closed" / "file"
    path.parent.mkdir()
    path.write_bytes(OLD)
    code = (
        "import os, sys\n"
        "from eutree.files import atomic\n"
        "if os.geteuid() == 0: os.setuid(65534)\n"
        "try: atomic.write_bytes(sys.argv[1], b'new')\n"
        "except atomic.FileError as error: print(error); sys.exit(3)\n"
    )
    for folder in (path.parent, *path.parent.parents):
        if folder.owner() == path.owner() and folder != Path("/"):
            folder.chmod(folder.stat().st_mode | 0o011)
    path.parent.chmod(0o555)
    environment = {**os.environ, "PYTHONPATH": "src"}
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, str(path)], env=environment, capture_output=True, text=True
        )
    finally:
        path.parent.chmod(0o755)
    assert done.returncode == 3, done.stderr
    assert "no permission" in done.stdout
    assert done.stdout.count("\n") == 1
    assert path.read_bytes() == OLD


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert atomic.read_bytes(path, limit=5) == b"12345"
    with pytest.raises(FormatError, match="too large: 5 bytes, more than 4"):
        atomic.read_bytes(path, limit=4)
    with pytest.raises(FileError, match="does not exist"):
        atomic.read_bytes(tmp_path / "none", limit=4)
    with pytest.raises(FileError, match=r"folder|regular"):
        atomic.read_bytes(tmp_path, limit=4)
    with pytest.raises(FileError, match="not a regular file"):
        atomic.read_bytes("/dev/zero", limit=4)


def test_permissions_and_links_survive(tmp_path):
    path, link = tmp_path / "file", tmp_path / "link"
    path.write_bytes(OLD)
    path.chmod(0o640)
    link.symlink_to(path)
    atomic.write_bytes(link, NEW)
    assert link.is_symlink()
    assert path.read_bytes() == NEW
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_orphans_of_the_living_and_of_other_machines_stay(tmp_path):
    mine = atomic.temporary_path(tmp_path / "file")
    other = tmp_path / f".file.00000000-999999999-0{atomic.TEMPORARY_SUFFIX}"
    dead = Path(str(mine).replace(f"-{os.getpid()}-", "-999999999-"))
    for path in (mine, other, dead, tmp_path / "file"):
        path.write_bytes(b"")
    assert atomic.remove_orphans(tmp_path) == [dead]
    assert mine.exists()
    assert other.exists()


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    target = tmp_path / "folder"
    files = {"one": OLD, "two": NEW}

    def check(n, succeeded):
        names = sorted(p.name for p in tmp_path.iterdir())
        assert names in ([], ["folder"]), names
        if names:
            assert {p.name: p.read_bytes() for p in target.iterdir()} == files
        if not succeeded and names:  # the last fsync failed: the folder is there already
            for path in target.iterdir():
                path.unlink()
            target.rmdir()

    faults_until_success(lambda: atomic.write_folder(target, files), check)
    with pytest.raises(FileError, match="not an empty folder"):
        atomic.write_folder(target, files)


SMALL_DISK = """
mount -t tmpfs -o size=1m none "$1" || exit 77
cd "$1"
"$2" - <<'END'
import os, sys
from eutree.files import atomic
from eutree.errors import FileError
atomic.write_bytes("file", b"o" * 400_000)
try:
    atomic.write_bytes("file", b"n" * 700_000)
except FileError as error:
    print(error)
assert open("file", "rb").read() == b"o" * 400_000
assert os.listdir(".") == ["file"], os.listdir(".")
atomic.write_bytes("file", b"n" * 300_000)
assert open("file", "rb").read() == b"n" * 300_000
END
"""


@pytest.mark.promise(10)
def test_a_disk_that_is_really_full(tmp_path):
    command = ["unshare", "--mount", "--map-root-user", "sh", "-c", SMALL_DISK, "sh"]
    source = str(Path("src").resolve())
    try:
        done = subprocess.run(
            [*command, str(tmp_path), sys.executable],
            env={**os.environ, "PYTHONPATH": source},
            capture_output=True,
            text=True,
        )
    except FileNotFoundError:
        pytest.skip("there is no program unshare to mount a small disk with")
    if done.returncode == 77 or "unshare" in done.stderr:
        pytest.skip("mounting a small disk is not allowed here")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ("cannot write file: the disk is full; what was there before is intact\n")
