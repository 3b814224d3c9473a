"""Draw the pictures of tutorial.md: a day of the old and of the new controller, tree, and page.

Run: PYTHONPATH=src python docs/pictures/make_tutorial.py [--browser /usr/bin/chromium]
"""

import argparse
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import gymnasium
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from playwright.sync_api import sync_playwright

import eutree
from eutree.inspection import enforce
from eutree.report import policy_page, watch

DOCS = Path(__file__).parents[1]
IMAGES = DOCS / "images"
RULES = ["always on when level <= 0.8", "always off when level >= 4.2"]
NIGHT_ENDS, NIGHT_BEGINS = 6, 22
BLUE, BROWN, GREY = "#0b5fa5", "#a8480c", "#666666"


class FloatSwitch:
    """The controller that the tutorial starts from."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[int, Any]:  # fmt: skip
        """Fill below half."""
        return int(observation[0] < 2.5), state


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--browser", default="/usr/bin/chromium")
    browser = parser.parse_args().browser
    with tempfile.TemporaryDirectory() as folder:
        text = (DOCS / "tutorial.md").read_text(encoding="utf-8")
        found = re.search(r"<!-- file: tank.py -->\n```python\n(.*?)```", text, re.DOTALL)
        if found is None:
            raise SystemExit("tutorial.md has no tank.py any more")
        Path(folder, "tank.py").write_text(found[1], encoding="utf-8")
        sys.path.insert(0, folder)
        __import__("tank")  # registers the environment
        env = gymnasium.make("Tank-v0")
        demonstrations, policy = learned(env)
        draw_day(env, policy, IMAGES / "tutorial-day.png")
        (IMAGES / "tutorial-tree.svg").write_text(eutree.export.to_svg(policy), encoding="utf-8")
        path = Path(folder, "pump.html")
        episodes = watch(policy, episodes=3, seed=0)
        page = policy_page(policy, episodes=episodes, demonstrations=demonstrations)
        path.write_text(page, encoding="utf-8")
        photograph(path, IMAGES / "tutorial-page.png", browser)


def learned(env: Any) -> tuple[Any, eutree.TreePolicy]:
    """Return the demonstrations and the policy of the tutorial, rules enforced."""
    demonstrations = eutree.record(env, FloatSwitch(), episodes=15, seed=0)
    expert = eutree.fit_expert_tree(demonstrations)
    with tempfile.TemporaryDirectory() as folder:
        best = eutree.learn_runs(
            "Tank-v0", runs=5, out=folder, demonstrations=demonstrations, expert=expert,
            episodes=300, evaluate_every=300,
        ).result  # fmt: skip
    rows = best.history.observations
    small, _ = eutree.compress(best.policy, rows, round_thresholds=True)
    return demonstrations, enforce(small, RULES).policy


def draw_day(env: Any, policy: eutree.TreePolicy, path: Path) -> None:
    """Draw the level and the pump over the same day under both controllers."""
    figure = Figure(figsize=(7.2, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    level, pump = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    both = {"float switch": (FloatSwitch(), BROWN), "learned": (policy, BLUE)}
    for row, (name, (controller, colour)) in enumerate(both.items()):
        day = eutree.record(env, controller, episodes=1, seed=3).episodes[0]
        cost = -float(day.rewards.sum())
        hours = day.observations[:, 1]
        level.plot(hours, day.observations[:, 0], color=colour, label=f"{name}: {cost:.0f} euros")
        on = [(float(hour), 1.0) for hour, a in zip(hours, day.actions, strict=False) if a]
        pump.broken_barh(on, (-row - 0.4, 0.8), color=colour)
    for axis in (level, pump):
        axis.axvspan(NIGHT_ENDS, NIGHT_BEGINS, color="#f4e3c8", zorder=0)
        axis.spines[["top", "right"]].set_visible(False)
    level.text(14, 4.7, "power is dear", ha="center", fontsize=8, color=GREY)
    level.set(ylabel="level (m)", ylim=(0, 5), xlim=(0, 24), xticks=range(0, 25, 4))
    level.legend(fontsize=8, frameon=False, loc="upper right")
    pump.set(xlabel="hour", yticks=(0, -1), yticklabels=("switch", "learned"), ylim=(-1.6, 0.6))
    pump.set_title("pump on", fontsize=8, loc="left", color=GREY)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def photograph(page_path: Path, path: Path, browser_path: str) -> None:
    """Picture the page at seven in the evening of its first day."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1100, "height": 640})
        page.goto(page_path.as_uri())
        page.wait_for_selector("body[data-ready]")
        for _ in range(19):
            page.click("#forward")
        page.evaluate("scrollTo(0, 0)")
        page.screenshot(path=path)
        browser.close()


if __name__ == "__main__":
    main()
