"""Make recorder.gif: the ten minutes from the first episode to one's own tree, in half a minute.

Run: PYTHONPATH=src python docs/images/make_recorder_animation.py

A scripted person plays the real page in headless Chromium, five episodes at four times the pace;
what is shown is the page, nothing is drawn in. Needs Playwright, Chromium and Pillow.
"""

import os
import re
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path
from typing import Any

from make_recorder_pictures import CHROMIUM, HERE, PATIENCE, QUIET, Page
from PIL import Image

WIDTH, COLOURS = 640, 128
STILL, MOVING = 1800, 260  # milliseconds that a picture stays


class Film:
    """Pictures of a page, and how long each stays."""

    def __init__(self, page: Any) -> None:
        self._page = page
        self.frames: list[Image.Image] = []
        self.durations: list[int] = []

    def take(self, duration: int = STILL) -> None:
        picture = Image.open(BytesIO(self._page.screenshot())).convert("RGB")
        height = round(WIDTH * picture.height / picture.width)
        self.frames.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))
        self.durations.append(duration)

    def play(self, page: Page, *, waiting: int, going: int) -> None:
        """Play an episode: wait for some pictures, then go until it ends."""
        page.press("Enter").until("playing")
        for number in range(waiting + going):
            if number == waiting:
                page.page.keyboard.down("Space")
            if page.page.locator("body[data-state=playing]").count():
                self.take(MOVING)
            page.rest(0.2)
        page.until("review").page.keyboard.up("Space")
        page.rest(0.5)

    def save(self, path: Path) -> None:
        """Write the animation with one palette, so that only what moves takes room.

        Half of the palette are the commonest colours as they are, so that the page keeps its own;
        the other half covers all others, however few pixels have them: opponents are small.
        """
        width, height = self.frames[0].size
        some = self.frames[:: max(1, len(self.frames) // 6)]
        sheet = Image.new("RGB", (width, height * len(some)))
        for number, frame in enumerate(some):
            sheet.paste(frame, (0, number * height))
        half = COLOURS // 2
        counts = sheet.getcolors(width * height * len(some)) or []
        common = [colour for _, colour in sorted(counts, reverse=True)[:half]]
        covering = sheet.quantize(half, method=Image.Quantize.MAXCOVERAGE).getpalette() or []
        palette = Image.new("P", (1, 1))
        palette.putpalette([channel for colour in common for channel in colour] + covering)
        first, *rest = [
            frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in self.frames
        ]
        first.save(path, save_all=True, append_images=rest, duration=self.durations, loop=0,
                   optimize=True)  # fmt: skip


def main() -> None:
    """Play, film, write."""
    from playwright.sync_api import sync_playwright

    command = [sys.executable, "-m", "eutree", "record", "eutree/Evasion2-v0", "--web", "--fps"]
    command += ["4", "--port", "0", "--episodes", "5", "--out", "demos"]
    own = {**os.environ, "PYTHONPATH": str(HERE.parents[1] / "src")}
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder, env=own)
        url = re.search(r"open (http://\S+)", process.stderr.readline())[1]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET.split())
        page = Page(browser, url, color_scheme="light", viewport={"width": 1180, "height": 810})
        film = Film(page.page)
        film.take()
        film.play(page, waiting=3, going=12)
        film.take()
        film.play(page, waiting=1, going=8)
        while page.page.locator("body").get_attribute("data-saved") < "5":
            page.cross(wait=0.6)
        film.take()
        page.press("Enter").page.locator("body[data-tree=ready]").wait_for(timeout=10.0 * PATIENCE)
        page.rest(0.5)
        film.take(2 * STILL)
        practise = page.page.get_by_role("button", name="Let it practise")
        if practise.count():
            practise.click()
            page.page.locator("body[data-tree=practising]").wait_for(timeout=PATIENCE)
            film.take()
            ready = page.page.locator("body[data-tree=ready]")
            ready.wait_for(timeout=20.0 * PATIENCE)
            page.rest(0.5)
            film.take(2 * STILL)
        page.press("Escape").until("finished")
        browser.close()
        process.wait()
    film.save(HERE / "recorder.gif")


if __name__ == "__main__":
    main()
