"""Ctrl-C where the compiler cannot raise it, or an environment drops it, is not lost."""

import ctypes
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest

from eutree.cli.main import eutree, run
from tests.patience import ENOUGH


def test_an_interrupt_that_a_callback_drops_comes_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C while kernels were compiled was dropped by the compiler: the command ran on."""

    @ctypes.CFUNCTYPE(None)
    def callback() -> None:
        signal.raise_signal(signal.SIGINT)

    @click.command()
    def compiling() -> None:
        callback()
        time.sleep(ENOUGH)

    monkeypatch.setitem(eutree.commands, "compiling", compiling)
    monkeypatch.setattr(type(eutree), "get_command", lambda *_: compiling)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # test processes ignore it
    try:
        assert run(["compiling"]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert "interrupted" in capsys.readouterr().err.splitlines()


DEAF = """
import signal, gymnasium

class Deaf(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.observation_space.low, {}

    def step(self, action):
        try:
            signal.raise_signal(NUMBER)
        except KeyboardInterrupt:
            pass
        return self.observation_space.low, 0.0, False, False, {}

gymnasium.register("Deaf-v0", entry_point=Deaf)

def act(observation):
    return 0
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_an_environment_drops_is_heeded_after_its_step(
    tmp_path: Path, number: signal.Signals
) -> None:
    """SciPy's integrator drops it: `fit` in a plant of such equations could not be ended."""
    (tmp_path / "deaf.py").write_text(DEAF.replace("NUMBER", str(int(number))))
    line = ["record", "Deaf-v0", "--import", "deaf", "--expert", "deaf:act", "--out", "demos"]
    done = subprocess.run(
        [sys.executable, "-m", "eutree", *line, "--env-arg", "max_episode_steps=1000000"],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=ENOUGH,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert (done.returncode, done.stderr.splitlines()[-1]) == (128 + number, "interrupted")
