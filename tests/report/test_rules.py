"""The rules on a policy's page: changed, locked, judged, undone, downloaded, read back."""

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eutree.cli.main import run
from eutree.export.c import probes
from eutree.policies import TreePolicy
from eutree.report import WatchedEpisode, policy_page
from eutree.schema import Feature, Schema
from tests.export.policies import NASTY, policy_of, tree
from tests.report.browser import ENOUGH, Opened, grave_violations, open_page
from tests.report.pages import page_data
from tests.report.watched import episodes

THRESHOLD = '[data-rule="{}"] input'
ACTION = '[data-rule="{}"] select'
LOCK = '[data-rule="{}"] .lock'


@pytest.fixture
def file(policy: TreePolicy, watched: list[WatchedEpisode], tmp_path: Path) -> Path:
    policy.save(tmp_path / "it's mine.json")
    path = tmp_path / "page.html"
    content = policy_page(policy, episodes=watched, file="it's mine.json")
    path.write_text(content, encoding="utf-8")
    return path


@pytest.fixture
def opened(chromium: Any, file: Path) -> Iterator[Opened]:
    opened = open_page(chromium, file)
    opened.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    opened.page.click("#rules-fold summary")
    opened.page.wait_for_selector("[data-rule]")
    yield opened
    opened.assert_quiet()
    opened.page.close()


def put(opened: Opened, node: int, value: float | str) -> None:
    field = opened.page.locator(THRESHOLD.format(node))
    field.fill(str(value))
    field.press("Enter")


def choose(opened: Opened, policy: TreePolicy, leaf: int, action: int) -> None:
    node = policy.tree.node_of_leaf[leaf]
    opened.page.select_option(ACTION.format(node), str(action))


def downloaded(opened: Opened, folder: Path) -> TreePolicy:
    with opened.page.expect_download() as waiting:
        opened.page.click("#download")
    assert waiting.value.suggested_filename.endswith("-edited.json")
    waiting.value.save_as(folder / "downloaded.json")
    return TreePolicy.load(folder / "downloaded.json")


def command(opened: Opened) -> list[str]:
    """Return the words of the command line, as bash reads them."""
    line = opened.page.input_value("#command")
    script = f"printf '%s\\0' {line}"
    words = subprocess.run(["bash", "-c", script], capture_output=True, check=True).stdout
    return words.decode().split("\0")[:-1]


def by_command(opened: Opened, folder: Path, monkeypatch: pytest.MonkeyPatch) -> TreePolicy:
    monkeypatch.chdir(folder)
    line = command(opened)
    assert line[:2] == ["eutree", "edit"]
    assert run([*line[1:], "--episodes", "0"]) == 0
    return TreePolicy.load(folder / line[-1])


def data_of(opened: Opened, name: str) -> str | None:
    return opened.page.locator("body").get_attribute(f"data-{name}")


def test_all_rules_are_there(opened: Opened, policy: TreePolicy) -> None:
    assert opened.page.locator("[data-rule]").count() == policy.tree.n_nodes
    for node in np.flatnonzero(policy.tree.feature >= 0).tolist():
        value = opened.page.input_value(THRESHOLD.format(node))
        assert float(value) == policy.tree.threshold[node]
    assert not opened.page.locator("#effects").is_visible()


