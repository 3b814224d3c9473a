"""From `eutree record --web` to a tree that succeeds: a player who sees only the page's picture.

    PYTHONPATH=src:. python -m benchmarks.ten_minutes [--seed 0] [--delay 0.2]

Opens the page in headless Chromium and plays fifteen episodes at speed 1: it finds the blue disc,
the red ones and the orange lines by their colours in what is drawn, 200 ms late, waits at a line
until the disc behind it is near an end of its path, and holds or releases Space. Then it presses
*Make my tree*, and *Let it practise* where that is offered. Prints how long each part took, and
plays 1,000 episodes of the tree in the end.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import sync_playwright

PATIENCE = 120_000.0
ROOT = Path(__file__).parents[1]
CHROMIUM = "/usr/bin/chromium"

# Mean places of pixels near a colour: the agent's blue, the goal's green, the lines' orange, red.
LOOK = """() => {
  const canvas = document.getElementById("picture");
  const { width, height } = canvas;
  const data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
  const colours = { blue: [38, 98, 196], orange: [214, 150, 40], red: [222, 78, 62] };
  const found = { blue: {}, orange: {}, red: {} };  // colour -> column of 20 pixels -> sums
  for (let y = 0; y < height; y += 2) {
    for (let x = 0; x < width; x += 1) {
      const at = 4 * (y * width + x);
      for (const [name, [r, g, b]] of Object.entries(colours)) {
        const [red, green, blue] = data.subarray(at, at + 3);
        if (Math.abs(red - r) + Math.abs(green - g) + Math.abs(blue - b) > 80) continue;
        const sums = (found[name][Math.round(x / 20)] ||= [0, 0, 0]);
        sums[0] += 1; sums[1] += x; sums[2] += y;
      }
    }
  }
  const places = {};
  for (const [name, columns] of Object.entries(found)) {
    places[name] = Object.values(columns).map(([n, x, y]) => [n, x / n, y / n]);
  }
  return { state: document.body.dataset.state, ...places };
}"""


def merged(spots: list[list[float]], within: float = 24.0) -> list[tuple[float, float]]:
    """Return the centres of groups of near spots, weighted by their pixels."""
    groups: list[list[float]] = []
    for count, x, y in sorted(spots, key=lambda spot: spot[1]):
        if groups and abs(groups[-1][1] / groups[-1][0] - x) < within:
            group = groups[-1]
            group[0], group[1], group[2] = (
                group[0] + count,
                group[1] + count * x,
                group[2] + count * y,
            )
        else:
            groups.append([count, count * x, count * y])
    return [(x / count, y / count) for count, x, y in groups if count >= 4]


class PixelPlayer:
    """Plays 2-Evasion by its picture.

    Args:
        page: The recorder's page.
        delay: Seconds from what is drawn to the key.
    """

    METRE = 15.0  # pixels

    def __init__(self, page, *, delay: float = 0.2, margin: float = 2.6, wait: float = 8.3) -> None:
        self.page, self.delay = page, delay
        self.margin, self.wait = margin * self.METRE, wait * self.METRE
        self.lines: list[float] = []
        self.n_pauses = 0

    def wants_to_go(self, seen: dict) -> bool:
        """Return whether to hold Space, from one look at the picture."""
        if not seen["blue"]:
            return False  # in a collision, or at the goal
        agent = max(merged(seen["blue"]), key=lambda spot: -spot[0])
        for line in self.lines:
            if not line - self.margin <= agent[0] < line:
                continue
            behind = [spot for spot in merged(seen["red"]) if 0 < spot[0] - line < 4 * self.METRE]
            if any(abs(y - agent[1]) < self.wait for _, y in behind):
                return False
        return True

    def play(self) -> str:
        """Play one episode, from Enter to the page's word on how it ended."""
        lines = [spot[0] for spot in merged(self.page.evaluate(LOOK)["orange"])]
        self.lines = self.lines or lines[:2]
        self.page.keyboard.press("Enter")
        self.page.locator("body:is([data-state=countdown], [data-state=playing])").wait_for()
        looks: list[tuple[float, bool]] = []
        held = False
        while True:
            seen = self.page.evaluate(LOOK)
            if seen["state"] == "paused":  # the machine was too busy to draw: go on
                held = False
                self.n_pauses += 1
                self.page.keyboard.up("Space")
                self.page.keyboard.press("Enter")
                self.page.locator("body:not([data-state=paused])").wait_for()
            elif seen["state"] not in ("countdown", "playing"):
                break
            now = time.monotonic()
            looks.append((now, self.wants_to_go(seen)))
            known = [wants for when, wants in looks if when <= now - self.delay]
            if known and known[-1] != held:
                held = known[-1]
                (self.page.keyboard.down if held else self.page.keyboard.up)("Space")
            self.page.wait_for_timeout(20.0)
        if held:
            self.page.keyboard.up("Space")
        self.page.wait_for_timeout(900.0)
        return self.page.locator("#title").inner_text()

    def make_tree(self) -> str:
        """Press the last button and wait for the verdict."""
        self.page.locator("#buttons button[data-command=make]").click()
        return self._verdict()

    def practise(self) -> str | None:
        """Press the button for practice if it is offered, and wait for the verdict."""
        button = self.page.locator("#tree-buttons button[data-command=practise]")
        if not button.count():
            return None
        button.click()
        self.page.locator("body[data-tree=practising]").wait_for(timeout=PATIENCE)
        return self._verdict()

    def leave(self) -> None:
        """Stop watching the tree, and finish."""
        self.page.locator("body[data-state=watching]").wait_for(timeout=PATIENCE)
        for state in ("review", "finished"):
            self.page.keyboard.press("Escape")
            self.page.locator(f"body[data-state={state}]").wait_for(timeout=PATIENCE)

    def _verdict(self) -> str:
        settled = self.page.locator("body:is([data-tree=ready], [data-tree=failed])")
        settled.wait_for(timeout=10.0 * PATIENCE)
        return self.page.locator("#verdict").inner_text()


