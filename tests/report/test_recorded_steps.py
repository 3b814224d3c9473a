"""Recorded steps on a policy's page: under masks, and where there are too many for all digits."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eutree.data import Demonstrations, Episode
from eutree.policies import TreePolicy
from eutree.report import WatchedEpisode, policy_page
from eutree.report.tree_data import tree_data
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from tests.report.browser import ENOUGH, open_page

SCHEMA = Schema((Feature("x"), Feature("y")), ("stay", "up", "down"))
STAY, UP, DOWN = range(3)


def masked_policy() -> TreePolicy:
    tree = DecisionTree.single_leaf(2).split(0, 0, 0.0)
    return TreePolicy(tree, np.array([STAY, DOWN]), SCHEMA, masked=True)


def played(policy: TreePolicy, allowed: list[list[int]]) -> Episode:
    observations = np.column_stack(
        [np.arange(len(allowed) + 1.0) - 3.5, np.zeros(len(allowed) + 1)]
    )
    masks = np.array(allowed, dtype=np.bool_)
    actions = policy.decide(observations[:-1], masks)
    return Episode(observations=observations, actions=actions, rewards=np.ones(len(allowed)),
                   terminated=True, truncated=False, steps={"allowed": masks})  # fmt: skip


@pytest.fixture
def episode() -> Episode:
    free, no_stay, no_down = [1, 1, 1], [0, 1, 1], [1, 1, 0]
    return played(masked_policy(), [free, no_stay, free, free, free, no_down, no_down])


def test_under_masks_the_policy_s_own_episodes_are_its_own(episode: Episode) -> None:
    """They were taken for somebody else's, and no leaf told of them."""
    policy = masked_policy()
    assert episode.actions.tolist() == [STAY, DOWN, STAY, STAY, DOWN, STAY, STAY]
    assert tree_data(policy, [WatchedEpisode(episode)])["episodes"][0]["own"]
    other = Episode(observations=episode.observations, actions=np.full(7, UP),
                    rewards=np.ones(7), terminated=True, truncated=False)  # fmt: skip
    assert not tree_data(policy, [WatchedEpisode(other)])["episodes"][0]["own"]


@pytest.mark.parametrize("masked", [True, False])  # of a policy that was made without masks, too
def test_a_page_says_what_is_done_where_the_first_action_is_not_allowed(
    chromium: Any, episode: Episode, tmp_path: Path, masked: bool
) -> None:
    path = tmp_path / "page.html"
    shown = Demonstrations((episode,), SCHEMA)
    watched = [WatchedEpisode(episode)]
    policy = replace(masked_policy(), masked=masked)
    path.write_text(policy_page(policy, episodes=watched, demonstrations=shown), "utf-8")
    opened = open_page(chromium, path)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    status = opened.page.locator("#status")
    assert status.inner_text() == "Step 0 of 7: stay, leaf 0, return so far 0"
    opened.page.click("#forward")
    assert "Step 1 of 7: down, as stay is not allowed, leaf 0" in status.inner_text()
    opened.page.click("#rules-fold summary")
    opened.page.wait_for_selector("[data-rule]")
    effects = opened.page.locator("#effects-words")
    opened.page.select_option('[data-rule="1"] select', str(UP))  # leaf 0, at steps 0 to 3
    assert "4 of 7 recorded steps" in effects.inner_text()
    assert "3 in leaf 0: stay became up" in effects.inner_text()
    assert "1 in leaf 0: down became up" in effects.inner_text()
    opened.page.click("#undo")
    opened.page.select_option('[data-rule="2"] select', str(STAY))  # leaf 1, at steps 4 to 6
    assert "1 of 7 recorded steps" in effects.inner_text()
    opened.assert_quiet()
    opened.page.close()


def test_what_lies_on_a_threshold_stays_on_its_side_whatever_is_rounded(monkeypatch: Any) -> None:
    """On a page of many steps any edit of another test moved it."""
    monkeypatch.setattr("eutree.report.tree_data.MOST_EXACT", 100)
    random = np.random.default_rng(1)
    observations = random.uniform(0.0, 100.0, (400, 2))
    observations[7, 1] = np.nan
    chosen = observations[[3, 50, 90], 0]
    tree = DecisionTree.single_leaf(2).split(0, 0, float(chosen[0]))
    tree = tree.split(0, 1, float(observations[60, 1])).split(1, 0, float(chosen[1]))
    policy = TreePolicy(tree, np.zeros(4, dtype=np.int64), SCHEMA)
    episode = Episode(observations=observations, actions=np.zeros(399, dtype=np.int64),
                      rewards=np.zeros(399), terminated=True, truncated=False)  # fmt: skip
    entry = tree_data(policy, [WatchedEpisode(episode)])["episodes"][0]
    rows = np.array(entry["observations"], dtype=np.float64)
    assert tree.leaf_index(rows).tolist() == entry["leaves"]
    assert tree.leaf_index(rows).tolist() == tree.leaf_index(observations).tolist()
    shortened = sum(len(repr(value)) < 9 for row in entry["observations"] for value in row)
    assert shortened > 790  # but few are told in full
