"""Make the pictures of recording.md: its page in headless Chromium.

Run: PYTHONPATH=src python docs/images/make_recorder_pictures.py

A scripted person drives the real programs; the pictures land beside this file.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
CHROMIUM = "/usr/bin/chromium"
QUIET = (
    "--no-sandbox --headless=new --disable-gpu --disable-background-networking "
    "--disable-component-update --disable-sync --no-first-run"
)
PATIENCE = 30_000.0


class Page:
    """The recorder's page, and a person before it."""

    def __init__(self, browser: Any, url: str, **options: Any) -> None:
        self.page = browser.new_page(**options)
        self.page.goto(url)
        self.until("opening")

    def until(self, state: str) -> "Page":
        self.page.locator(f"body[data-state={state}]").wait_for(timeout=PATIENCE)
        return self

    def rest(self, seconds: float) -> "Page":
        self.page.wait_for_timeout(1000.0 * seconds)
        return self

    def take(self, name: str, *, whole: bool = False) -> "Page":
        self.rest(0.3)
        self.page.screenshot(path=HERE / f"recorder-{name}.png", full_page=whole)
        return self

    def press(self, key: str) -> "Page":
        self.page.keyboard.press(key)
        return self

    def cross(self, *, wait: float = 0.0) -> "Page":
        """Record an episode when the last one is over: wait, then go."""
        self.page.locator("body[data-state=opening], body[data-state=review]").wait_for()
        self.rest(0.9).press("Enter").until("playing").rest(wait)
        self.page.keyboard.down("Space")
        self.until("review").page.keyboard.up("Space")
        return self.rest(0.9)


def picture_the_tree(page: Page, size: Any) -> None:
    """Let the tree practise where that is offered, and show it on two screens."""
    practise = page.page.get_by_role("button", name="Let it practise")
    if practise.count():
        practise.click()
        page.page.locator("body[data-tree=practising]").wait_for(timeout=PATIENCE)
        page.page.locator("body[data-tree=ready]").wait_for(timeout=10.0 * PATIENCE)
    page.take("tree", whole=True)
    page.page.set_viewport_size({"width": 1920, "height": 1080})
    page.page.evaluate("() => scrollTo(0, 0)")
    page.take("wide")
    page.page.set_viewport_size(size)


def picture_the_page(folder: Path) -> None:
    from playwright.sync_api import sync_playwright

    command = [sys.executable, "-m", "eutree", "record", "eutree/Evasion2-v0", "--fps"]
    command += ["4", "--port", "0", "--episodes", "5", "--out", "demos"]
    own = {**os.environ, "PYTHONPATH": str(HERE.parents[1] / "src")}
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder, env=own)
    url = re.search(r"open (http://\S+)", process.stderr.readline())[1]
    wide = {"viewport": {"width": 1180, "height": 810}}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET.split())
        page = Page(browser, url, color_scheme="light", **wide).take("opening")
        page.press("Enter").until("countdown").rest(0.2).take("countdown").until("playing")
        page.page.keyboard.down("Space")
        page.rest(0.3).take("playing").page.keyboard.up("Space")
        page.press("p").until("paused").take("paused")
        page.press("Delete").until("review").rest(0.9)
        page.cross().cross(wait=1.5).press("r").until("playing")
        page.page.keyboard.down("Space")
        page.until("review").page.keyboard.up("Space")
        page.rest(0.9).cross(wait=2.2).cross(wait=0.6).take("review")
        page.page.close()
        phone = Page.__new__(Page)
        phone.page = browser.new_page(
            viewport={"width": 390, "height": 844},
            color_scheme="dark",
            has_touch=True,
            is_mobile=True,
            device_scale_factor=2,
        )
        phone.page.goto(url)
        phone.until("review").take("phone-review")
        phone.press("Enter").until("playing").rest(2.0).take("phone-playing")
        phone.page.close()
        page = Page.__new__(Page)
        page.page = browser.new_page(color_scheme="dark", **wide)
        page.page.goto(url)
        page.until("paused").take("dark")
        page.press("Enter").until("playing")
        page.page.keyboard.down("Space")
        page.until("review").page.keyboard.up("Space")
        page.rest(0.9)
        while page.page.locator("body").get_attribute("data-saved") < "5":
            page.cross(wait=0.4)
        page.page.emulate_media(color_scheme="light")
        ready = page.press("Enter").page.locator("body[data-tree=ready]")
        ready.wait_for(timeout=10.0 * PATIENCE)
        picture_the_tree(page, wide["viewport"])
        page.press("Escape").until("finished").take("finished")
        browser.close()
    process.wait()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        picture_the_page(Path(name))
