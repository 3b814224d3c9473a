"""A tree in the terminal, in colours."""

from rich.text import Text

from eutree.policies import TreePolicy
from eutree.trees.text import Digits, is_reversed, printable, question
from eutree.wording import counted

# Names of terminal colours, so that each terminal's own theme keeps them readable.
_COLOURS = ("yellow", "cyan", "green", "magenta", "blue", "red")


def drawn(policy: TreePolicy) -> Text:
    """Return the tree as branches of a terminal: tests in words, leaves coloured by action."""
    tree = policy.tree
    name = str(policy.environment or "")
    made_for = f" for {name if name.isprintable() else printable(name)}" if name else ""
    leaves = counted(policy.n_leaves, "leaf")
    lines = [Text(f"{leaves}, depth {tree.depth}{made_for}", style="bold")]
    guides, digits = {0: ""}, Digits(policy.schema, tree)
    for node in tree.preorder():
        line, parent = Text(), int(tree.parent[node])
        if parent != tree.NO_NODE:
            is_left = tree.left[parent] == node
            asked = policy.schema.features[tree.feature[parent]]
            is_yes = is_left != is_reversed(asked, float(tree.threshold[parent]))
            branch = ("├─ " if is_left else "└─ ") + ("yes  " if is_yes else "no   ")
            line.append(guides[parent] + branch, style="dim")
            guides[node] = guides[parent] + ("│  " if is_left else "   ")
        lines.append(line + _words(policy, node, digits))
    return Text("\n").join(lines)


def _words(policy: TreePolicy, node: int, digits: Digits) -> Text:
    """Return the test of an inner node, or the action of a leaf with its share of the visits."""
    tree = policy.tree
    if tree.leaf[node] == tree.NO_LEAF:
        feature, cut = int(tree.feature[node]), float(tree.threshold[node])
        words = question(policy.schema, feature, cut, digits)
        return Text(f"{words} ?")
    leaf = int(tree.leaf[node])
    action = int(policy.actions[leaf])
    text = Text(
        printable(policy.schema.actions[action]),
        style=f"bold {_COLOURS[action % len(_COLOURS)]}",
    )
    if policy.leaves is not None and policy.leaves.visits.any():
        visits = policy.leaves.visits.sum(axis=1)
        text.append(f"  {100 * visits[leaf] / visits.sum():.1f} % of visits", style="not bold dim")
    return text
