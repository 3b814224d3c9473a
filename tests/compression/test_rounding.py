"""Short thresholds: the fewest digits that send every recorded observation the same way."""

import itertools
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.compression import compress
from eutree.compression.smaller_trees import multiple, rounded, shortest
from eutree.trees.boxes import leaf_boxes
from tests.compression.policies import actions_on, random_policy


def digits(number):
    return len(Decimal(repr(number)).normalize().as_tuple().digits)


def naive_shortest(value, least, below):
    """Try all numbers of one digit, then of two, ... of every magnitude near."""
    for count in (1, 2, 3):
        fitting = [
            float(f"{sign}{mantissa}e{exponent}")
            for mantissa, exponent in itertools.product(range(10**count), range(-6, 4))
            for sign in ("", "-")
        ]
        fitting = [number for number in fitting if least <= number < below]
        if fitting:
            return min(abs(number - value) for number in fitting)
    return None


@settings(max_examples=60, deadline=None)
@given(
    value=st.floats(-500, 500).filter(lambda x: abs(x) > 0.01),
    down=st.floats(0, 100),
    up=st.floats(0.001, 100),
)
def test_no_shorter_and_no_nearer_number_fits(value, down, up):
    least, below = value - down, value + up
    found = shortest(value, least, below)
    assert least <= found < below
    nearest = naive_shortest(value, least, below)
    if nearest is not None:
        assert digits(found) <= 3
        assert abs(found - value) == pytest.approx(nearest, abs=1e-9)


@pytest.mark.parametrize(
    ("value", "least", "below", "expected"),
    [
        (3.1415926, 3.1, 3.2, 3.1),
        (97.3, 90.5, 103.0, 100.0),
        (-0.0123, -0.0125, -0.0122, -0.0123),
        (0.0, -1.0, 1.0, 0.0),
        (0.3, -np.inf, np.inf, 0.3),
        (1.7976931348623157e308, 1.797693134862315e308, np.inf, 1.797693134862315e308),
        (5e-324, 5e-324, 1e-323, 5e-324),
    ],
)
def test_known_numbers(value, least, below, expected):
    assert shortest(value, least, below) == expected


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32), n_leaves=st.integers(1, 40), n_rows=st.integers(0, 200))
def test_every_observation_keeps_its_leaf_and_every_leaf_its_box(seed, n_leaves, n_rows):
    policy = random_policy(seed, n_leaves)
    rows = np.random.default_rng(seed + 1).random((n_rows, 3)) * 12
    short = rounded(policy, rows)
    assert short.tree.leaf_index(rows).tolist() == policy.tree.leaf_index(rows).tolist()
    boxes = [leaf_boxes(tree) for tree in (policy.tree, short.tree)]
    before, after = ((low >= high).any(axis=1).tolist() for low, high in boxes)
    assert after == before


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_compression_rounds_without_changing_a_recorded_decision(seed):
    policy = random_policy(seed, 30)
    rows = np.random.default_rng(seed).random((200, 3)) * 12
    plain, _ = compress(policy, rows)
    short, report = compress(policy, rows, round_thresholds=True)
    assert report.agreement == 1.0
    assert actions_on(short, rows).tolist() == actions_on(policy, rows).tolist()
    assert short.n_leaves == plain.n_leaves
    thresholds = [p.tree.threshold[p.tree.feature >= 0].tolist() for p in (plain, short)]
    before, after = (sum(map(digits, cuts)) for cuts in thresholds)
    assert after <= before


@pytest.mark.parametrize(
    ("value", "least", "below", "step", "expected"),
    [
        (20.12699, 20.05, 20.2, 0.1, 20.1),
        (20.12699, 20.12, 20.2, 0.1, np.nextafter(20.2, -np.inf)),  # less than 20.2
        (23.98, 23.9500001, 24.0, 0.1, np.nextafter(24.0, -np.inf)),  # less than 24
        (20.12699, 20.12, 20.13, 0.1, 20.1),  # no multiple decides alike: the nearest
        (0.3, 0.29, 0.31, 0.1, 0.3),
        (-7.0, -9.0, -6.0, 5.0, -5.0),
    ],
)
def test_multiples_of_a_step(value, least, below, step, expected):
    assert multiple(value, least, below, step) == expected


def uneven(seed, n_leaves):
    policy = random_policy(seed, n_leaves)
    return replace(policy, tree=replace(policy.tree, threshold=policy.tree.threshold * 0.731))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.sampled_from([0.1, 0.5, 1.0, 3.0]))
def test_steps_leave_multiples_and_no_dead_leaf(seed, n_leaves, step):
    policy = uneven(seed, n_leaves)
    rows = np.random.default_rng(seed).random((60, 3)) * 9
    small, report = compress(policy, rows, mode="merge", round_thresholds=step)
    tree = small.tree
    for cut in tree.threshold[tree.feature != tree.NO_FEATURE].tolist():
        near = [cut, float(np.nextafter(cut, np.inf))]  # at most a multiple, or less than one
        assert any(Decimal(repr(c)) % Decimal(repr(step)) == 0 for c in near)
    low, high = leaf_boxes(tree)
    assert (low < high).all()
    assert report.agreement == (actions_on(small, rows) == actions_on(policy, rows)).mean()
    named, _ = compress(policy, rows, mode="merge", round_thresholds={"x1": step})
    assert named.n_leaves <= policy.n_leaves


def test_locked_leaves_keep_their_bounds_when_steps_round():
    policy = uneven(3, 12)
    leaf = int(np.flatnonzero(np.all(np.less(*leaf_boxes(policy.tree)), axis=1))[2])
    rows = np.random.default_rng(4).random((50, 3)) * 9
    locked = replace(policy, locked=(leaf,))
    small, _ = compress(locked, rows, mode="merge", round_thresholds=1.0)
    (kept,) = small.locked
    for mine, theirs in zip(leaf_boxes(policy.tree), leaf_boxes(small.tree), strict=True):
        assert mine[leaf].tolist() == theirs[kept].tolist()
    assert small.actions[kept] == policy.actions[leaf]
