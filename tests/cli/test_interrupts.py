"""Ctrl-C where the compiler cannot raise it is not lost."""

import ctypes
import signal
import time

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
