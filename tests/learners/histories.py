"""What must be true of a history."""

from tests import naive_learning


def assert_consistent(tree, history):
    left, entered = naive_learning.labels_of(tree, history)
    assert history.left.tolist() == left
    assert history.entered.tolist() == entered
    for leaf in range(tree.n_leaves):
        assert history.leaving.of(leaf).tolist() == naive_learning.rows_of(left, leaf)
        assert history.entering.of(leaf).tolist() == naive_learning.rows_of(entered, leaf)
        assert history.leaving.counts[leaf] == left.count(leaf)
