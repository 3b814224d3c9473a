"""When the learner is unsure, and what it makes of what it is shown."""

import numpy as np
import pytest

from eutree.c45 import C45Settings, grow
from eutree.learners import PAPER, Step, UTree
from eutree.learners.confidence import FEW, UNDECIDED, Confidence, doubt
from eutree.learners.teaching import refined
from eutree.trees import DecisionTree

SURE = Confidence(min_tried=4, width=2.0)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ([5.0, 5.1, 4.9, 5.0], [1.0, 1.1, 0.9, 1.0], ""),  # far apart
        ([5.0, 5.1, 4.9, 5.0], [1.0, 1.1, 0.9], FEW),  # the second was tried three times
        ([5.0, 1.0, 9.0, 5.0], [4.0, 1.0, 8.0, 3.0], UNDECIDED),  # wide and near
        ([1.0, 1.1, 0.9, 1.0], [5.0, 5.1, 4.9, 5.0], UNDECIDED),  # the leaf's own choice is worse
    ],
)
def test_doubt_by_hand(first, second, expected):
    returns = np.array([*first, *second])
    actions = np.array([0] * len(first) + [1] * len(second))
    assert doubt(returns, actions, 0, 2, SURE) == expected


def test_interval_is_two_standard_errors():
    """Means 1 and 0, deviations 1 and 0: the intervals touch where width / sqrt(n) is 1."""
    best = np.array([0.0, 2.0] * 8)  # standard deviation sqrt(16 / 15), error sqrt(1 / 15)
    returns, actions = np.append(best, np.zeros(16)), np.repeat([0, 1], 16)
    just = float(np.sqrt(15.0))
    assert doubt(returns, actions, 0, 2, Confidence(width=just * 0.999)) == ""
    assert doubt(returns, actions, 0, 2, Confidence(width=just * 1.001)) == UNDECIDED


def test_one_leaf_becomes_the_expert_tree():
    rng = np.random.default_rng(0)
    observations = rng.random((200, 2))
    shown = ((observations[:, 0] > 0.4) & (observations[:, 1] > 0.3)).astype(np.int64)
    whole = DecisionTree.single_leaf(2)
    tree, actions = refined(whole, np.array([0]), observations, shown, 2, leaves=np.array([0]))
    expert, wanted = grow(
        observations, shown, n_classes=2, settings=C45Settings()
    ).to_decision_tree()
    points = rng.random((500, 2))
    assert np.array_equal(actions[tree.leaf_index(points)], wanted[expert.leaf_index(points)])
    assert tree.n_leaves == expert.n_leaves


def test_other_leaves_stay():
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.5)
    observations = np.array([[0.1], [0.2], [0.3], [0.4]] * 5)
    shown = np.array([0, 0, 1, 1] * 5)
    found, actions = refined(tree, np.array([1, 0]), observations, shown, 2, leaves=np.array([0]))
    points = np.array([[0.15], [0.35], [0.9]])
    assert actions[found.leaf_index(points)].tolist() == [0, 1, 0]
    assert found.leaf_of([0.9]) == 1  # and its number


def test_what_was_shown_is_marked_and_survives_the_state():
    learner = UTree(DecisionTree.single_leaf(1), 2, PAPER)
    learner.start_episode(np.array([0.0]), np.random.default_rng(0))
    for step, shown in enumerate((False, True, True)):
        learner.observe(Step(1, 0.0, np.array([step + 1.0]), step == 2, False, {}, shown))
    learner.end_episode()
    assert learner.history.demonstrated.tolist() == [False, True, True]
    again = UTree.from_state(learner.state(), 2, PAPER)
    assert again.history.demonstrated.tolist() == [False, True, True]


def test_a_locked_leaf_is_sure():
    tree = DecisionTree.single_leaf(1)
    assert UTree(tree, 2, PAPER).doubt(np.array([0.0]), SURE) == FEW
    locked = UTree(tree, 2, PAPER, prior=np.array([1]), locked=[0])
    assert locked.doubt(np.array([0.0]), SURE) == ""
