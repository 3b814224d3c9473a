"""A page at work: what is drawn on tests, edits under masks, certificates, infinite numbers."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eutree.data import Episode
from eutree.inspection import edit
from eutree.policies import LeafStatistics, TreePolicy
from eutree.proof import Certificate
from eutree.report import WatchedEpisode, policy_page
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.text import asked
from tests.report.browser import ENOUGH, Opened, open_page

Show = Callable[..., Opened]


@pytest.fixture
def show(chromium: Any, tmp_path: Path) -> Any:
    """Open the page of a policy; it must have been quiet at the end."""
    opened = []

    def open_it(policy: TreePolicy, **known: Any) -> Opened:
        path = tmp_path / "page.html"
        path.write_text(policy_page(policy, **known), encoding="utf-8")
        opened.append(open_page(chromium, path))
        opened[-1].page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
        return opened[-1]

    yield open_it
    for one in opened:
        one.assert_quiet()
        one.page.close()


def kinds() -> Schema:
    features = [Feature("light is red", low=0, high=1), Feature("light is green", low=0, high=1)]
    features += [Feature("open", low=0, high=1), Feature("gear", low=1, high=5)]
    features += [Feature("mode", low=1, high=4), Feature("speed", "m/s", 0.0, 9.0)]
    given = {"open": "flag", "gear": "integer", "mode": ("off", "low", "mid", "high")}
    return Schema(tuple(features), ("go", "wait")).with_kinds({**given, "light": ("red", "green")})


@pytest.mark.parametrize(
    ("feature", "threshold", "drawn"),
    [
        (1, 0.5, ["light", "is green"]),
        (2, 0.5, ["open"]),
        (3, 1.5, ["gear", "= 1"]),
        (3, 3.0, ["gear", "≤ 3"]),
        (4, 3.5, ["mode", "is high"]),
        (5, 2.5, ["speed", "≤ 2.5 m/s"]),
    ],
)
def test_the_answers_on_branches_are_to_what_is_drawn_on_the_test(
    show: Show, feature: int, threshold: float, drawn: list[str]
) -> None:
    """The box said "light is green ≤ 0.5", and its yes led to where the light is green."""
    grown = DecisionTree.single_leaf(6).split(0, feature, threshold)
    policy = TreePolicy(grown, np.array([0, 1]), kinds())
    opened = show(policy)
    lines = opened.page.locator('[data-node="0"] > text').all_text_contents()
    assert lines == drawn
    question = asked(policy.schema, grown, 0)
    assert " ".join(lines) == question.question().replace("<=", "≤")
    left, right = (
        opened.page.locator(f'text.answer[data-child="{child}"]').text_content()
        for child in (int(grown.left[0]), int(grown.right[0]))
    )
    assert {left, right} == {"yes", "no"}
    meant = {"is green": 1.0, "open": 1.0, "= 1": 1.0, "≤ 3": 3.0, "is high": 4.0}
    value = meant.get(drawn[-1], 2.0)
    goes_left = value <= threshold
    assert (left if goes_left else right) == "yes"


def masked_policy(statistics: bool) -> TreePolicy:
    random = np.random.default_rng(3)
    grown = DecisionTree.single_leaf(2).split(0, 0, 0.0).split(0, 1, -1.0).split(1, 1, 1.0)
    schema = Schema((Feature("x", "", -9.0, 9.0), Feature("y", "", -9.0, 9.0)), tuple("abcd"))
    known = None
    if statistics:
        values = np.where(random.random((4, 4)) < 0.3, np.nan, random.normal(size=(4, 4)))
        known = LeafStatistics(random.integers(0, 9, (4, 4)), values, np.abs(values))
    return TreePolicy(grown, np.array([0, 1, 2, 0]), schema, leaves=known, masked=True)


def masked_episode(policy: TreePolicy) -> Episode:
    random = np.random.default_rng(4)
    observations = random.uniform(-3.0, 3.0, (121, 2))
    allowed = random.random((120, 4)) < 0.5
    allowed[np.arange(120), random.integers(0, 4, 120)] = True
    actions = policy.decide(observations[:-1], allowed)
    return Episode(observations=observations, actions=actions, rewards=np.ones(120),
                   terminated=True, truncated=False, steps={"allowed": allowed})  # fmt: skip


@pytest.mark.parametrize("statistics", [False, True])
@pytest.mark.parametrize(
    ("actions", "thresholds"),
    [({1: 3}, {}), ({0: 2, 3: 1}, {}), ({}, {0: 0.75}), ({2: 1}, {0: -0.5, 1: 0.25})],
)
def test_under_masks_a_page_edits_as_the_command_does(
    show: Show, statistics: bool, actions: dict[int, int], thresholds: dict[int, float]
) -> None:
    """It counted by the orders before the edit, and its file fell back on others."""
    policy = masked_policy(statistics)
    thresholds = {
        int(np.flatnonzero(policy.tree.feature >= 0)[k]): v for k, v in thresholds.items()
    }
    names = {leaf: policy.schema.actions[action] for leaf, action in actions.items()}
    meant = edit(policy, thresholds=thresholds, actions=names).policy
    episode = masked_episode(policy)
    opened = show(policy, episodes=[WatchedEpisode(episode)])
    made = opened.page.evaluate(
        """([actions, thresholds]) => {
          change((policy) => {
            for (const [leaf, action] of actions) policy.leafActions[leaf] = action;
            for (const [node, value] of thresholds) policy.threshold[node] = value;
          });
          return editedFile();
        }""",
        [list(actions.items()), list(thresholds.items())],
    )
    got = TreePolicy.from_bytes(made.encode())
    assert got == meant
    assert opened.page.evaluate("orders") == meant.orders.tolist()
    rows, allowed = episode.observations[:-1], episode.allowed
    n_changed = int((meant.decide(rows, allowed) != policy.decide(rows, allowed)).sum())
    assert n_changed > 0
    words = opened.page.locator("#effects-words").inner_text()
    assert f"{n_changed} of 120 recorded steps" in words


def test_an_edited_policy_is_not_shown_as_proven(show: Show) -> None:
    policy = replace(masked_policy(statistics=False), masked=False)
    known = Certificate(kind="proof", verdict="proven", sentence="from every start x stays below 9")
    opened = show(policy, certificate=known)
    shown = opened.page.locator("body").inner_text
    assert shown().count("stays below 9") == 2
    opened.page.click("#rules-fold summary")
    opened.page.click('[data-rule="0"] .lock')  # which decides nothing
    assert shown().count("stays below 9") == 2
    opened.page.click("#undo")
    opened.page.select_option("[data-rule] select >> nth=0", "3")
    assert "stays below 9" not in shown()
    assert "of this one nothing is proven" in shown()
    opened.page.click("#undo")
    assert shown().count("stays below 9") == 2


def test_leaves_that_no_kind_reaches_are_named(show: Show) -> None:
    """Between 3.2 and 3.5 there is no gear, and a light is of one colour."""
    grown = DecisionTree.single_leaf(6).split(0, 3, 3.5).split(0, 3, 2.5)
    policy = TreePolicy(grown, np.array([0, 1, 0]), kinds())
    node = int(np.flatnonzero(grown.threshold == 2.5)[0])
    warned = edit(policy, thresholds={node: 3.2}).warnings
    opened = show(policy)
    opened.page.evaluate(f"change((policy) => {{ policy.threshold[{node}] = 3.2; }})")
    words = opened.page.locator("#effects-words").inner_text()
    assert [warning in words.lower() for warning in warned] == [True]
    boxes = [[[-1, 0.5]], [[0.5, 9]]]
    both = "([red, green]) => isPossible(features.map((_, k) => [red, green][k] ?? [-9, 9]))"
    assert opened.page.evaluate(both, [boxes[0][0], boxes[1][0]])
    assert not opened.page.evaluate(both, [boxes[0][0], boxes[0][0]])
    assert not opened.page.evaluate(both, [boxes[1][0], boxes[1][0]])


def test_infinite_numbers_stay_on_their_side_of_a_moved_test(show: Show) -> None:
    policy = replace(masked_policy(statistics=False), masked=False)
    rows = np.array([[-np.inf, 0.0], [np.inf, 2.0], [np.nan, 0.0], [1.0, 0.0]])
    actions = policy.predict(rows[:-1])[0]
    episode = Episode(observations=rows, actions=actions, rewards=np.ones(3),
                      terminated=True, truncated=False)  # fmt: skip
    opened = show(policy, episodes=[WatchedEpisode(episode)])
    assert "-∞" in opened.page.locator("#observation").inner_text()
    opened.page.evaluate("change((policy) => { policy.threshold[0] = 0.5; })")
    assert "0 of 3 recorded steps" in opened.page.locator("#effects-words").inner_text()
    assert opened.page.evaluate("data.episodes[0].leaves.slice(0, 3)") == (
        policy.tree.leaf_index(rows[:-1]).tolist()
    )


def test_a_download_keeps_every_argument_of_the_environment(show: Show) -> None:
    """Whole numbers above 2^53 were others, and the checksum was that of the others."""
    known = EnvironmentSpec(
        "own/Task-v0", {"key": 2**60 + 1, "name": '"environment": null', "x": 1.0}
    )
    policy = replace(masked_policy(statistics=True), environment=known)
    made = show(policy).page.evaluate(
        "change((policy) => { policy.leafActions[1] = 3; }), editedFile()"
    )
    got = TreePolicy.from_bytes(made.encode())
    assert got.environment == known
    assert got == edit(policy, actions={1: "d"}).policy
