"""The leaf that the headline names is marked, and so is the closed branch that hides it."""

from pathlib import Path
from typing import Any

from tests.report.test_opening import opened

MARKED = """() => [...document.querySelectorAll(".node:has(.pointed)")]
  .map((group) => Number(group.dataset.node))"""
NAMED = "() => pathTo([...pointed].find((node) => node < nNodes))"


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
