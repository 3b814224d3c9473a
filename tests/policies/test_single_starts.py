"""Whether one observation begins an episode may be said in a list of one, as of a batch."""

import numpy as np
import pytest

from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree

PLAIN = Schema.anonymous(1, 3)


def remembering(kind):
    """Return a policy that decides by the value of one step before."""
    schema = PLAIN.derive(["before = last(x0)"]) if kind == "last" else PLAIN.with_history(1)
    tree = DecisionTree.single_leaf(2).split(0, 1, 0.5)
    return TreePolicy(tree, np.array([1, 2]), schema, history=int(kind == "history"))


@pytest.mark.parametrize("kind", ["history", "last"])
@pytest.mark.parametrize("start", [False, [False], np.array([False])])
def test_one_observation_has_one_action(kind, start):
    policy = remembering(kind)
    first, state = policy.predict(np.array([1.0]), None, [True])
    action, state = policy.predict(np.array([0.0]), state, start)
    assert (np.ndim(first), np.ndim(action)) == (0, 0)
    assert (int(first), int(action)) == (2, 2)
    action, _ = policy.predict(np.array([0.0]), state, [True])
    assert (np.ndim(action), int(action)) == (0, 1)


@pytest.mark.parametrize("kind", ["history", "last"])
def test_a_batch_has_an_action_for_each(kind):
    policy = remembering(kind)
    _, state = policy.predict(np.ones((2, 1)), None, [True, True])
    actions, _ = policy.predict(np.zeros((2, 1)), state, [False, True])
    assert actions.tolist() == [2, 1]
