"""Make the pictures of exports.md and show.md: a drawn tree, and the page in a browser.

Run: PYTHONPATH=src python docs/images/make_pictures.py [--browser /usr/bin/chromium]
"""

import argparse
import tempfile
from pathlib import Path

import gymnasium
from playwright.sync_api import Page, sync_playwright

import eutree
from eutree.report import policy_page, watch

HERE = Path(__file__).parent
SIZES = {"show-page": (1280, 800), "show-page-phone": (390, 844)}


def _rules(page: Page, path: Path) -> None:
    """Picture the rules after a threshold was moved and a leaf was locked."""
    page.goto(path.as_uri())
    page.wait_for_selector("body[data-ready]")
    page.click("#rules-fold summary")
    rules = page.locator("#rule-list")
    rules.locator("input").first.fill("19.5")
    rules.locator("input").first.press("Enter")
    rules.locator(".lock").last.click()
    page.evaluate("document.getElementById('rules').scrollIntoView()")
    rules.evaluate("list => list.scrollTop = 0")
    page.screenshot(path=str(HERE / "show-page-rules.png"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--browser", default="/usr/bin/chromium")
    arguments = parser.parse_args()
    env = gymnasium.make("eutree/Evasion2-v0")
    demonstrations = eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=0)
    expert = eutree.fit_expert_tree(demonstrations)
    (HERE / "tree.svg").write_text(eutree.export.to_svg(expert), encoding="utf-8")
    learned = eutree.learn(
        env, demonstrations=demonstrations, expert=expert, episodes=20, seed=1
    ).policy
    episodes = watch(learned, episodes=6, seed=1)
    content = policy_page(learned, episodes=episodes, demonstrations=demonstrations)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "page.html"
        path.write_text(content, encoding="utf-8")
        browser = playwright.chromium.launch(
            executable_path=arguments.browser, args=["--no-sandbox"]
        )
        for name, (width, height) in SIZES.items():
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(path.as_uri())
            page.wait_for_selector("body[data-ready]")
            for _ in range(6):
                page.click("#forward")
            page.click("#fit")  # the whole tree, its root too
            page.evaluate("scrollTo(0, 0)")
            page.screenshot(path=str(HERE / f"{name}.png"))
        _rules(browser.new_page(viewport={"width": 1280, "height": 800}), path)
        browser.close()


if __name__ == "__main__":
    main()
