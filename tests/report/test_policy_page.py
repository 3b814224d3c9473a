"""A policy watched in a browser: it plays, steps, answers clicks and keys, and stays quiet."""

import re
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eutree.data import Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.export.c import probes
from eutree.inspection.regions import Region, domain
from eutree.policies import LeafStatistics, TreePolicy
from eutree.report import WatchedEpisode, policy_page
from eutree.report.html import Pointer
from eutree.report.policy_page import policy_verdict
from eutree.report.tree_data import policy_features, tree_data
from eutree.schema import Control, EnvironmentSpec, Feature, Schema, combined_actions
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from eutree.trees.text import asked
from tests.export.policies import EVASION, NASTY, policy_of, tree
from tests.export.tools import need
from tests.report.browser import ENOUGH, Opened, grave_violations, open_page
from tests.report.pages import page_data
from tests.report.watched import PIXEL, episodes

ASSETS = Path(__file__).parents[2] / "src" / "eutree" / "report" / "assets"


@pytest.fixture(scope="module")
def file(
    policy: TreePolicy, watched: list[WatchedEpisode], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    path = tmp_path_factory.mktemp("page") / "policy.html"
    shown = Demonstrations((watched[0].episode,), policy.schema)
    path.write_text(policy_page(policy, episodes=watched, demonstrations=shown), encoding="utf-8")
    return path


@pytest.fixture
def opened(chromium: Any, file: Path) -> Iterator[Opened]:
    opened = open_page(chromium, file)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    yield opened
    opened.assert_quiet()
    opened.page.close()


def test_a_log_without_rewards_earns_nothing_that_is_shown(
    chromium: Any, policy: TreePolicy, watched: list[WatchedEpisode], tmp_path: Path
) -> None:
    """The page said "mean return 0" of each leaf."""
    played = watched[0].episode
    silent = replace(played, rewards=np.zeros(len(played)), has_rewards=False)
    for episode, word in ((silent, 0), (played, 1)):
        shown = Demonstrations((episode,), policy.schema)
        (tmp_path / "log.html").write_text(policy_page(policy, demonstrations=shown), "utf-8")
        opened = open_page(chromium, tmp_path / "log.html")
        opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
        assert opened.page.get_by_text("mean return").count() == word
        opened.assert_quiet()
        opened.page.close()


def state(opened: Opened, name: str) -> str:
    return opened.page.locator("body").get_attribute(f"data-{name}") or ""


def wait_for(opened: Opened, **values: object) -> None:
    selector = "".join(f'[data-{name}="{value}"]' for name, value in values.items())
    opened.page.wait_for_selector(f"body{selector}", timeout=ENOUGH)


def test_every_step_lights_the_leaf_that_decides(
    opened: Opened, policy: TreePolicy, watched: list[WatchedEpisode]
) -> None:
    leaves = policy.tree.leaf_index(watched[0].episode.observations)
    for step, leaf in enumerate(leaves.tolist()):
        wait_for(opened, step=step, leaf=leaf)
        lit = opened.page.locator(".node.live")
        nodes = [int(node.get_attribute("data-node")) for node in lit.all()]
        assert sorted(nodes) == sorted(policy.tree.path(leaf))
        opened.page.click("#forward")
    wait_for(opened, step=len(leaves) - 1)  # the end is the end
    opened.page.click("#back")
    wait_for(opened, step=len(leaves) - 2)
    opened.page.click("#first")
    wait_for(opened, step=0)


def test_it_plays_and_pauses(opened: Opened) -> None:
    clock = opened.page.clock  # so that a step comes when the test says so
    clock.install(time=0)
    clock.pause_at(1)
    opened.page.select_option("#speed", "120")
    opened.page.click("#play")
    clock.run_for(300)
    assert (state(opened, "playing"), state(opened, "step")) == ("true", "2")
    assert opened.page.locator("#play").get_attribute("aria-label") == "Pause"
    opened.page.click("#play")
    clock.run_for(300)
    assert (state(opened, "playing"), state(opened, "step")) == ("false", "2")
    opened.page.click("#play")
    clock.run_for(3000)  # it stops at the end by itself
    assert (state(opened, "playing"), state(opened, "step")) == ("false", "12")


def test_episodes_can_be_chosen_and_say_when_they_have_no_pictures(opened: Opened) -> None:
    assert opened.page.locator("#frame").is_visible()
    opened.page.select_option("#episode", "1")
    wait_for(opened, episode=1, step=0)
    assert opened.page.locator("#no-frame").is_visible()
    assert "Episode 2: goal" in opened.page.locator("#episode option:checked").inner_text()


def test_a_click_on_a_leaf_tells_what_is_known_of_it(opened: Opened, policy: TreePolicy) -> None:
    node = int(policy.tree.node_of_leaf[3])
    opened.page.click(f'[data-node="{node}"] .box')
    wait_for(opened, selected=node)
    words = opened.page.locator("#details").inner_text()
    assert "Leaf 3" in words
    assert "position > 4 and ≤ 18 m" in words
    assert "opponent_1 > -8.5 and ≤ 8.5 m" in words
    assert str(policy.leaves.visits[3, 0]) in words
    assert opened.page.locator(".histogram rect").count() == 24
    assert re.search(r"demonstration 0, (step \d+|steps \d+ to \d+): ", words)
    opened.page.locator(".links button").first.click()
    wait_for(opened, selected=node, leaf=3)
    opened.page.click("#live")
    wait_for(opened, selected="")


def test_branches_close_and_open(opened: Opened, policy: TreePolicy) -> None:
    assert state(opened, "visible") == str(policy.tree.n_nodes)
    opened.page.locator('[data-knob="1"] circle').last.click()
    below = 2 * 4  # under the root's yes branch are five leaves
    wait_for(opened, visible=policy.tree.n_nodes - below)
    assert opened.page.locator('[data-node="1"]').get_attribute("aria-expanded") == "false"
    opened.page.click("#expand-all")
    wait_for(opened, visible=policy.tree.n_nodes)
    opened.page.click("#collapse-all")
    wait_for(opened, visible=5)


def test_search_finds_opens_and_selects(opened: Opened) -> None:
    opened.page.click("#collapse-all")
    opened.page.fill("#search", "OPPONENT_1")
    assert opened.page.locator("#search-count").inner_text() == "2 found"
    opened.page.press("#search", "Enter")
    assert opened.page.locator("#search-count").inner_text() == "1 of 2"
    selected = opened.page.locator(".node.selected.found")
    assert "opponent_1" in (selected.get_attribute("aria-label") or "")
    opened.page.fill("#search", "leaf 3")
    assert opened.page.locator("#search-count").inner_text() == "1 found"
    opened.page.fill("#search", "no such name")
    assert opened.page.locator("#search-count").inner_text() == "0 found"


def test_keys_walk_the_tree_and_the_episode(opened: Opened, policy: TreePolicy) -> None:
    opened.page.locator('[data-node="0"]').focus()
    for key in ("ArrowRight", "ArrowRight", "Enter"):
        opened.page.keyboard.press(key)
    wait_for(opened, selected=policy.tree.left[policy.tree.left[0]])
    opened.page.keyboard.press("ArrowLeft")
    opened.page.keyboard.press("ArrowLeft")
    wait_for(opened, visible=policy.tree.n_nodes - 8)
    opened.page.locator("#episode-panel").focus()
    opened.page.keyboard.press("ArrowRight")
    wait_for(opened, step=1)
    opened.page.keyboard.press(" ")
    wait_for(opened, playing="true")


def test_dragging_wheel_and_buttons_move_the_view(opened: Opened) -> None:
    transform = opened.page.locator("#view")
    seen = [transform.get_attribute("transform")]
    box = opened.page.locator("#canvas").bounding_box()
    x, y = box["x"] + 30, box["y"] + 30
    opened.page.mouse.move(x, y)
    opened.page.mouse.down()
    opened.page.mouse.move(x + 50, y + 40, steps=3)
    opened.page.mouse.up()
    seen.append(transform.get_attribute("transform"))
    opened.page.mouse.wheel(0, 200)
    opened.page.wait_for_timeout(50)
    seen.append(transform.get_attribute("transform"))
    for button in ("#zoom-in", "#fit"):
        opened.page.click(button)
        seen.append(transform.get_attribute("transform"))
    assert seen[-1] == seen[0]  # the whole tree again
    assert len(set(seen)) == len(seen) - 1
    assert state(opened, "selected") == ""


def test_the_page_locates_like_the_policy(opened: Opened, policy: TreePolicy) -> None:
    rows = probes(policy.tree, n_random=200)
    text = [[repr(value).replace("inf", "Infinity") for value in row] for row in rows.tolist()]
    found = opened.page.evaluate("rows => rows.map(row => leafOf(row.map(Number)))", text)
    assert found == policy.tree.leaf_index(rows).tolist()


def test_a_click_in_the_slice_selects_the_leaf_there(opened: Opened, policy: TreePolicy) -> None:
    slice_ = opened.page.locator("#slice")
    slice_.scroll_into_view_if_needed()
    rectangles = opened.page.evaluate("rectangles(0, 1, observationNow())")
    for place in rectangles:
        place["x"] = (place["left"] + place["right"]) / 2
        place["y"] = (place["low"] + place["high"]) / 2
    at = opened.page.evaluate(
        "places => places.map(({x, y}) => [scales(0, 1).toX(x), scales(0, 1).toY(y)])",
        rectangles,
    )
    for place, (x, y) in zip(rectangles, at, strict=True):
        slice_.click(position={"x": x, "y": y})
        wait_for(opened, selected=policy.tree.node_of_leaf[place["leaf"]])
    area = sum((p["right"] - p["left"]) * (p["high"] - p["low"]) for p in rectangles)
    assert area == pytest.approx(30.0 * 22.0)


@pytest.mark.promise(25)
def test_any_names_are_harmless(chromium: Any, tmp_path: Path) -> None:
    names = [*NASTY, '"><img src=x onerror=alert(1)>', "</script><script>alert(1)</script>"]
    schema = Schema(tuple(Feature(name, name) for name in names), tuple(names))
    grown = tree(60, len(names), seed=3)
    policy = policy_of(grown, schema, statistics=True)
    rows = np.random.default_rng(0).normal(size=(4, len(names)))
    episode = Episode(rows, np.arange(3), np.zeros(3), False, True, 0, names[-1])
    content = policy_page(policy, episodes=[WatchedEpisode(episode)], title=names[-1])
    (tmp_path / "page.html").write_text(content, encoding="utf-8")
    opened = open_page(chromium, tmp_path / "page.html")
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    opened.page.fill("#search", "script")
    opened.page.press("#search", "Enter")
    for button in ("#forward", "#collapse-all", "#expand-all"):
        opened.page.click(button)
    assert opened.page.locator("img").count() == 1  # the player's own
    assert opened.page.locator("script").count() == 2
    assert opened.page.title() == names[-1].strip()
    opened.assert_quiet()
    opened.page.close()


def test_one_leaf_and_no_episodes(chromium: Any, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text(policy_page(policy_of(tree(1, 1))), encoding="utf-8")
    opened = open_page(chromium, path, width=390, height=844)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    assert not opened.page.locator("#episode-panel").is_visible()
    assert "Every observation comes here" in opened.page.locator("#details").inner_text()
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= 390
    opened.assert_quiet()
    opened.page.close()


def test_a_large_page_is_small(chromium: Any, tmp_path: Path) -> None:
    """200 leaves, 50 episodes of 24 steps, pictures as large as real ones (about 2 kB).

    How long it takes to open is measured by ``benchmarks/policy_page.py``.
    """
    policy = policy_of(tree(200, 3, seed=1), EVASION, statistics=True)
    frame = PIXEL + bytes(2000)
    content = policy_page(policy, episodes=episodes(policy, count=50, steps=24, frame=frame))
    path = tmp_path / "page.html"
    path.write_text(content, encoding="utf-8")
    assert content.count("data:image/webp") == 49 * 25
    assert path.stat().st_size <= 5_000_000
    opened = open_page(chromium, path)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    elements = opened.page.evaluate("document.querySelectorAll('*').length")
    assert elements <= 20 * policy.tree.n_nodes + 1000  # of the order of the tree, not its square
    opened.assert_quiet()
    opened.page.close()


def test_the_verdict_points_at_the_leaf_that_matters(chromium: Any, tmp_path: Path) -> None:
    policy = policy_of(tree(9, 3), EVASION)
    good, bad = episodes(policy, count=2)
    leaf = int(policy.tree.leaf_index(bad.episode.observations[-2:-1])[0])
    node = int(policy.tree.node_of_leaf[leaf])
    action = policy.schema.actions[policy.actions[leaf]]
    bad = replace(bad, episode=replace(bad.episode, is_success=False), frames=())
    words = policy_verdict(policy, [good, bad])
    assert words == [
        "1 of 2 episodes succeed; it ends in ",
        Pointer(f"leaf {leaf} ({action})", f"node-{node}"),
    ]
    (tmp_path / "page.html").write_text(policy_page(policy, episodes=[good, bad]), encoding="utf-8")
    opened = open_page(chromium, tmp_path / "page.html")
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    opened.page.click("#collapse-all")
    for _ in range(2):  # also when the address says it already
        opened.page.click(".verdict a")
        wait_for(opened, selected=node)
        assert opened.page.locator(f'.node.selected[data-node="{node}"]').is_visible()
        opened.page.click("#live")
        wait_for(opened, selected="")
    opened.assert_quiet()
    opened.page.close()


def boxes(opened: Opened, *selectors: str) -> list[dict[str, float]]:
    """Return where elements lie."""
    return [opened.page.locator(selector).first.bounding_box() for selector in selectors]


def test_on_a_phone_nothing_lies_over_the_tree(
    chromium: Any, tmp_path: Path, policy: TreePolicy, watched: list[WatchedEpisode]
) -> None:
    (tmp_path / "page.html").write_text(policy_page(policy, episodes=watched), encoding="utf-8")
    opened = open_page(chromium, tmp_path / "page.html", width=390, height=844)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    key, drawing, tools = boxes(opened, "#key", "#canvas", ".tools")
    assert key["y"] + key["height"] <= drawing["y"] + 1
    assert drawing["y"] + drawing["height"] <= tools["y"] + 1
    assert drawing["height"] > 250
    (live,) = boxes(opened, ".node.leaf.live .box")  # the first step's leaf is in sight
    assert drawing["y"] <= live["y"]
    assert live["y"] + live["height"] <= drawing["y"] + drawing["height"]
    opened.assert_quiet()
    opened.page.close()


def test_the_leaf_of_the_verdict_is_marked_in_the_tree(
    chromium: Any, tmp_path: Path, policy: TreePolicy, watched: list[WatchedEpisode]
) -> None:
    (tmp_path / "page.html").write_text(policy_page(policy, episodes=watched), encoding="utf-8")
    opened = open_page(chromium, tmp_path / "page.html")
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    marked = opened.page.locator(".node:has(.pointed)")
    assert marked.count() == 1
    target = opened.page.locator(".verdict a").get_attribute("href")
    assert target == f"#node-{marked.get_attribute('data-node')}"
    assert "named in the headline" in opened.page.locator("#key").inner_text()
    opened.page.close()


def test_on_paper_the_leaf_stands_beside_the_episode(
    chromium: Any, tmp_path: Path, policy: TreePolicy, watched: list[WatchedEpisode]
) -> None:
    (tmp_path / "page.html").write_text(policy_page(policy, episodes=watched), encoding="utf-8")
    opened = open_page(chromium, tmp_path / "page.html", width=690)  # A4 within its margins
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    opened.page.emulate_media(media="print")
    opened.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    player, leaf = boxes(opened, "#episode-panel", "#details")
    assert player["x"] + player["width"] <= leaf["x"]
    assert abs(player["y"] - leaf["y"]) < 5
    for hidden in (".knob", "#slices", "#play"):
        assert not opened.page.locator(hidden).first.is_visible()
    opened.page.close()


def test_without_failures_the_verdict_names_the_leaf_of_most_steps() -> None:
    policy = policy_of(tree(2, 1), Schema.anonymous(1, 2))
    cut = float(policy.tree.threshold[0])
    rows = np.array([[cut], [cut + 1], [cut + 1], [cut + 1], [cut]])
    _, right = policy.tree.leaf_index(rows[:2]).tolist()
    episode = Episode(rows, np.zeros(4, np.int64), np.ones(4), True, False)
    said = policy_verdict(policy, [WatchedEpisode(episode)])
    assert said[0] == "Mean return 4 in 1 episode; 75 % of all steps end in "
    assert said[1] == Pointer(
        f"leaf {right} ({policy.schema.actions[policy.actions[right]]})",
        f"node-{int(policy.tree.node_of_leaf[right])}",
    )
    assert policy_verdict(policy, []) == ["A tree of 2 leaves"]


def test_pictures_that_do_not_fit_are_left_out() -> None:
    policy = policy_of(tree(9, 3), EVASION)
    watched = episodes(policy, count=9, frame=PIXEL + bytes(30_000))
    content = policy_page(policy, episodes=watched, size_limit=1_000_000)
    assert len(content.encode()) <= 1_000_000
    frames = [episode["frames"] is not None for episode in page_data(content)["episodes"]]
    assert frames == [True] + [False] * 8


def test_policies_with_a_history_see_their_past() -> None:
    schema = Schema.anonymous(2, 2).with_history(1)
    policy = TreePolicy(tree(5, 4), np.arange(5) % 2, schema, history=1)
    rows = np.arange(8.0).reshape(4, 2)
    episode = Episode(rows, np.zeros(3, np.int64), np.zeros(3), True, False)
    expected = [[0, 1, 0, 1], [2, 3, 0, 1], [4, 5, 2, 3], [6, 7, 4, 5]]
    np.testing.assert_array_equal(policy_features(policy, episode), expected)
    with pytest.raises(InvalidArgumentError, match="observations of 2 features, got 3"):
        policy_features(policy, replace(episode, observations=np.zeros((4, 3))))


def test_same_policy_same_page(policy: TreePolicy, watched: list[WatchedEpisode]) -> None:
    first, second = (policy_page(policy, episodes=watched) for _ in range(2))
    assert first == second


def test_frames_must_be_one_for_each_observation(watched: list[WatchedEpisode]) -> None:
    with pytest.raises(InvalidArgumentError, match="one for each of the 13 observations"):
        WatchedEpisode(watched[0].episode, (PIXEL,))


@pytest.mark.parametrize("path", sorted(ASSETS.glob("*.js")), ids=lambda path: path.name)
def test_scripts_parse(path: Path) -> None:
    subprocess.run([need("node"), "--check", str(path)], check=True)


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1280, "dark")])
def test_nothing_serious_for_axe(
    chromium: Any, axe: str, file: Path, scheme: str, width: int
) -> None:
    # The page's own policy would refuse axe itself.
    context = chromium.new_context(
        bypass_csp=True, viewport={"width": width, "height": 800}, color_scheme=scheme
    )
    page = context.new_page()
    page.goto(file.as_uri())
    page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    page.click(".node.leaf >> nth=0")
    grave = grave_violations(page, axe)
    context.close()
    assert grave == []


