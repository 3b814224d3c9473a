"""DOT, the language of Graphviz."""

from eutree.export._graph import branches, words_of_leaf, words_of_test
from eutree.export.palette import fills
from eutree.policies import TreePolicy


def to_dot(policy: TreePolicy) -> str:
    """Return the tree as a Graphviz digraph, root at the left, leaves coloured by action."""
    tree, colours = policy.tree, fills(policy.schema)
    lines = [
        "digraph policy {",
        '    graph [rankdir="LR", ordering="out", nodesep="0.15"];',
        '    node [fontname="Helvetica", fontsize="11", shape="box", '
        'style="rounded,filled", fillcolor="#ffffff", color="#8a94a0"];',
        '    edge [fontname="Helvetica", fontsize="9", color="#8a94a0", arrowhead="none"];',
    ]
    for node in tree.preorder():
        if tree.feature[node] != tree.NO_FEATURE:
            lines.append(f"    n{node} [label={_string(words_of_test(policy, node))}];")
            continue
        colour = colours[int(policy.actions[tree.leaf[node]])]
        label = _string(words_of_leaf(policy, node))
        lines.append(f'    n{node} [label={label}, fillcolor="{colour}", color="{colour}"];')
    lines += [
        f'    n{parent} -> n{child} [label="{answer}"];'
        for parent, child, answer in branches(policy)
    ]
    return "\n".join([*lines, "}"]) + "\n"


def _string(text: str) -> str:
    r"""Return a DOT string; a backslash would begin an escape and ``&`` an entity."""
    escaped = text.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
