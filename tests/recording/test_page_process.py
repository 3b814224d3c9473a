"""The recorder as a process with its page: signals, kill -9, other machines."""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import gymnasium
import pytest
from websockets.sync.client import connect

import eutree  # noqa: F401 - registers the environments
from eutree.data import Demonstrations
from eutree.interaction.episode import replay
from tests.patience import ENOUGH
from tests.training.processes import heed_interrupts

ROOT = Path(__file__).parents[2]


class Recording:
    """``eutree record`` as a process of its own, and a page made by hand before it."""

    def __init__(self, folder, environment="CartPole-v1", *options) -> None:
        command = [sys.executable, "-m", "eutree", "record", environment, "--port", "0"]
        self.process = subprocess.Popen(
            [*command, *options, "--out", str(folder)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
            preexec_fn=heed_interrupts,
        )
        self.said = []
        while not self.said or not self.said[-1].startswith("open "):
            self.said.append(self.process.stderr.readline())
            assert self.said[-1], self.said
        self.port, self.token = re.search(r":(\d+)/#(\S+)", self.said[-1]).groups()

    def connect(self):
        return connect(
            f"ws://127.0.0.1:{self.port}/socket",
            origin=f"http://127.0.0.1:{self.port}",
            subprotocols=["eutree", f"token.{self.token}"],
            open_timeout=ENOUGH,
        )

    def play(self, page, steps) -> int:
        """Start an episode and act until ``steps`` are known to be taken; return how many are."""
        page.send('{"type": "hello", "client": "page-one"}')
        page.send('{"type": "do", "name": "start"}')
        step, pressed = 0, False
        while step < steps:
            message = page.recv(timeout=ENOUGH)
            if isinstance(message, bytes):
                frame = int.from_bytes(message[:4], "big")
                page.send(f'{{"type": "drawn", "frame": {frame}}}')
                if not pressed:  # a task without an idle action begins with the first action key
                    page.send(
                        '{"type": "key", "sequence": 1, "key": "left", "down": true, '
                        f'"frame": {frame}}}'
                    )
                    pressed = True
            else:
                step = json.loads(message).get("step", step)
        return step


@contextmanager
def recording(folder, *options):
    """Start a recorder; it is dead at the end, so that a failing test waits for nothing."""
    recorder = Recording(folder, *options)
    try:
        yield recorder
    finally:
        recorder.process.kill()
        recorder.process.communicate()


@pytest.mark.promise(12)
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_the_recorder_in_order(tmp_path, number, code) -> None:
    """CartPole draws with SDL, which would take SIGTERM for itself."""
    with recording(tmp_path / "demos", "CartPole-v1", "--fps", "9") as recorder:
        with recorder.connect() as page:
            recorder.play(page, 3)
            recorder.process.send_signal(number)
            assert recorder.process.wait(ENOUGH) == code  # without waiting for the page to go
        assert "Traceback" not in recorder.process.stderr.read()
    (episode,) = Demonstrations.load(tmp_path / "demos").episodes
    assert episode.ending == "interrupted"
    assert len(episode) >= 3
    assert not list((tmp_path / "demos").glob("*.journal"))


@pytest.mark.promise(9)
@pytest.mark.parametrize("steps", [1, 7])
def test_kill_9_of_the_page_s_process_loses_at_most_the_step_in_flight(tmp_path, steps) -> None:
    folder = tmp_path / "demos"
    slow = ("eutree/Evasion2-v0", "--fps", "8")
    with recording(folder, *slow) as recorder, recorder.connect() as page:
        known = recorder.play(page, steps)
        recorder.process.kill()
        recorder.process.wait(ENOUGH)
    (episode,) = Demonstrations.load(folder).episodes
    assert (episode.ending, episode.kept) == ("interrupted", True)
    assert len(episode) in (known, known + 1)  # one more may have been taken and not yet shown
    assert (episode.terminated, episode.truncated) == (False, False)
    with recording(folder, "eutree/Evasion2-v0") as again:  # it goes on where it was
        assert "recovered interrupted episode 0" in again.said[0]
    (stored,) = Demonstrations.load(folder).episodes
    assert stored.equals(episode)
    assert replay(Demonstrations.load(folder), gymnasium.make("eutree/Evasion2-v0"))[0].is_equal


@pytest.mark.promise(23)
def test_other_machines_are_let_in_with_a_warning_only(tmp_path, proc) -> None:
    with recording(tmp_path / "a", "eutree/Evasion2-v0", "--host", "0.0.0.0") as recorder:
        warning, address = "".join(recorder.said[:-1]), recorder.said[-1]
        assert warning.startswith("warning: other machines can reach this page at 0.0.0.0")
        assert "unencrypted; whoever has" in " ".join(warning.split())
        assert "0.0.0.0" not in address  # but an address that others can open
        with recorder.connect() as page:
            recorder.play(page, 0)
        listening = (proc / "net" / "tcp").read_text()
        assert f" 00000000:{int(recorder.port):04X} " in listening
    with recording(tmp_path / "b", "eutree/Evasion2-v0") as recorder:
        assert [line.split()[0] for line in recorder.said] == ["open"]
        assert recorder.process.stderr.readline().startswith("from another machine, first: ssh -L")
