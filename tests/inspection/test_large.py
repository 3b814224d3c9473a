"""What took minutes on trees of tens of thousands of leaves grows as they do, beside fewer."""

import time
from dataclasses import replace

import numpy as np
import pytest

from eutree.export import to_svg
from eutree.inspection import diff, verify
from eutree.trees.boxes import leaf_boxes, meetings
from tests.inspection.large import large_policy

FEW, MANY = 1_000, 6_000


@pytest.fixture(scope="module")
def policies():
    return large_policy(FEW), large_policy(MANY)


def flipped(policy):
    actions = policy.actions.copy()
    actions[::10] = 1 - actions[::10]
    return replace(policy, actions=actions)


ASKED = {
    "diff": lambda policy: diff(policy, flipped(policy)),
    "verify": lambda policy: verify(policy, "always stop when x0 > 0.5"),
    "monotone": lambda policy: verify(policy, "monotone go in x0"),
    "dead leaves": lambda policy: verify(policy, "no dead leaves", observations=np.zeros((1, 3))),
    "svg": to_svg,
}


@pytest.mark.parametrize("name", ASKED)
def test_work_does_not_grow_with_the_square_of_the_leaves(policies, name):
    """Six times the leaves took 36 times as long; in proportion it is 6 times."""

    def seconds(policy):
        before = time.thread_time()
        assert ASKED[name](policy)
        return time.thread_time() - before

    few, many = policies
    assert seconds(many) < 16.0 * min(seconds(few) for _ in range(3))


@pytest.mark.parametrize("seed", range(20))
def test_meetings_are_those_of_all_pairs(seed):
    rng = np.random.default_rng(seed)
    tree = large_policy(int(rng.integers(1, 60)), seed=seed).tree
    corners = rng.choice([0.0, 0.25, 0.5, 1.0, *tree.threshold[tree.feature >= 0]], (2, 40, 3))
    low, high = corners.min(axis=0), corners.max(axis=0)
    high[:5], low[:5] = np.inf, -np.inf
    leaf_low, leaf_high = leaf_boxes(tree)
    both = np.maximum(low[:, None], leaf_low) < np.minimum(high[:, None], leaf_high)
    expected = np.argwhere(both.all(axis=-1))
    found = [np.stack(pair, axis=1) for pair in meetings(low, high, tree)]
    assert np.array_equal(np.concatenate(found), expected)
