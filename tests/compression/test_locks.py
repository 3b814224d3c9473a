"""Locked leaves outlive compression: their boxes, their actions and the locks themselves."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.compression import RealEpisodes, compress
from eutree.trees.boxes import leaf_boxes
from tests.compression.policies import actions_on, random_policy

WAYS = {
    "auto": {},
    "merge": {"mode": "merge"},
    "lossless": {"mode": "lossless"},
    "paper": {"mode": "paper"},
    "half the decisions": {"max_disagreement": 0.5},
    "all decisions": {"max_disagreement": 1.0},
    "rounded": {"round_thresholds": True},
}


def with_random_locks(policy, seed, share):
    locked = np.flatnonzero(np.random.default_rng(seed).random(policy.n_leaves) < share)
    return replace(policy, locked=tuple(locked.tolist()))


def locked_rules(policy):
    """Return box and action of each locked leaf that something reaches."""
    low, high = leaf_boxes(policy.tree)
    return sorted(
        (low[leaf].tolist(), high[leaf].tolist(), int(policy.actions[leaf]))
        for leaf in policy.locked
        if (low[leaf] < high[leaf]).all()
    )


@pytest.mark.parametrize("way", WAYS)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32), n_leaves=st.integers(1, 40), share=st.sampled_from([0.1, 0.6]))
def test_what_is_locked_stays_in_every_mode(way, seed, n_leaves, share):
    policy = with_random_locks(random_policy(seed, n_leaves, n_actions=3), seed, share)
    rows = np.random.default_rng(seed + 1).random((100, 3)) * 12
    small, report = compress(policy, rows, **WAYS[way])
    assert locked_rules(small) == locked_rules(policy)
    assert small.n_leaves == report.n_leaves_after <= policy.n_leaves
    if "decisions" not in way and way != "paper":
        assert actions_on(small, rows).tolist() == actions_on(policy, rows).tolist()


def test_the_rest_of_the_tree_still_shrinks():
    policy = random_policy(0, 60)
    rows = np.random.default_rng(1).random((200, 3)) * 12
    free = compress(policy, rows)[0].n_leaves
    held = compress(replace(policy, locked=(0,)), rows)[0].n_leaves
    assert free <= held < 60


@pytest.mark.parametrize("margin", [0.0, 1000.0])
def test_what_is_locked_stays_within_a_margin_of_the_return(margin):
    policy = with_random_locks(random_policy(2, 20), 2, 0.2)
    rows = np.random.default_rng(1).random((100, 3)) * 12
    small, _ = compress(
        policy,
        rows,
        env=RealEpisodes("eutree/Evasion2-v0", margin=margin, episodes=40),
        round_thresholds=True,
    )
    assert locked_rules(small) == locked_rules(policy)
    assert small.n_leaves <= compress(policy, rows, mode="merge")[0].n_leaves
