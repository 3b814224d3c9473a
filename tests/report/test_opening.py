"""How a page opens: the tree fitted to the window, what is seldom reached folded."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eutree.report import policy_page
from eutree.trees import DecisionTree
from tests.export.policies import EVASION, policy_of
from tests.report.browser import ENOUGH, Opened, open_page
from tests.report.watched import episodes

SEEN = """() => {
  const outer = document.getElementById("canvas").getBoundingClientRect();
  return [...document.querySelectorAll("#nodes .box")].map((box) => {
    const { left, right, top, bottom } = box.getBoundingClientRect();
    return left >= outer.left - 1 && right <= outer.right + 1 && top >= outer.top - 1 && bottom <= outer.bottom + 1;
  });
}"""  # noqa: E501 - a script
OVER = """() => {
  const key = document.getElementById("key").getBoundingClientRect();
  return [...document.querySelectorAll("#nodes .box")].filter((box) => {
    const { left, right, top, bottom } = box.getBoundingClientRect();
    return left < key.right && right > key.left && top < key.bottom && bottom > key.top;
  }).length;
}"""
MARKED = """() => [...document.querySelectorAll(".node:has(.pointed)")]
  .map((group) => Number(group.dataset.node))"""
NAMED = "() => pathTo([...pointed].find((node) => node < nNodes))"


def grown(n_leaves: int) -> DecisionTree:
    """Return a tree that cuts what is visited most, somewhere."""
    rng, tree = np.random.default_rng(0), DecisionTree.single_leaf(3)
    rows = rng.uniform((0, -11, -11), (30, 11, 11), size=(4000, 3))
    while tree.n_leaves < n_leaves:
        leaf = int(np.bincount(tree.leaf_index(rows), minlength=tree.n_leaves).argmax())
        feature = int(rng.integers(3))
        column = rows[tree.leaf_index(rows) == leaf, feature]
        tree = tree.split(leaf, feature, float(np.quantile(column, rng.uniform(0.1, 0.9))))
    return tree


def opened(chromium: Any, folder: Path, n_leaves: int, width: int, height: int) -> Opened:
    policy = policy_of(grown(n_leaves), EVASION, seed=1)
    path = folder / "policy.html"
    watched = episodes(policy, count=8, steps=60)
    path.write_text(policy_page(policy, episodes=watched), encoding="utf-8")
    found = open_page(chromium, path, width=width, height=height)
    found.page.wait_for_selector("body[data-ready]", timeout=ENOUGH)
    return found


@pytest.mark.parametrize(("width", "height"), [(1280, 860), (390, 844)])
@pytest.mark.parametrize("n_leaves", [5, 17, 60, 299])
def test_a_page_opens_on_all_that_it_shows(
    chromium: Any, tmp_path: Path, n_leaves: int, width: int, height: int
) -> None:
    """Of 17 leaves four were visible, of 299 one; the rest was a void."""
    found = opened(chromium, tmp_path, n_leaves, width, height)
    page = found.page
    seen = page.evaluate(SEEN)
    assert all(seen)
    assert len(seen) >= min(2 * n_leaves - 1, 25 if width > 1000 else 5)
    assert page.evaluate(OVER) == 0
    assert page.evaluate("view.scale") >= 0.6
    rare = page.evaluate("""() => {
      const isNamed = (node) => [...pointed].some((end) => pathTo(end).includes(node));
      return [...places.keys()].filter((node) => isOpen(node) && shareOf(node) < 0.02 && !isNamed(node));
    }""")  # noqa: E501 - a script
    assert rare == [] or len(seen) == 2 * n_leaves - 1
    page.click("#expand-all")
    assert page.locator("#nodes > g").count() == 2 * n_leaves - 1
    found.assert_quiet()
    page.close()


def test_following_moves_nothing_that_is_seen(chromium: Any, tmp_path: Path) -> None:
    found = opened(chromium, tmp_path, 17, 1280, 860)
    before = found.page.evaluate("({ ...view })")
    for _ in range(20):
        found.page.click("#forward")
        assert all(found.page.evaluate(SEEN))
    assert found.page.evaluate("({ ...view })") == before
    found.page.evaluate("() => { view.x -= 2000; applyView(); show({ step: 0 }); }")
    live = """() => Math.max(...[...document.querySelectorAll(".node.live .box")]
      .map((box) => box.getBoundingClientRect().left))"""
    assert found.page.evaluate(live) >= 0  # what is not seen is brought into view
    found.page.close()


def test_the_branch_that_hides_the_named_leaf_is_marked(chromium: Any, tmp_path: Path) -> None:
    page = opened(chromium, tmp_path, 60, 390, 844).page
    way = page.evaluate(NAMED)
    seen = []
    while not seen or seen[-1] != way[-1]:
        (marked,) = page.evaluate(MARKED)
        assert marked in way
        assert seen == [] or way.index(marked) > way.index(seen[-1])
        seen.append(marked)
        if marked != way[-1]:
            page.evaluate("(node) => toggle(node, true)", marked)
    assert len(seen) > 1  # it was folded away at first
    page.close()
