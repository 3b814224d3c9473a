"""The front of a run in its folder: ``front.csv``, and its trees in ``front/``."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from eutree.compression.report import FrontEntry
from eutree.files import make_folder, write_text
from eutree.policies import TreePolicy

COLUMNS = ("tree", "n_leaves", "mean_return", "return_low", "return_high", "success_rate",
           "success_low", "success_high", "picked")  # fmt: skip


def names_of(front: Sequence[FrontEntry]) -> list[str]:
    """Return the name of each tree's file: the first is what the others were made of."""
    return ["front/learned.json", *(f"front/{one.policy.n_leaves}.json" for one in front[1:])]


def save_front(folder: Path, front: Sequence[FrontEntry], picked: TreePolicy | None) -> None:
    """Write the trees of a front, and the table of what they earned."""
    make_folder(folder / "front")
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for number, (name, one) in enumerate(zip(names_of(front), front, strict=True)):
        one.policy.save(folder / name)
        success = ("", "") if one.success_interval is None else one.success_interval
        rate = "" if one.success_rate is None else one.success_rate
        size = one.policy.n_leaves
        is_picked = number > 0 and picked is not None and size == picked.n_leaves
        row = (name, size, one.mean_return, *one.return_interval, rate, *success, int(is_picked))
        table.writerow(row)
    write_text(folder / "front.csv", text.getvalue())