def test_facts_are_words() -> None:
    """A page began with action_grid = [['torque [N m]', [-2.0, ...]]]."""
    control = Control("torque", "N m", (-2.0, -2 / 3, 2 / 3, 2.0))
    schema = Schema(EVASION.features, combined_actions((control,)), (control,))
    grid = [["torque [N m]", list(control.levels)]]
    spec = EnvironmentSpec("Pendulum-v1", {"action_grid": grid, "decode": True, "n_opponents": 2})
    page = policy_page(replace(policy_of(tree(1, 3), schema), environment=spec))
    facts = re.search(r'class="facts">(.*?)<', page)[1]
    assert facts.endswith("torque in 4 levels from -2 to 2 N m, decode, opponents 2")


def test_the_key_names_numbers_by_quantities_or_by_the_names_that_they_have() -> None:
    """Actions that the environment names, but counts from 5, were 5, 6, 7 and 8."""
    control = Control("action", "", (5.0, 6.0))
    unnamed = Schema(EVASION.features, combined_actions((control,)), (control,))
    named = replace(unnamed, actions=("wait", "left"))
    texts = tree_data(policy_of(tree(1, 3), unnamed), ())["levels"]["texts"]
    assert texts == ["5", "6"]
    assert tree_data(policy_of(tree(1, 3), named), ())["levels"] is None


