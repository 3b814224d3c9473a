"""Every page is painted in the colours of its palette, in both themes.

``demos stats --html`` was a page of black shapes: the style of charts had moved to a file that this
page did not take in, and no test looked at a colour.
"""

from pathlib import Path
from typing import Any

import gymnasium
import pytest

import eutree
from eutree.demo import run_demo
from eutree.demo.page import DemoSettings, Story
from eutree.policies import TreePolicy
from eutree.report import WatchedEpisode, demonstrations_page, policy_page, run_page
from eutree.schema import EnvironmentSpec
from eutree_lab.paper.experiment import SMOKE
from eutree_lab.paper.reproduce import chosen, reproduce
from tests.report.browser import open_page
from tests.report.colours import palette, wrong_colours
from tests.report.pages import report

PAGES = ("demonstrations", "policy", "run", "demo", "reproduce")


@pytest.fixture(scope="module")
def pages(
    tmp_path_factory: pytest.TempPathFactory, policy: TreePolicy, watched: list[WatchedEpisode]
) -> dict[str, Path]:
    """Return a file of every kind of page."""
    folder = tmp_path_factory.mktemp("pages")
    env = gymnasium.make("eutree/Evasion2-v0")
    hands = eutree.experts.careless(eutree.experts.wait_at_crossing, 0.1, seed=3)
    demos = eutree.record(env, hands, episodes=6, seed=4)
    texts = {
        "demonstrations": demonstrations_page(demos),
        "policy": policy_page(policy, episodes=watched, demonstrations=demos),
        "run": run_page(report()),
    }
    for name, text in texts.items():
        (folder / f"{name}.html").write_text(text)
    few = {"episodes": 2, "evaluate_every": 1, "evaluation_episodes": 2}
    short = DemoSettings(
        environment=EnvironmentSpec("eutree/Evasion2-v0"),
        story=Story(learning=few, final_episodes=4),
        runs=2,
        n_jobs=1,
    )
    demo = run_demo(short, folder / "demo", say=print, follow=lambda count, run: None).report
    reproduce(chosen("expert"), folder / "results", scale=SMOKE, presets=("paper",))
    found = {name: folder / f"{name}.html" for name in texts}
    return found | {"demo": demo, "reproduce": folder / "results" / "report.html"}


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", PAGES)
def test_all_that_is_painted_has_a_colour_of_the_palette(
    chromium: Any, pages: dict[str, Path], name: str, scheme: str
) -> None:
    opened = open_page(chromium, pages[name], scheme=scheme)
    assert wrong_colours(opened.page, scheme) == []
    if name != "reproduce":  # its figures are images
        assert opened.page.evaluate("document.querySelectorAll('svg *').length") > 10
    opened.assert_quiet()
    opened.page.close()


def test_a_page_without_its_styles_is_found(chromium: Any, pages: dict[str, Path]) -> None:
    """The test above can fail: without colours, or without the style of charts, it does."""
    opened = open_page(chromium, pages["demonstrations"])
    style = "document.querySelector('style')"
    opened.page.evaluate(f"{style}.textContent = {style}.textContent.replaceAll('.series-', '.x-')")
    assert any(entry[1:] == ["paint", "nothing"] for entry in wrong_colours(opened.page, "light"))
    opened.page.evaluate(f"{style}.textContent = {style}.textContent.replaceAll('--series', '--y')")
    opened.page.evaluate(
        f"{style}.textContent = {style}.textContent.replaceAll('.chart text', '.z text')"
    )
    wrong = wrong_colours(opened.page, "light")
    assert any(entry[1:] == ["fill", "rgb(0, 0, 0)"] for entry in wrong)
    opened.page.close()


def test_black_is_of_no_palette() -> None:
    assert not {"rgb(0, 0, 0)"} & (palette("light") | palette("dark"))
