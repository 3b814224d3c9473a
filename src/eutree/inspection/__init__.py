"""Look into policies: their differences, their proven properties, the reasons of a decision."""

from eutree.inspection.diff import Disagreement, PolicyDiff, diff
from eutree.inspection.edit import Edited, edit, enforce, numbered
from eutree.inspection.monotone import keep_monotone, monotone_rules
from eutree.inspection.properties import Property
from eutree.inspection.regions import Region
from eutree.inspection.verify import CounterExample, Verification, verify
from eutree.inspection.why import Alternative, Explanation, PathTest, Support, why

__all__ = [
    "Alternative", "CounterExample", "Disagreement", "Edited", "Explanation", "PathTest",
    "PolicyDiff", "Property", "Region", "Support", "Verification", "diff", "edit", "enforce",
    "keep_monotone", "monotone_rules", "numbered", "verify", "why",
]  # fmt: skip