def test_a_leaf_lists_what_was_tried_and_says_what_values_are(
    chromium: Any, tmp_path: Path
) -> None:
    """Nine of twelve rows said "0, untried", under the heading "Q value", of a mean return."""
    schema = Schema((Feature("x", "", 0.0, 9.0),), tuple(f"a{k}" for k in range(12)))
    visits, values = np.zeros((2, 12), int), np.full((2, 12), np.nan)
    visits[0, 4], values[0, 4] = 30, 2.5
    known = LeafStatistics(visits, values, np.full((2, 12), np.nan))
    grown = tree(1, 1).split(0, 0, 5.0)
    path = tmp_path / "policy.html"
    page = policy_page(TreePolicy(grown, np.array([4, 11]), schema, leaves=known))
    path.write_text(page, encoding="utf-8")
    opened = open_page(chromium, path)
    node = int(grown.node_of_leaf[0])
    opened.page.click(f'[data-node="{node}"] .box')
    wait_for(opened, selected=node)
    words = opened.page.locator("#details").inner_text()
    assert "Never tried here: the other 11 of 12 actions." in words
    assert f"Here {known.meaning}." in words
    assert "no Q" in words
    assert opened.page.locator("#details tbody tr").count() == 1
    opened.assert_quiet()
    opened.page.close()


