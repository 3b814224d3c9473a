"""From the README to one's own expert tree: a new person with scripted hands, at real speed.

    PYTHONPATH=src python benchmarks/ten_minutes.py

Opens the page that `eutree record ... --web` prints in headless Chromium, records fifteen episodes
at speed 1 (Space is held where the gate demonstrator would go), and runs the commands that the page
and its docs name. The hands read the state from `--hud`, which the page shows as text. Prints how
long each part took.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import gymnasium
import numpy as np
from playwright.sync_api import sync_playwright

import eutree

PATIENCE = 60_000.0
ROOT = Path(__file__).parents[1]


def sensed(page) -> np.ndarray:
    """Return what the page shows of the observation."""
    cells = page.locator("#numbers td.right").all_inner_texts()
    return np.array([float(cell.split()[0]) for cell in cells])


def record_one(page, hands, kind: str) -> str:
    """Play an episode: look ten times a second, press and let go of Space."""
    page.keyboard.press("Enter")
    page.locator("body[data-state=playing]").wait_for(timeout=PATIENCE)
    held = False
    while page.locator("body").get_attribute("data-state") == "playing":
        wants = bool(hands.predict(sensed(page))[0])
        if wants != held:
            (page.keyboard.down if wants else page.keyboard.up)("Space")
            held = wants
        page.wait_for_timeout(100.0)
    if held:
        page.keyboard.up("Space")
    page.locator(f"body[data-state={kind}]").wait_for(timeout=PATIENCE)
    page.wait_for_timeout(900.0)
    return page.locator("#title").inner_text()


def run(folder: Path, *arguments: str) -> str:
    """Run a command line in ``folder`` and print it with what it says and how long it took."""
    began = time.monotonic()
    command = [sys.executable, "-m", "eutree", *arguments]
    own = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(command, cwd=folder, env=own, capture_output=True, text=True, check=False)
    print(f"$ eutree {' '.join(arguments)}    [{time.monotonic() - began:.0f} s]")
    print(done.stdout + done.stderr, flush=True)
    assert done.returncode == 0
    return done.stdout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=15)
    parser.add_argument("--pictures", type=Path, help="Folder for a screenshot of each screen.")
    arguments = parser.parse_args()
    hands = eutree.experts.wait_at_crossing(gymnasium.make("eutree/Evasion2-v0"))
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        line = [sys.executable, "-m", "eutree", "record", "eutree/Evasion2-v0", "--web", "--hud"]
        line += ["--episodes", str(arguments.episodes), "--port", "0", "--out", "my-demos"]
        own = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        recorder = subprocess.Popen(line, cwd=folder, env=own, stderr=subprocess.PIPE, text=True)
        url = re.search(r"open (http://\S+)", recorder.stderr.readline())[1]
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1180, "height": 810})
        page.goto(url)
        page.locator("body[data-state=opening]").wait_for(timeout=PATIENCE)
        results = []
        for number in range(arguments.episodes):
            results.append(record_one(page, hands, "review"))
            if arguments.pictures is not None and number in (0, arguments.episodes - 1):
                page.screenshot(path=arguments.pictures / f"after-{number + 1}.png")
        page.keyboard.press("Enter")
        page.locator("body[data-state=finished]").wait_for(timeout=PATIENCE)
        named = page.locator("#command").inner_text()
        print(f"{len(results)} episodes in {time.monotonic() - began:.0f} s: {results}")
        print(f"the page names: {named}", flush=True)
        if arguments.pictures is not None:
            page.screenshot(path=arguments.pictures / "finished.png")
        browser.close()
        recorder.wait(30)
        run(folder, "demos", "check", "my-demos")
        for line in named.splitlines():
            run(folder, *line.split()[1:])
        run(folder, "evaluate", "expert.json", "--episodes", "1000")
    print(f"in all {(time.monotonic() - began) / 60:.1f} minutes")


if __name__ == "__main__":
    main()
