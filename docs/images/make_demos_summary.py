"""Draw docs/images/demos-summary.png: the page of fifteen scripted demonstrations.

PYTHONPATH=src python docs/images/make_demos_summary.py
"""

import tempfile
from pathlib import Path

import gymnasium
from playwright.sync_api import sync_playwright

import eutree

env = gymnasium.make("eutree/Evasion2-v0")
hands = eutree.experts.careless(eutree.experts.wait_at_crossing, 0.05, seed=1)
demonstrations = eutree.record(env, hands, episodes=15, seed=5)
with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
    path = Path(folder) / "demos.html"
    path.write_text(eutree.report.demonstrations_page(demonstrations), encoding="utf-8")
    browser = playwright.chromium.launch(
        executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
    )
    page = browser.new_page(viewport={"width": 1000, "height": 760})
    page.goto(path.as_uri())
    page.screenshot(path=Path(__file__).with_name("demos-summary.png"))
    browser.close()
