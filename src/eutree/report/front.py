"""A front on a page: what each size earns, and a walk from the largest tree to the smallest."""

from collections.abc import Sequence
from html import escape

from eutree.compression.report import FrontEntry
from eutree.export import to_svg
from eutree.inspection import diff
from eutree.report.chart import scatter
from eutree.wording import counted

CHANGES = 6  # boxes that are named of each step


def front_in_words(front: Sequence[FrontEntry]) -> str:
    """Return what each size earns, in a line.

    Args:
        front: What was learned and the best tree of each size, the largest first.
    """
    return "; ".join(f"{counted(one.policy.n_leaves, 'leaf')}: {_earned(one)}" for one in front)


def front_section(front: Sequence[FrontEntry], picked: int | None) -> str:
    """Return the charts of a front, and its trees, of which one is open at a time.

    Args:
        front: What was learned and the best tree of each size, the largest first.
        picked: Leaves of the tree that was picked; None for none.
    """
    walk = "".join(
        _step(front[max(number - 1, 0)], one, _name(number, one, picked))
        for number, one in enumerate(front)
    )
    words = (
        "The best tree of each size, all of them in the same episodes, which chose none of them. "
        "Open one to see it, what it decides otherwise than the one before, and what that costs."
    )
    return (
        f'<p class="quiet">{words}</p><div class="charts">{"".join(front_charts(front))}</div>\n'
        f'<div class="front">{walk}</div>'
    )


def front_charts(front: Sequence[FrontEntry]) -> list[str]:
    """Return what each size earns, and how often it succeeds where that is reported, drawn.

    Args:
        front: What was learned and the best tree of each size, the largest first.
    """
    rates = [(one, one.success_rate) for one in front if one.success_rate is not None]
    charts = [_chart("mean return", [(one, one.mean_return) for one in front])] if front else []
    return [*charts, _chart("share of successes", rates)] if rates else charts


def _chart(measure: str, values: Sequence[tuple[FrontEntry, float]]) -> str:
    points = [
        (float(one.policy.n_leaves), value, f"{counted(one.policy.n_leaves, 'leaf')}: {value:.4g}")
        for one, value in values
    ]
    return (
        f"<figure><figcaption>{measure.capitalize()} by leaves</figcaption>\n"
        f"{scatter('leaves', measure, points)}</figure>"
    )


def _name(number: int, one: FrontEntry, picked: int | None) -> str:
    if number == 0:
        return ", as learned"
    return ", the pick" if one.policy.n_leaves == picked else ""


def _step(larger: FrontEntry, one: FrontEntry, name: str) -> str:
    """Return a tree, folded, with what changed from its larger neighbour."""
    title = f"{counted(one.policy.n_leaves, 'leaf')}{name}: {_earned(one)}"
    changed = "" if one is larger else _changed(larger, one)
    label = escape(f"{counted(one.policy.n_leaves, 'leaf')}{name}, drawn")
    return (
        f'<details name="front"><summary>{escape(title)}</summary>{changed}'
        f'<div class="scrolls tree" tabindex="0" role="region" aria-label="{label}">'
        f"{to_svg(one.policy, standalone=False)}</div></details>\n"
    )


def _changed(larger: FrontEntry, one: FrontEntry) -> str:
    """Return what a tree costs beside its larger neighbour, and where it decides otherwise."""
    found = diff(larger.policy, one.policy)
    cost = one.mean_return - larger.mean_return
    words = (
        f"{cost:+.2f} return with {larger.policy.n_leaves - one.policy.n_leaves} fewer leaves; "
        f"another action on {found.share:.2%} of the observation box."
    )
    boxes = "".join(f"<li>{escape(box.words)}</li>" for box in found.boxes[:CHANGES])
    more = len(found.boxes) - CHANGES
    boxes += f"<li>and {more} smaller boxes</li>" if more > 0 else ""
    return f"<p>{escape(words)}</p><ul>{boxes}</ul>"


def _earned(one: FrontEntry) -> str:
    low, high = one.return_interval
    success = "" if one.success_rate is None else f"{one.success_rate:.1%} success, "
    return f"{success}return {one.mean_return:.2f} [{low:.2f}, {high:.2f}]"
