"""Runs of ``eutree learn`` in processes of their own, to be killed, and the bytes they leave."""

import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import eutree
from tests.patience import ENOUGH

ARTEFACTS = (
    "policy.json",
    "expert.json",
    "curve.csv",
    "progress.csv",
    "events.jsonl",
    "checkpoint.npz",
)
SOURCE = Path(eutree.__file__).parents[1]
COMMAND = "from eutree.__main__ import main; main()"

# As the command line, but it ends at any instruction whatever, as by kill -9, when it has worked
# for so long since its first checkpoint: of its own time, so that other work on the machine counts
# for nothing.
KILLED = """
import signal
from eutree.files import atomic

whole = atomic.write_bytes

def and_then_time_runs(path, data):
    whole(path, data)
    if path.name == "checkpoint.npz":
        atomic.write_bytes = whole
        signal.setitimer(signal.ITIMER_PROF, {seconds})

atomic.write_bytes = and_then_time_runs
"""
KILL = -signal.SIGPROF  # the exit code of a process that the timer has killed

# As the command line, but it stops after its first checkpoint as if by Ctrl-Z.
STOPPED = """
import os, signal
from eutree.files import atomic

whole = atomic.write_bytes

def and_stop(path, data):
    whole(path, data)
    if path.name == "checkpoint.npz":
        os.kill(os.getpid(), signal.SIGSTOP)

atomic.write_bytes = and_stop
"""

# As the command line, but an archive's content is replaced in place, and it dies in the middle.
TORN = """
import os, signal
from eutree.files import atomic

whole = atomic.write_bytes

def torn(path, data):
    if path.suffix != ".npz":
        whole(path, data)
        return
    with open(path, "wb") as file:
        file.write(data[: len(data) // 2])
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)

atomic.write_bytes = torn
"""


def heed_interrupts():
    """Undo what a shell does to a job in the background: let it ignore SIGINT."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(*arguments, code=COMMAND, **environment):
    """Start a command line in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(SOURCE), **environment},
        preexec_fn=heed_interrupts,
    )


def finish(process, timeout=ENOUGH):
    """Wait for a process; return its exit code and what it said on standard error."""
    _, err = process.communicate(timeout=timeout)
    return process.returncode, err


def wait_for_new(path, before, process, timeout=ENOUGH):
    """Wait until a file is another than ``before`` (see ``identity``), or the process has ended."""
    limit = time.monotonic() + timeout
    while identity(path) == before and process.poll() is None:
        if time.monotonic() > limit:
            raise TimeoutError(f"{path} did not change within {timeout} s")
        time.sleep(0.002)


def identity(path):
    """Return what tells one written file from the next under the same name."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_ino, status.st_mtime_ns


def digests(folder):
    """Return the SHA-256 of each artefact of a run folder."""
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in ARTEFACTS}
