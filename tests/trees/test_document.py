"""A loaded tree is a tree: random graphs of nodes against a naive checker."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from eutree.errors import FormatError
from eutree.policies.document import NodeDocument, tree_from_document, tree_to_document
from tests.policies.strategies import trees

small = st.integers(-1, 6)
leaves = st.builds(lambda number: NodeDocument(leaf=number), st.integers(0, 4))
inners = st.builds(NodeDocument, st.integers(0, 2), st.just(0.5), small, small)
anything = st.builds(NodeDocument, small, st.none() | st.just(1.0), small, small, small)


def is_tree(nodes, n_features):
    """Walk from the root, the obvious way."""
    seen, numbers, stack = set(), [], [0]
    while stack:
        at = stack.pop()
        if not 0 <= at < len(nodes) or at in seen:
            return False
        seen.add(at)
        node = nodes[at]
        if node.leaf >= 0:
            if (node.feature, node.threshold, node.left, node.right) != (-1, None, -1, -1):
                return False
            numbers.append(node.leaf)
            continue
        if node.threshold is None or not 0 <= node.feature < n_features:
            return False
        if min(node.left, node.right) <= at:  # children come after their parents
            return False
        stack += [node.left, node.right]
    return len(seen) == len(nodes) and sorted(numbers) == list(range(len(numbers)))


@pytest.mark.promise(3)
@given(st.lists(leaves | inners | anything, max_size=7))
@example([])
@example([NodeDocument(leaf=0)])
@example([NodeDocument(0, 0.5, 1, 2), NodeDocument(leaf=1), NodeDocument(leaf=0)])
@example([NodeDocument(0, 0.5, 1, 1), NodeDocument(leaf=0)])
@example([NodeDocument(0, 0.5, 0, 1), NodeDocument(leaf=0)])
def test_random_graphs_are_refused_exactly_when_they_are_no_trees(nodes):
    if is_tree(nodes, 3):
        assert tree_to_document(tree_from_document(nodes, 3, "f")) == nodes
    else:
        with pytest.raises(FormatError, match=r"^f: nodes"):
            tree_from_document(nodes, 3, "f")


@pytest.mark.promise(3)
@given(trees(), st.data())
def test_trees_with_one_damage_are_refused_exactly_when_they_are_no_trees(tree, data):
    nodes = tree_to_document(tree)
    at = data.draw(st.integers(0, len(nodes) - 1))
    name = data.draw(st.sampled_from(["feature", "left", "right", "leaf"]))
    node = {
        key: getattr(nodes[at], key) for key in ("feature", "threshold", "left", "right", "leaf")
    }
    node[name] = data.draw(st.integers(-1, len(nodes)))
    nodes[at] = NodeDocument(**node)
    if is_tree(nodes, tree.n_features):
        tree_from_document(nodes, tree.n_features, "f")
    else:
        with pytest.raises(FormatError):
            tree_from_document(nodes, tree.n_features, "f")


@pytest.mark.promise(3)
@pytest.mark.parametrize("threshold", [float("nan"), float("inf"), -float("inf")])
def test_thresholds_are_finite(threshold):
    nodes = [NodeDocument(0, threshold, 1, 2), NodeDocument(leaf=0), NodeDocument(leaf=1)]
    with pytest.raises(FormatError, match=r"nodes\[0\]: threshold must be finite"):
        tree_from_document(nodes, 1, "f")


@given(trees(max_splits=40))
def test_round_trip(tree):
    assert tree_from_document(tree_to_document(tree), tree.n_features, "f").equals(tree)