def test_a_change_is_judged_drawn_and_undone(
    opened: Opened,
    policy: TreePolicy,
    watched: list[WatchedEpisode],
) -> None:
    rows = np.concatenate([entry.episode.observations[:-1] for entry in watched])
    before = policy.predict(rows)[0]
    labels = policy.actions.copy()
    labels[0] = 1 - labels[0]
    cuts = policy.tree.threshold.copy()
    cuts[0] = 15.25
    put(opened, 0, 15.25)
    choose(opened, policy, 0, int(labels[0]))
    tree_ = policy.tree
    arrays = (tree_.feature, cuts, tree_.left, tree_.right, tree_.leaf)
    edited = TreePolicy(type(tree_)(3, *arrays), labels, policy.schema)
    n_changed = int((edited.predict(rows)[0] != before).sum())
    assert n_changed > 0
    assert data_of(opened, "changed") == str(n_changed)
    words = opened.page.locator("#effects-words").inner_text()
    assert f"{n_changed} of {len(rows)} recorded steps" in words
    assert (
        opened.page.locator('[data-node="0"]').get_attribute("aria-label") == "position ≤ 15.25 m?"
    )
    opened.page.locator("#effects-words button").first.click()
    assert "edited: " in opened.page.locator("#status").inner_text()
    found = opened.page.evaluate("rows => rows.map(leafOf)", rows.tolist())
    assert found == edited.tree.leaf_index(rows).tolist()
    opened.page.click("#undo")
    opened.page.click("#undo")
    assert data_of(opened, "edits") == "0"
    assert not opened.page.locator("#effects").is_visible()
    found = opened.page.evaluate("rows => rows.map(leafOf)", rows.tolist())
    assert found == policy.tree.leaf_index(rows).tolist()


