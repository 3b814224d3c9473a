"""Make the pictures of the recorder's page, and of a study, in headless Chromium.

Run: PYTHONPATH=src python docs/images/make_recorder_pictures.py

A scripted person drives the real programs; the pictures land beside this file.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from eutree_lab.study.plan import PLAN, usual

HERE = Path(__file__).parent
CHROMIUM = "/usr/bin/chromium"
QUIET = (
    "--no-sandbox --headless=new --disable-gpu --disable-background-networking "
    "--disable-component-update --disable-sync --no-first-run"
)
PATIENCE = 60_000.0
MISLEADING = 4  # a folder of a simulated person, of which the tree is far better without some
DESK = {"viewport": {"width": 1180, "height": 810}}
PHONE = {
    "viewport": {"width": 390, "height": 844},
    "has_touch": True,
    "is_mobile": True,
    "device_scale_factor": 2,
}


class Page:
    """The recorder's page, and a person before it."""

    def __init__(self, browser: Any, url: str, state: str = "opening", **options: Any) -> None:
        self.page = browser.new_page(**options)
        self.page.goto(url)
        self.until(state)

    def until(self, state: str) -> "Page":
        self.page.locator(f"body[data-state={state}]").wait_for(timeout=PATIENCE)
        return self

    def rest(self, seconds: float) -> "Page":
        self.page.wait_for_timeout(1000.0 * seconds)
        return self

    def take(self, name: str, *, whole: bool = False) -> "Page":
        self.rest(0.3)
        self.page.screenshot(path=HERE / f"{name}.png", full_page=whole)
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


def picture_the_tree(page: Page) -> None:
    """Watch the tree, take over from it, let it practise, and look at what it became."""
    page.page.get_by_role("button", name="Make", exact=False).first.click()
    page.until("watching").page.locator("body[data-seen^=over]").wait_for(timeout=PATIENCE)
    page.take("recorder-watching").press("Escape").until("review").rest(0.9)
    page.page.emulate_media(color_scheme="dark")
    page.page.get_by_role("button", name="Correct it").click()
    page.until("driving").rest(1.0).page.keyboard.down("Space")
    page.page.locator("#acting", has_text="you:").wait_for(timeout=PATIENCE)
    page.take("recorder-driving").page.keyboard.up("Space")
    page.press("Escape").until("review").rest(0.9)
    page.page.emulate_media(color_scheme="light")
    page.page.get_by_role("button", name="Make it again").click()
    page.until("watching").press("Escape").until("review").rest(0.9)
    page.page.get_by_role("button", name="Let it practise").click()
    page.page.locator("#ways-section").wait_for(timeout=20.0 * PATIENCE)
    page.until("watching").press("Escape").until("review")
    page.page.evaluate("() => { document.getElementById('rules-details').open = false; }")
    page.take("recorder-tree", whole=True)
    page.page.locator("#ways-section").screenshot(path=HERE / "recorder-ways.png")


@contextmanager
def recording(folder: Path, *options: str, by: tuple[str, ...] = ("record",)) -> Iterator[str]:
    """Start ``eutree record``, or what records besides; yield the page's address."""
    command = [sys.executable, "-m", "eutree", *by, "eutree/Evasion2-v0", "--port", "0"]
    own = {**os.environ, "PYTHONPATH": str(HERE.parents[1] / "src")}
    process = subprocess.Popen(
        [*command, *options], stderr=subprocess.PIPE, text=True, cwd=folder, env=own
    )
    try:
        lines = (re.search(r"open (http://\S+)", line) for line in process.stderr)
        yield next(filter(None, lines))[1]
    finally:
        process.kill()
        process.communicate()


def picture_the_recorder(browser: Any, folder: Path) -> None:
    with recording(folder, "--fps", "4", "--episodes", "5", "--out", "demos") as url:
        page = Page(browser, url, color_scheme="light", **DESK).take("recorder-opening")
        page.press("Enter").until("playing").page.keyboard.down("Space")
        page.rest(0.6).take("recorder-playing").page.keyboard.up("Space")
        page.press("Delete").until("review").rest(0.9)
        page.cross().cross(wait=1.5).cross(wait=2.2).cross(wait=0.6).take("recorder-review")
        page.page.close()
        phone = Page(browser, url, "review", color_scheme="dark", **PHONE)
        phone.press("Enter").until("playing").rest(1.0)
        phone.page.keyboard.down("Space")
        phone.rest(0.5).take("recorder-phone-playing").until("review").page.close()
        picture_the_tree(Page(browser, url, "review", color_scheme="light", **DESK))


def picture_the_study(browser: Any, folder: Path) -> None:
    """Go to the questions of a study with as few episodes as there may be."""
    study = folder / "people"
    study.mkdir()
    plan = re.sub(r"(practice|watched|taken_over) = \d+", r"\1 = 0", usual(PLAN))
    (study / "study.toml").write_text(plan.replace("episodes = 15", "episodes = 1"))
    with recording(folder, "--fps", "8", by=("study", "lead", "people")) as url:
        page = Page(browser, url, color_scheme="light", **DESK)
        for name in ("I agree", "Begin"):
            page.page.get_by_role("button", name=name, exact=True).click()
        page.until("playing").page.keyboard.down("Space")
        page.until("review").page.locator("#questions fieldset").first.wait_for(timeout=PATIENCE)
        for place, answer in enumerate("64"):
            page.page.locator("fieldset").nth(place).locator(f"[value='{answer}']").check()
        page.take("study-questions")


def picture_the_hurts(browser: Any, folder: Path) -> None:
    """Show which seconds hurt in what a simulated person has recorded."""
    sys.path.insert(0, str(HERE.parents[1] / "benchmarks"))
    import people

    shown = people.folder("evasion", MISLEADING)
    held = [
        replace(one, steps={"keys": one.actions[:, None] == 1}, extras={"keys": ["space"]})
        for one in shown.episodes
    ]
    replace(shown, episodes=tuple(held)).save(folder / "simulated")
    with recording(folder, "--out", "simulated") as url:
        page = Page(browser, url, color_scheme="light", viewport={"width": 900, "height": 900})
        page.page.get_by_role("button", name="Make my tree").click()
        page.until("watching").press("Escape").until("opening")
        page.page.get_by_role("button", name="Which seconds hurt?").click()
        page.page.locator("#hurts article").first.wait_for(timeout=10.0 * PATIENCE)
        page.page.locator("#hurts-section").screenshot(path=HERE / "recorder-hurts.png")


if __name__ == "__main__":
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET.split())
        picture_the_recorder(chromium, Path(name))
        picture_the_study(chromium, Path(name))
        picture_the_hurts(chromium, Path(name))
        chromium.close()
