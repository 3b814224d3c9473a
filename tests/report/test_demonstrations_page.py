"""The page of demonstrations: what it shows, every name harmless, readable in a browser."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations, Episode
from eutree.report import demonstrations_page
from eutree.report.demonstrations_page import panels
from eutree.schema import Feature, Schema
from tests.export.policies import NASTY
from tests.report.browser import grave_violations, open_page
from tests.report.pages import Outline


@pytest.fixture(scope="module")
def recorded() -> Demonstrations:
    env = gymnasium.make("eutree/Evasion2-v0")
    hands = eutree.experts.careless(eutree.experts.wait_at_crossing, 0.1, seed=3)
    demos = eutree.record(env, hands, episodes=6, seed=4)
    episodes = list(demos.episodes)
    episodes[1] = replace(episodes[1], kept=False, comment="redone")
    episodes[4] = replace(episodes[4], ending="interrupted", is_success=None)
    return replace(demos, episodes=tuple(episodes), expert="a person")


def named(name: str) -> Demonstrations:
    """Two episodes in which everything that has a name is called ``name``."""
    schema = Schema(
        (Feature(name, f"u{name}"), Feature(f"{name} 2", f"u{name}")), (name, f"{name} 2")
    )
    rows = np.array([[0.0, 0.0], [1.0, 2.0], [3.0, 1.0]])
    one = Episode(rows, [0, 1], [1.0, 0.0], True, False, ending=name, comment=f"c{name}")
    return Demonstrations((one, replace(one, actions=np.array([1, 1]))), schema, None, name)


def test_all_parts_are_there(recorded: Demonstrations) -> None:
    outline = Outline(demonstrations_page(recorded, numbers=[0, 1, 2, 3, 7, 8]))
    for words in (
        "5 episodes and 1 discarded",
        "Episode 7: interrupted",
        "recovered",
        "redone",
        "Nothing can be said yet",
    ):
        assert words in outline.text
    assert outline.tags.count("article") == 6
    assert outline.tags.count("polyline") == 4 * 6  # three features, and the action
    assert "script" not in outline.tags


def test_features_of_one_unit_share_a_panel() -> None:
    units = ("m", "m", "m/s", "", "", "m")
    schema = Schema(tuple(Feature(f"f{i}", u) for i, u in enumerate(units)), ("a",))
    assert panels(schema) == [[0, 1, 5], [2], [3], [4]]


@pytest.mark.parametrize("name", NASTY)
def test_any_name_is_harmless(name: str) -> None:
    ordinary = Outline(demonstrations_page(named("plain"), title="plain"))
    nasty = Outline(demonstrations_page(named(name), title=name))
    assert nasty.tags == ordinary.tags
    for key, _ in nasty.attributes:
        assert not key.startswith("on")
        assert key != "style"


@pytest.mark.parametrize("n_features", [1, 2, 14])
def test_few_and_many_features_and_nothing_kept(n_features: int) -> None:
    rows = np.arange(3.0 * n_features).reshape(3, n_features)
    one = Episode(rows, [0, 1], [0.0, 0.0], False, False)
    empty = Episode(rows[:1], [], [], False, False)
    schema = Schema.anonymous(n_features, 2)
    page = demonstrations_page(Demonstrations((one, empty), schema))
    assert ("2 further features are not drawn" in page) == (n_features == 14)
    assert "No step was taken" in page
    nothing = demonstrations_page(Demonstrations((replace(one, kept=False),), schema))
    assert "0 episodes and 1 discarded" in nothing


def test_same_demonstrations_same_page(recorded: Demonstrations) -> None:
    assert demonstrations_page(recorded) == demonstrations_page(recorded)


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1280, "light")])
def test_quiet_and_whole_in_a_browser(
    chromium: Any, axe: str, tmp_path: Path, recorded: Demonstrations, width: int, scheme: str
) -> None:
    path = tmp_path / "demos.html"
    path.write_text(demonstrations_page(recorded), encoding="utf-8")
    opened = open_page(chromium, path, width=width, scheme=scheme)
    opened.assert_quiet()
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
    assert opened.page.locator("article svg").count() == 2 * 6  # metres, and the action
    opened.page.close()
    context = chromium.new_context(bypass_csp=True, color_scheme=scheme)
    page = context.new_page()
    page.goto(path.as_uri())
    grave = grave_violations(page, axe)
    context.close()
    assert grave == []


def flying() -> Demonstrations:
    """Eight features, some of which might reach far and do not."""
    rng = np.random.default_rng(5)
    schema = Schema(
        tuple(Feature(f"quantity {i}", "", -10.0, 10.0) for i in range(8)),
        ("main engine", "left engine", "nothing"),
    )
    rows = rng.normal(scale=0.4, size=(40, 8))
    rows[20:] = rows[:20] + 0.001
    actions = np.arange(39) % 3
    one = Episode(rows, actions, np.zeros(39), True, False)
    return Demonstrations((one, replace(one, actions=(actions + 1) % 3)), schema)


@pytest.mark.parametrize("width", [390, 1280])
def test_no_label_leaves_its_chart(chromium: Any, tmp_path: Path, width: int) -> None:
    path = tmp_path / "demos.html"
    path.write_text(demonstrations_page(flying()), encoding="utf-8")
    opened = open_page(chromium, path, width=width)
    outside = opened.page.evaluate(
        """() => [...document.querySelectorAll("svg.chart text")].filter((text) => {
          const [inner, outer] = [text, text.closest("svg")].map((e) => e.getBoundingClientRect());
          return inner.left < outer.left - 1 || inner.right > outer.right + 1;
        }).map((text) => text.textContent)"""
    )
    assert outside == []
    opened.page.close()
