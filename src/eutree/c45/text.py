"""C4.5 trees as text and as a drawing, with names for attributes, values and classes.

The writers of ``eutree.export`` take binary trees; these also take tests with many branches.
"""

from dataclasses import dataclass
from xml.sax.saxutils import escape

from eutree.c45.tree import C45Tree
from eutree.display import counted
from eutree.trees.text import printable


@dataclass(frozen=True)
class C45Names:
    """What the numbers of a tree are called.

    Attributes:
        features: Names of the attributes.
        classes: Names of the classes.
        values: Names of the values of each nominal attribute; empty for a continuous one.
    """

    features: tuple[str, ...]
    classes: tuple[str, ...]
    values: tuple[tuple[str, ...], ...]


def condition(tree: C45Tree, names: C45Names, node: int, branch: int) -> str:
    """Return the condition under which ``node`` hands a case to a branch."""
    name = printable(names.features[tree.feature[node]])
    if tree.value_start[node] < 0:
        return f"{name} {'>' if branch else '<='} {_number(tree.threshold[node])}"
    every = names.values[tree.feature[node]]
    values = [printable(every[v]) for v in tree.values_of_branch(node, branch)]
    return f"{name} = {values[0]}" if len(values) == 1 else f"{name} in {{{', '.join(values)}}}"


def verdict(tree: C45Tree, names: C45Names, node: int) -> str:
    """Return the class of a leaf with its training cases and errors: ``play (4)``, ``(4/1)``."""
    total = float(tree.distribution[node].sum())
    wrong = total - float(tree.distribution[node].max())
    errors = f"/{_number(round(wrong, 2))}" if round(wrong, 2) else ""
    return f"{printable(names.classes[tree.label[node]])} ({_number(round(total, 2))}{errors})"


def to_text(tree: C45Tree, names: C45Names) -> str:
    """Return one line for each branch, indented by its depth, as C4.5 prints its trees."""
    if tree.n_nodes == 1:
        return verdict(tree, names, 0)
    lines = []
    for node, depth in tree.preorder():
        if node:
            parent = int(tree.parent[node])
            text = condition(tree, names, parent, node - int(tree.first_child[parent]))
            leaf = f" {verdict(tree, names, node)}" if not tree.n_children[node] else ""
            lines.append(f"{'|   ' * (depth - 1)}{text}:{leaf}")
    return "\n".join(lines)


def _number(value: float) -> str:
    """Return the shortest decimal that reads back as the same double."""
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))


_ROW, _BOX, _SIGN, _GAP, _MARGIN = 28.0, 20.0, 7.2, 40.0, 10.0
_STYLE = """\
.eutree-c45 text { font: 12px system-ui, sans-serif; fill: #1d2733; }
.eutree-c45 rect { fill: #ffffff; stroke: #9aa5b1; }
.eutree-c45 path { fill: none; stroke: #9aa5b1; }
@media (prefers-color-scheme: dark) {
  .eutree-c45 text { fill: #e6ebf0; }
  .eutree-c45 rect { fill: #1b232c; stroke: #5d6a78; }
}
"""


def to_svg(tree: C45Tree, names: C45Names) -> str:
    """Return a drawing: on each node the condition that leads to it, on leaves the class too."""
    labels = [_label(tree, names, node) for node in range(tree.n_nodes)]
    column, row, n_rows = _places(tree)
    widths = [_SIGN * len(label) + 14 for label in labels]
    starts = [_MARGIN]
    for depth in range(tree.depth + 1):
        inside = (width for width, at in zip(widths, column, strict=True) if at == depth)
        starts.append(starts[-1] + max(inside) + _GAP)
    width, height = starts[-1] - _GAP + _MARGIN, n_rows * _ROW + 2 * _MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="eutree-c45" role="img" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}">',
        f"<title>C4.5 tree with {counted(tree.n_leaves, 'leaf')}</title>",
        f"<style>{_STYLE}</style>",
    ]
    for node in range(tree.n_nodes):
        x, y = starts[column[node]], _MARGIN + (row[node] + 0.5) * _ROW
        for child in tree.children(node):
            begin, end = x + widths[node], starts[column[child]]
            below, middle = _MARGIN + (row[child] + 0.5) * _ROW, (begin + end) / 2
            lines.append(
                f'<path d="M{begin:.1f} {y:.1f}C{middle:.1f} {y:.1f} {middle:.1f} {below:.1f} '
                f'{end:.1f} {below:.1f}"/>'
            )
        lines.append(
            f'<rect x="{x:.1f}" y="{y - _BOX / 2:.1f}" width="{widths[node]:.1f}" '
            f'height="{_BOX}" rx="4"/><text x="{x + 7:.1f}" y="{y + 4:.1f}">'
            f"{escape(labels[node])}</text>"
        )
    return "\n".join([*lines, "</svg>"]) + "\n"


def _label(tree: C45Tree, names: C45Names, node: int) -> str:
    leaf = verdict(tree, names, node) if not tree.n_children[node] else ""
    if node == 0:
        return leaf or "all cases"
    parent = int(tree.parent[node])
    text = condition(tree, names, parent, node - int(tree.first_child[parent]))
    return f"{text}: {leaf}" if leaf else text


def _places(tree: C45Tree) -> tuple[list[int], list[float], int]:
    """Return column and row of each node, and the number of rows; no two branches cross."""
    column, row, n_rows = [0] * tree.n_nodes, [0.0] * tree.n_nodes, 0
    for node, depth in tree.preorder():
        column[node] = depth
        if not tree.n_children[node]:
            row[node], n_rows = float(n_rows), n_rows + 1
    for node in reversed(range(tree.n_nodes)):  # children come after their parents
        if children := tree.children(node):
            row[node] = (row[children[0]] + row[children[-1]]) / 2
    return column, row, n_rows
