"""What every drawing of a tree says: words on its nodes, answers on its branches."""

from collections.abc import Iterator

from eutree.policies import TreePolicy
from eutree.trees.text import is_reversed, printable, question


def words_of_test(policy: TreePolicy, node: int) -> str:
    """Return the test of an inner node with its exact threshold."""
    tree = policy.tree
    return question(policy.schema, int(tree.feature[node]), float(tree.threshold[node]))


def words_of_leaf(policy: TreePolicy, node: int) -> str:
    """Return the name of the action of a leaf's node."""
    return printable(policy.schema.actions[policy.actions[policy.tree.leaf[node]]])


def branches(policy: TreePolicy) -> Iterator[tuple[int, int, str]]:
    """Yield parent, child and "yes" or "no" for each branch, in preorder."""
    tree = policy.tree
    for node in tree.preorder():
        if tree.feature[node] != tree.NO_FEATURE:
            yield node, int(tree.left[node]), answer_of(policy, node, is_left=True)
            yield node, int(tree.right[node]), answer_of(policy, node, is_left=False)


def answer_of(policy: TreePolicy, node: int, *, is_left: bool) -> str:
    """Return which answer to the test of an inner node leads to one of its branches."""
    feature = policy.schema.features[policy.tree.feature[node]]
    reverse = is_reversed(feature, float(policy.tree.threshold[node]))
    return "yes" if is_left != reverse else "no"
