"""The page of methods names every method, and no other."""

import re
from pathlib import Path

from eutree.learners.registry import METHODS, PRESETS

PAGE = Path(__file__).parents[2] / "docs" / "methods.md"


def test_the_page_has_a_row_for_every_method():
    rows = re.findall(r"^\| `([a-z-]+)` \| .* \|$", PAGE.read_text(), re.MULTILINE)
    assert set(METHODS) <= set(rows), "a method without a row in the second table"


def test_every_preset_it_names_is_one():
    named = re.search(r"presets `(.*)`, `(.*)` \|", PAGE.read_text())
    assert named is not None
    assert set(named.groups()) <= set(PRESETS)