def test_a_page_speaks_of_kinds_as_rules_do(chromium: Any, tmp_path: Path) -> None:
    """Each leaf in the words of ``Region``, each test in those of ``question``."""
    kinds = {"open": "flag", "tariff": "integer", "mode": ("off", "low", "mid", "high")}
    features = [Feature(f"phase is {name}", low=0, high=1) for name in "ABCD"]
    features += [Feature("open", low=0, high=1), Feature("tariff", "ct", 0, 3)]
    schema = Schema((*features, Feature("mode", low=1, high=4)), ("go", "wait"))
    schema = schema.with_kinds({**kinds, "phase": tuple("ABCD")})
    cuts = [
        (0, 0, 0.5),
        (0, 2, 0.5),
        (0, 4, 0.0),
        (0, 5, 1.5),
        (4, 5, 2.0),
        (1, 6, 3.0),
        (1, 6, 1.0),
    ]
    grown = DecisionTree.single_leaf(7).split_each(cuts)
    policy = TreePolicy(grown, np.arange(grown.n_leaves) % 2, schema)
    path = tmp_path / "kinds.html"
    path.write_text(policy_page(policy), encoding="utf-8")
    opened = open_page(chromium, path)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    told = opened.page.evaluate(
        "tree.feature.map((_, node) => [wordsOf(node), conditionsOf(node)])"
    )
    low, high = leaf_boxes(grown)
    for node, (words, conditions) in enumerate(told):
        if grown.leaf[node] < 0:
            assert words == asked(schema, grown, node).question().replace("<=", "≤")
        else:
            leaf = grown.leaf[node]
            wanted = Region(low[leaf], high[leaf]).words(schema, domain(schema))
            found = {one.replace("≤", "<=").replace("≥", ">=") for one in conditions}
            assert found == set(wanted.split(" and ")) or "<= tariff" in wanted
    answers = opened.page.evaluate("[answerOf(0, true), answerOf(0, false)]")
    assert answers == ["no", "yes"]
    opened.assert_quiet()
    opened.page.close()


def test_what_a_tested_derived_feature_is_made_of_is_no_axis_of_the_slice() -> None:
    """Along it the derived feature was held at its present value: the plane was one rectangle."""
    schema = Schema((Feature("a"), Feature("b"), Feature("c")), ("off", "on"))
    schema = schema.derive(["sum = a + b", "twice = 2 * c"])
    policy = TreePolicy(DecisionTree.single_leaf(5).split(0, 3, 1.0), np.array([0, 1]), schema)
    parts = [one["name"] for one in tree_data(policy, ())["features"] if one["isPart"]]
    assert parts == ["a", "b"]
