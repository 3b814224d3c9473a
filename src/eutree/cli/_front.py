"""A front in the terminal: leaves, return with interval, success, the longer the line the more."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eutree.compression.report import FrontEntry

HEADER = "leaves  return [95 %]                 success"
WIDTH = 20


def drawn(front: "Sequence[FrontEntry]", first: str, picked: int | None = None) -> str:
    """Return the front as lines; "" if there is none.

    Args:
        front: The trees, the first of which the others were made of.
        first: The name of that one.
        picked: Leaves of the tree that was picked; None for none.
    """
    if not front:
        return ""
    best = max(one.mean_return for one in front)
    least = min(one.mean_return for one in front)
    lines = [HEADER]
    for number, one in enumerate(front):
        low, high = one.return_interval
        width = round(WIDTH * (one.mean_return - least) / ((best - least) or 1.0))
        success = "" if one.success_rate is None else f"{one.success_rate:.1%}"
        mark = f"  {first}" if number == 0 else ""
        if number and one.policy.n_leaves == picked:
            mark = "  picked"
        earned = f"{one.mean_return:.2f} [{low:.2f}, {high:.2f}]"
        lines.append(
            f"{one.policy.n_leaves:>6}  {earned:<28}  {success:>6}  {'#' * width}{mark}".rstrip()
        )
    return "\n".join(lines) + "\n"
