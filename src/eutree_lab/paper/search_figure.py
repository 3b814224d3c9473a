"""What a search found, as one picture: which setting agrees with the paper in which number."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from eutree_lab.paper.objective import NUMBERS
from eutree_lab.paper.search import Scored

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNTOLD, FAR, NEAR, AGREES = range(4)
COLOURS = ("#f2f2f2", "#d9a98a", "#f0d8b0", "#2a7f3e")
NAMES = ("not told", "further away", "within one miss", "agrees")
ONE_MISS = 0.5  # cost of a number that is one miss outside its range
MOST = 40  # settings that fit on a page


def shown(scored: Sequence[Scored]) -> list[Scored]:
    """Return the settings with learning runs, by how many numbers agree, at most ``MOST``."""
    learned = [one for one in scored if one.setting.reading is not None]
    return sorted(learned, key=lambda one: -one.distance.n_agreeing)[:MOST]


def draw(axes: "Axes", scored: Sequence[Scored]) -> None:
    """Draw a row each number and a column each setting, those that agree in most first."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    columns = shown(scored)
    cells = np.array([[_level(one, number.name) for one in columns] for number in NUMBERS])
    axes.imshow(cells, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=3.5, aspect="auto")
    axes.set_yticks(range(len(NUMBERS)), [f"{n.name} ({n.paper})" for n in NUMBERS], fontsize=7)
    axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(NUMBERS) + 1) - 0.5, minor=True)
    axes.grid(visible=False, which="major")
    axes.grid(which="minor", color="white", linewidth=1.0, alpha=1.0)
    axes.tick_params(which="both", length=0)
    totals = [str(one.distance.n_agreeing) for one in columns]
    axes.set_xticks(range(len(columns)), totals, fontsize=7)
    axes.set_xlabel("Settings, by how many numbers agree")
    patches = [Patch(color=c, label=n) for c, n in zip(COLOURS, NAMES, strict=True)]
    axes.legend(handles=patches[::-1], fontsize=7, frameon=False, ncols=4,
                loc="lower left", bbox_to_anchor=(0.0, 1.0))  # fmt: skip


def _level(one: Scored, name: str) -> int:
    """Return how near a number of a setting is."""
    cost = one.distance.costs.get(name)
    if cost is None:
        return UNTOLD
    if cost == 0.0:
        return AGREES
    return NEAR if cost <= ONE_MISS else FAR
