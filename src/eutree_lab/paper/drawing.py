"""The look of the figures: matplotlib without a window, one colour a learner, shaded intervals."""

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from eutree.arrays import Floats
from eutree.errors import needed
from eutree.evaluation import mean_interval
from eutree_lab.paper.experiment import Records

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LABELS = {
    "c-u-tree": "C. U-Tree",
    "eu-tree-dt": "EU-Tree - DT",
    "eu-tree": "EU-Tree",
    "expert": "Expert tree",
}
COLOURS = {
    "C. U-Tree": "#0b5fa5",
    "EU-Tree - DT": "#2a7f3e",
    "EU-Tree": "#a8480c",
    "Expert tree": "#555555",
}
_SAVED: dict[str, dict[str, Any]] = {
    "svg": {"metadata": {"Date": None}},
    "png": {"dpi": 150, "metadata": {"Software": None}},
}


def blank(title: str, size: tuple[float, float]) -> "Figure":
    """Return an empty figure of a size in inches, which needs no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=11)
    return figure


def drawn(name: str, make: "Callable[[], Figure]", *formats: str) -> list[bytes]:
    """Return a figure in some formats, "svg" or "png"; the same figure is always the same bytes.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    with needed("matplotlib", "plot"):
        import matplotlib as mpl
    files = [BytesIO() for _ in formats]
    # A fixed salt and no date.
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure = make()
        for file, kind in zip(files, formats, strict=True):
            figure.savefig(file, format=kind, **_SAVED[kind])
    return [file.getvalue() for file in files]


def side_by_side(
    title: str, records: Mapping[str, Records], panel: "Callable[[Axes, Records], None]"
) -> "Figure":
    """Return a figure with a panel for each preset, from its records.

    Args:
        title: Of the figure.
        records: Those of each preset; one panel without a name if they do not depend on it.
        panel: Draws some records on some axes.
    """
    figure = blank(title, (5.2 * len(records), 3.8))
    axes = np.atleast_1d(figure.subplots(1, len(records), sharey=True))
    for axis, (name, group) in zip(axes, records.items(), strict=True):
        is_of_preset = any(record.spec.preset for record in group)
        axis.set_title(f"preset {name}" if is_of_preset else "", fontsize=10)
        clear(axis)
        panel(axis, group)
    return figure


def clear(axis: "Axes") -> None:
    """Give the axes a light grid and no box."""
    axis.grid(alpha=0.25, linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)


def curve(axis: "Axes", x: Sequence[float], runs: Floats, name: str, *, style: str = "-") -> None:
    """Draw the mean of some runs, shape [runs, points], with the 95 % interval shaded."""
    intervals = np.array([mean_interval(column) for column in runs.T])
    colour = COLOURS.get(name)
    (line,) = axis.plot(x, runs.mean(axis=0), style, label=name, color=colour, linewidth=1.6)
    axis.fill_between(
        x, intervals[:, 0], intervals[:, 1], color=line.get_color(), alpha=0.18, linewidth=0
    )


def label(axis: "Axes", x: str, y: str, *, limits: tuple[float, float] | None = None) -> None:
    """Name the axes and show the legend."""
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    if limits is not None:
        axis.set_ylim(*limits)
    axis.legend(fontsize=8, frameon=False)
