"""SVG drawings of a tree, made here: no Graphviz, no fonts to install, dark and light."""

from xml.sax.saxutils import escape, quoteattr

import numpy as np

from eutree.display import counted
from eutree.export import drawing
from eutree.export._code import ASSUMPTION, template
from eutree.export.drawing import words_of_leaf
from eutree.policies import TreePolicy
from eutree.trees.text import Digits, asked, printable

STYLE = template("svg.css")

_ROW, _BOX, _GAP, _MARGIN, _PADDING, _LONGEST = 30.0, 22.0, 46.0, 12.0, 9.0, 34


def to_svg(policy: TreePolicy, *, standalone: bool = True) -> str:
    """Return a drawing of the tree: leaves coloured by action, branches as wide as their use.

    Thresholds are shown in the digits that tell them apart; pointing at a node shows the exact
    one, which the element also carries as ``data-threshold``.

    Args:
        policy: Policy to draw.
        standalone: Whether the drawing brings its own style; a page that embeds several
            drawings includes ``STYLE`` once instead.
    """
    tree, places = policy.tree, drawing.layout(policy.tree)
    digits, colours = Digits(policy.schema, tree), drawing.fills(policy.schema)
    labels = [_label(policy, node, digits) for node in range(tree.n_nodes)]
    widths = [drawing.text_width(label) + 2 * _PADDING for label in labels]
    lefts = drawing.column_lefts(places, widths, gap=_GAP, margin=_MARGIN)
    shares, notes = np.zeros(tree.n_nodes), 0.0  # of all visits that passed through each node
    if policy.leaves is not None:
        visits = tree.totals(policy.leaves.visits.sum(axis=1))
        shares, notes = visits / max(visits[0], 1.0), 70.0
    width = max(left + wide for left, wide in zip(lefts, widths, strict=True)) + notes + _MARGIN
    height = places.n_rows * _ROW + 2 * _MARGIN
    title = f"Decision tree with {counted(policy.n_leaves, 'leaf')}"
    if policy.environment:
        title += f" for {printable(policy.environment.id)}"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="eutree" role="img" '
        f'viewBox="0 0 {width:.1f} {height:.1f}" width="{width:.0f}" height="{height:.0f}">',
        f"<title>{escape(title)}</title>",
        *([f"<desc>{ASSUMPTION}</desc>"] if policy.masked else []),
    ]
    if standalone:
        lines.append(f"<style>{STYLE}</style>")
    middles = _MARGIN + (places.row + 0.5) * _ROW
    for parent, child, answer in drawing.branches(policy):
        start, end = lefts[parent] + widths[parent], lefts[child]
        place = (end, middles[child], bool(tree.left[parent] == child))
        lines += _branch((start, middles[parent]), place, answer, shares[child])
    for node in tree.preorder():
        box = lefts[node], middles[node], widths[node]
        lines += _node(policy, node, labels[node], box, colours)
        if notes and tree.leaf[node] != tree.NO_LEAF:
            x, share = lefts[node] + widths[node] + 6, 100 * shares[node]
            note = f"{share:.0f} %" if share >= 1 or share == 0 else f"{share:.1g} %"
            lines.append(
                f'<text class="eutree-note" x="{x:.1f}" y="{middles[node] + 4:.1f}">{note}</text>'
            )
    return "\n".join([*lines, "</svg>"]) + "\n"


def _label(policy: TreePolicy, node: int, digits: Digits) -> str:
    tree = policy.tree
    if tree.feature[node] == tree.NO_FEATURE:
        return _shortened(words_of_leaf(policy, node))
    number, feature, threshold = known = asked(policy.schema, tree, node)
    if feature.is_integer:
        return _shortened(known.question(digits).replace("<=", "≤"))
    unit = f" {_shortened(printable(feature.unit))}" if feature.unit else ""
    test = digits.at_most(number, threshold).replace("<=", "≤")
    return f"{_shortened(printable(feature.name))} {test}{unit}"


def _shortened(text: str) -> str:
    """Return ``text``, cut where it would be too long to draw."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _branch(
    start: tuple[float, float], end: tuple[float, float, bool], answer: str, share: float
) -> list[str]:
    """Return one branch as a curve, and its answer above the upper and below the lower one."""
    (x, y), (to_x, to_y, is_upper) = start, end
    bend = (x + to_x) / 2
    curve = f"M{x:.1f} {y:.1f}C{bend:.1f} {y:.1f} {bend:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}"
    beside = to_y - 4 - 3 * share if is_upper else to_y + 11 + 3 * share
    return [
        f'<path class="eutree-edge" d="{curve}" stroke-width="{1.2 + 6 * share:.2f}"/>',
        f'<text class="eutree-answer" text-anchor="end" x="{to_x - 5:.1f}" '
        f'y="{beside:.1f}">{answer}</text>',
    ]


def _node(
    policy: TreePolicy,
    node: int,
    label: str,
    place: tuple[float, float, float],
    colours: tuple[str, ...],
) -> list[str]:
    """Return one node: a box with a label, its exact words, and its data for programs."""
    tree, (x, y, width) = policy.tree, place
    if tree.feature[node] == tree.NO_FEATURE:
        action = int(policy.actions[tree.leaf[node]])
        kind, radius, paint = "leaf", _BOX / 2, f' fill="{colours[action]}"'
        data = f'data-leaf="{tree.leaf[node]}" data-action="{action}"'
        words = f"leaf {tree.leaf[node]}: {words_of_leaf(policy, node)}"
    else:
        kind, radius, paint, words = "test", 5.0, "", drawing.words_of_test(policy, node)
        data = (
            f'data-feature="{tree.feature[node]}" '
            f"data-threshold={quoteattr(repr(float(tree.threshold[node])))} "
            f'data-yes="{tree.left[node]}" data-no="{tree.right[node]}"'
        )
    return [
        f'<g class="eutree-{kind}" data-node="{node}" {data}><title>{escape(words)}</title>'
        f'<rect x="{x:.1f}" y="{y - _BOX / 2:.1f}" width="{width:.1f}" height="{_BOX:.0f}" '
        f'rx="{radius:.0f}"{paint}/>'
        f'<text x="{x + width / 2:.1f}" y="{y + 4:.1f}" text-anchor="middle">'
        f"{escape(label)}</text></g>"
    ]
