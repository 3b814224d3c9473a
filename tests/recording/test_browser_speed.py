"""The page is quick enough for a person, with slack for a busy machine."""

from pathlib import Path

import pytest
from benchmarks.recorder import BROWSERS, measure

from tests.report.browser import missing

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_pictures_come_and_answer_quickly(monkeypatch) -> None:
    if not any(Path(path).exists() for path in BROWSERS):
        missing("no Chromium is installed")
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "src"))
    _, _, _, drawn, _, keys, delays = measure("CartPole-v1", 30.0, 6.0)
    assert float(drawn) >= 20.0  # 30 on a quiet machine
    assert int(keys) >= 40
    assert float(delays.split("/")[1]) <= 250.0  # 100 ms on a quiet machine
