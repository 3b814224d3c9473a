"""C4.5 trees as text, with names for attributes, values and classes.

The writers of ``eutree.export`` take binary trees; this also takes tests with many branches.
"""

from dataclasses import dataclass

from eutree.c45.tree import C45Tree
from eutree.trees.text import printable


@dataclass(frozen=True)
class C45Names:
    """Names of the numbers of a tree.

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
    if tree.n_values[tree.feature[node]]:
        return f"{name} = {printable(names.values[tree.feature[node]][branch])}"
    return f"{name} {'>' if branch else '<='} {_number(tree.threshold[node])}"


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
