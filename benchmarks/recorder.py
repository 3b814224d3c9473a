"""Measure the recorder's page in headless Chromium: pictures per second, and key to picture.

Run: python benchmarks/recorder.py [--seconds 20] [--busy 1] [--out docs/results/recorder.md]

The server runs in a process of its own, as it does for a person. CartPole (600 x 400 pixels) is
stepped at the wanted rate and never ends. A key's latency is counted in the page: from its event
to the drawing of the first picture that was made after a step which knew of it. Targets: 30
pictures a second, and at most 100 ms in 95 of 100 cases, on a machine with nothing else to do; 20 a
second and 150 ms with one core busy: ``--busy 1`` keeps one busy. The load stands beside each row.
"""

import argparse
import os
import platform
import random
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree  # noqa: F401 - registers the environments
from eutree.recording.browser import record_in_browser
from eutree.recording.events import SessionSettings
from eutree.recording.recorder import Recorder

BROWSERS = ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")
QUIET = (
    "--no-sandbox --headless=new --disable-gpu --disable-background-networking "
    "--disable-component-update --disable-sync --no-first-run"
)
WATCH = """() => {
  window.frames_drawn = [];
  window.latencies = [];
  new MutationObserver((changes) => {
    for (const { attributeName } of changes) {
      if (attributeName === "data-frame") window.frames_drawn.push(performance.now());
      else window.latencies.push(document.body.dataset.latency);
    }
  }).observe(document.body, { attributeFilter: ["data-frame", "data-latency"] });
}"""

PAGE = """# Speed of the recorder's page

Made by `python benchmarks/recorder.py` on {machine},
in headless Chromium: 600 x 400 pixels, JPEG. Key to picture is counted in the page, from the key's
event to the drawing of the first picture made after a step that knew of it (in Evasion, whose
decisions are a second apart: made after the recorder knew of it). Targets: 30 pictures a second,
and at most 100 ms in 95 of 100 cases, on a machine with nothing else to do; 20 a second and 150 ms
with one core busy. *Load*: processes that wanted a core, the mean of the minute before.

| task | load | wanted per s | drawn | gap: median / p99, ms | keys | picture: median / p95, ms |
|---|---|---|---|---|---|---|
{table}
"""


class Endless(gymnasium.Wrapper):
    """Starts again by itself and never says so."""

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(action)
        if terminated or truncated:
            observation, info = self.env.reset()
        return observation, float(reward), False, False, info


def serve(name: str, fps: float | None) -> None:
    env = gymnasium.make(name, render_mode="rgb_array")
    if name.startswith("CartPole"):
        env = Endless(env)
    with tempfile.TemporaryDirectory() as folder:
        settings = SessionSettings(fps=fps, countdown=0.0)
        recorder = Recorder(env, Path(folder) / "demos", settings=settings)
        record_in_browser(recorder, port=0, on_ready=lambda s: print(s.url, flush=True))


def measure(name: str, fps: float | None, seconds: float) -> tuple[str, ...]:
    """Return one row of the table."""
    from playwright.sync_api import sync_playwright

    command = [sys.executable, __file__, "--serve", name, "--fps", str(fps or 0)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        url = re.search(r"http://\S+", process.stdout.readline())[0]
        with sync_playwright() as playwright:
            path = next(path for path in BROWSERS if Path(path).exists())
            browser = playwright.chromium.launch(executable_path=path, args=QUIET.split())
            page = browser.new_page(viewport={"width": 1180, "height": 820})
            page.goto(url)
            page.locator("body[data-state=opening]").wait_for()
            page.keyboard.press("Enter")
            page.locator("body[data-state=playing]").wait_for()
            page.wait_for_timeout(1000)
            page.evaluate(WATCH)
            drawn, delays = act(page, seconds)
            browser.close()
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()
    gaps = np.diff(drawn)
    return (
        name,
        f"{os.getloadavg()[0]:.1f}",
        f"{30.0 if fps is None else fps:g}",
        f"{1000.0 / gaps.mean():.1f}",
        f"{np.median(gaps):.0f} / {np.percentile(gaps, 99):.0f}",
        str(len(delays)),
        f"{np.median(delays):.0f} / {np.percentile(delays, 95):.0f}",
    )


def act(page: Any, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Press keys for a while; return when pictures were drawn, and the keys' latencies, in ms."""
    pauses = random.Random(0)
    key = "ArrowRight" if "Evasion" in page.locator("#environment").inner_text() else "ArrowLeft"
    left = seconds
    while left > 0.0:
        for press in (page.keyboard.down, page.keyboard.up):
            press(key)
            pause = pauses.uniform(0.06, 0.14)
            page.wait_for_timeout(1000.0 * pause)
            left -= pause
    drawn = np.array(page.evaluate("() => window.frames_drawn"))
    seen = dict(text.split() for text in page.evaluate("() => window.latencies"))
    return drawn, np.array([float(value) for value in seen.values()])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--busy", type=int, default=0, help="cores to keep busy meanwhile")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--serve")
    parser.add_argument("--fps", type=float, default=0.0)
    arguments = parser.parse_args()
    if arguments.serve:
        serve(arguments.serve, arguments.fps or None)
        return
    spinning = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(arguments.busy)
    ]
    try:
        rows = [
            measure("CartPole-v1", 30.0, arguments.seconds),
            measure("CartPole-v1", 50.0, arguments.seconds),
            measure("eutree/Evasion2-v0", None, arguments.seconds / 2),
        ]
    finally:
        for process in spinning:
            process.kill()
            process.wait()
    machine = f"two shared {platform.machine()} cores, Python {platform.python_version()}"
    table = ["| " + " | ".join(row) + " |" for row in rows]
    text = PAGE.format(machine=machine, table="\n".join(table))
    print(text)
    if arguments.out:
        arguments.out.write_text(text)


if __name__ == "__main__":
    main()
