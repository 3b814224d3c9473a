"""What took minutes on trees of tens of thousands of leaves takes seconds: time of this process."""

import time
from dataclasses import replace

import numpy as np
import pytest

from eutree.export import to_svg
from eutree.inspection import diff, verify
from eutree.trees.boxes import leaf_boxes, meetings
from tests.inspection.large import large_policy

N_LEAVES, MOST_SECONDS = 20_000, 10.0


@pytest.fixture(scope="module")
def policy():
    return large_policy(N_LEAVES)


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
def test_work_does_not_grow_with_the_square_of_the_leaves(policy, name):
    before = time.process_time()
    assert ASKED[name](policy)
    assert time.process_time() - before < MOST_SECONDS


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
