"""Mermaid flowcharts, which many wikis and code hosts draw by themselves."""

from eutree.export._graph import branches, words_of_leaf, words_of_test
from eutree.export.palette import fill
from eutree.policies import TreePolicy


def to_mermaid(policy: TreePolicy) -> str:
    """Return the tree as a Mermaid flowchart, root at the left, leaves coloured by action."""
    tree = policy.tree
    lines, used = ["flowchart LR"], set()
    for node in tree.preorder():
        if tree.feature[node] != tree.NO_FEATURE:
            lines.append(f'    n{node}["{_escaped(words_of_test(policy, node))}"]')
        else:
            action = int(policy.actions[tree.leaf[node]])
            used.add(action)
            lines.append(
                f'    n{node}(["{_escaped(words_of_leaf(policy, node))}"]):::action{action}'
            )
    for parent, child, answer in branches(policy):
        lines.append(f"    n{parent} -->|{answer}| n{child}")
    for action in sorted(used):
        lines.append(f"    classDef action{action} fill:{fill(action)},stroke:none,color:#111")
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """Return ``text`` with every sign that Mermaid could read as more than itself as a code."""
    return "".join(
        sign if sign.isalnum() or sign in " _.,()-+=" else f"#{ord(sign)};" for sign in text
    )