@contextmanager
def recording(folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen, str]]:
    """Start `eutree record` in ``folder``; yield its process and the page's address."""
    line = [sys.executable, "-m", "eutree", "record", "eutree/Evasion2-v0", "--web", "--port", "0"]
    own = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    process = subprocess.Popen(
        [*line, *options, "--out", "my-demos"],
        cwd=folder,
        env=own,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process, re.search(r"open (http://\S+)", process.stderr.readline())[1]
    finally:
        process.kill()
        process.communicate()


def run(folder: Path, *arguments: str) -> str:
    """Run a command line in ``folder`` and print it with what it says and how long it took."""
    began = time.monotonic()
    command = [sys.executable, "-m", "eutree", *arguments]
    own = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    ran = subprocess.run(command, cwd=folder, env=own, capture_output=True, text=True, check=False)
    print(f"$ eutree {' '.join(arguments)}    [{time.monotonic() - began:.0f} s]")
    print(ran.stdout + ran.stderr, flush=True)
    assert ran.returncode == 0
    return ran.stdout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=15)
    parser.add_argument("--delay", type=float, default=0.2)
    parser.add_argument("--seed", type=int, default=0, help="of the recorded episodes")
    arguments = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        options = ("--episodes", str(arguments.episodes), "--seed", str(arguments.seed))
        with recording(folder, *options) as (process, url):
            browser = playwright.chromium.launch(
                executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"]
            )
            page = browser.new_page(viewport={"width": 1180, "height": 810})
            page.goto(url)
            page.locator("body[data-state=opening][data-frame]").wait_for(timeout=PATIENCE)
            player = PixelPlayer(page, delay=arguments.delay)
            results = [player.play() for _ in range(arguments.episodes)]
            minutes = (time.monotonic() - began) / 60.0
            print(f"{len(results)} episodes in {minutes:.1f} minutes: {results}")
            print(f"{player.n_pauses} pauses because the machine was busy", flush=True)
            print(f"the page says: {player.make_tree()}", flush=True)
            while (verdict := player.practise()) is not None:
                print(f"and after practice: {verdict}", flush=True)
                if (time.monotonic() - began) > 1200.0:
                    break
            minutes = (time.monotonic() - began) / 60.0
            print(f"a tree after {minutes:.1f} minutes in all", flush=True)
            evaluate = page.locator("#commands code").nth(1).inner_text()
            player.leave()
            browser.close()
            process.wait(30)
        run(folder, "demos", "stats", "my-demos")
        run(folder, *evaluate.split()[1:])


if __name__ == "__main__":
    main()