def test_the_download_and_the_command_make_the_same_policy(
    opened: Opened,
    policy: TreePolicy,
    file: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    exact = float(np.nextafter(17.3, 18.0))
    put(opened, 0, repr(exact))
    choose(opened, policy, 2, 1 - int(policy.actions[2]))
    opened.page.click(LOCK.format(policy.tree.left[0]))
    got = downloaded(opened, file.parent)
    assert got.tree.threshold[0] == exact
    assert got.locked == tuple(
        sorted(leaf for leaf in range(6) if 0 in (leaf, 0) and leaf in below(policy))
    )
    assert got.leaves is None  # counts of other boxes
    meant = by_command(opened, file.parent, monkeypatch)
    assert got == meant
    rows = probes(got.tree, n_random=300)
    np.testing.assert_array_equal(got.predict(rows)[0], meant.predict(rows)[0])
    text = [[repr(value).replace("inf", "Infinity") for value in row] for row in rows.tolist()]
    on_page = opened.page.evaluate(
        "rows => rows.map(row => data.leafActions[leafOf(row.map(Number))])", text
    )
    assert on_page == got.predict(rows)[0].tolist()


def below(policy: TreePolicy) -> set[int]:
    """Return the leaves under the root's yes branch."""
    tree_ = policy.tree
    return {leaf for leaf in range(policy.n_leaves) if tree_.left[0] in tree_.path(leaf)}


def test_an_action_alone_keeps_what_is_known_of_the_leaves(
    opened: Opened,
    policy: TreePolicy,
    file: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    choose(opened, policy, 1, 1 - int(policy.actions[1]))
    got = downloaded(opened, file.parent)
    assert got == by_command(opened, file.parent, monkeypatch)
    assert got.leaves is not None


def test_what_is_locked_cannot_be_changed(opened: Opened, policy: TreePolicy) -> None:
    node = int(policy.tree.node_of_leaf[3])
    opened.page.click(LOCK.format(node))
    assert opened.page.locator(ACTION.format(node)).is_disabled()
    above = [at for at in policy.tree.path(3) if at != node]
    for at in above:
        assert opened.page.locator(THRESHOLD.format(at)).is_disabled()
    assert command(opened)[3:] == ["--lock", str(node), "--out", "it's mine-edited.json"]
    opened.page.click(LOCK.format(node))
    assert opened.page.locator(ACTION.format(node)).is_enabled()
    assert data_of(opened, "edits") == "0"


def test_what_was_locked_is_unlocked_changed_and_locked_again(
    chromium: Any,
    policy: TreePolicy,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    guarded = TreePolicy(
        policy.tree, policy.actions, policy.schema, leaves=policy.leaves, locked=(0, 3)
    )
    guarded.save(tmp_path / "policy.json")
    path = tmp_path / "page.html"
    path.write_text(policy_page(guarded), encoding="utf-8")
    opened = open_page(chromium, path)
    opened.page.click("#rules-fold summary")
    node = int(policy.tree.node_of_leaf[3])
    opened.page.click(LOCK.format(node))
    choose(opened, policy, 3, 1 - int(policy.actions[3]))
    opened.page.click(LOCK.format(node))
    assert "No episode is recorded" in opened.page.locator("#effects-words").inner_text()
    got = downloaded(opened, tmp_path)
    assert got.locked == (0, 3)
    assert got.actions[3] != policy.actions[3]
    assert got == by_command(opened, tmp_path, monkeypatch)
    opened.assert_quiet()
    opened.page.close()


@pytest.mark.parametrize(
    ("text", "problem"),
    [("", "must be a number"), ("1e999", "must be a number"), ("31", "must be from 0 to 30")],
)
def test_a_threshold_that_cannot_be_is_refused(opened: Opened, text: str, problem: str) -> None:
    put(opened, 0, text)
    assert problem in opened.page.locator("#rules-problem").inner_text()
    assert data_of(opened, "edits") in (None, "0")
    put(opened, 0, "17")
    assert opened.page.locator("#rules-problem").inner_text() == ""
    assert data_of(opened, "edits") == "1"


def test_leaves_that_nothing_reaches_are_named(opened: Opened) -> None:
    put(opened, 0, 3)  # position <= 4 below it holds always
    words = opened.page.locator("#effects-words").inner_text()
    assert "No observation reaches leaf 2 any more." in words
    opened.page.click("#start-over")
    assert data_of(opened, "edits") == "0"
    opened.page.click("#undo")
    assert data_of(opened, "edits") == "1"


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_anyone_can_change_rules(
    chromium: Any, axe: str, file: Path, width: int, scheme: str
) -> None:
    # The page's own policy would refuse axe itself.
    context = chromium.new_context(
        bypass_csp=True, viewport={"width": width, "height": 800}, color_scheme=scheme
    )
    page = context.new_page()
    page.goto(file.as_uri())
    page.click("#rules-fold summary")
    page.fill(THRESHOLD.format(0), "15")
    page.keyboard.press("Enter")
    page.wait_for_selector("#effects:not([hidden])")
    at = page.evaluate("document.activeElement.closest('[data-rule]').dataset.rule")
    wide = page.evaluate("document.documentElement.scrollWidth")
    page.locator(LOCK.format(1)).click()
    grave = grave_violations(page, axe)
    context.close()
    assert (at, grave) == ("0", [])
    assert wide <= width


@pytest.mark.promise(25)
def test_any_names_survive_the_page_and_the_shell(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    schema = Schema(tuple(Feature(name, name) for name in NASTY), tuple(NASTY))
    grown = policy_of(tree(len(NASTY), len(NASTY), seed=3), schema)
    grown.save(tmp_path / "policy.json")
    path = tmp_path / "page.html"
    path.write_text(policy_page(grown), encoding="utf-8")
    opened = open_page(chromium, path)
    opened.page.click("#rules-fold summary")
    unspeakable = next(number for number, name in enumerate(NASTY) if "\0" in name)
    for action in range(len(NASTY)):
        if action != unspeakable:
            choose(opened, grown, action, action)
    got = downloaded(opened, tmp_path)
    assert np.delete(got.actions, unspeakable).tolist() == [
        action for action in range(len(NASTY)) if action != unspeakable
    ]
    assert got.schema == schema
    assert got == by_command(opened, tmp_path, monkeypatch)
    choose(opened, grown, unspeakable, unspeakable)
    assert opened.page.input_value("#command").startswith("# A name holds a character")
    assert downloaded(opened, tmp_path).actions.tolist() == list(range(len(NASTY)))
    opened.assert_quiet()
    opened.page.close()


def test_many_observations_are_rounded_to_keep_the_page_small(policy: TreePolicy) -> None:
    few = page_data(policy_page(policy, episodes=episodes(policy, count=2)))
    rows = episodes(policy, count=2)[1].episode.observations.tolist()
    assert few["episodes"][1]["observations"] == rows
    many = page_data(policy_page(policy, episodes=episodes(policy, count=2, steps=11_000)))
    assert all(len(repr(v).lstrip("-")) <= 12 for v in many["episodes"][0]["observations"][5])
