"""A tree from demonstrations that is played, compared with its demonstrator, and explained."""

from typing import TYPE_CHECKING

from eutree.fitting.report import FitReport, Person, Standing
from eutree.lazy import lazily

if TYPE_CHECKING:
    from eutree.fitting.hurting import Hurt, Hurting, accepted, find_hurting, restored
    from eutree.recording.tree_making import Segment

__all__ = [
    "FitReport", "Hurt", "Hurting", "Person", "Segment", "Standing", "accepted", "find_hurting",
    "restored",
]  # fmt: skip

__getattr__ = lazily(
    __name__,
    {
        "eutree.fitting.hurting": "Hurt Hurting accepted find_hurting restored",
        "eutree.recording.tree_making": "Segment",
    },
)
