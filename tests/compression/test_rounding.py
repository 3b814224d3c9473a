"""Short thresholds: the fewest digits that send every recorded observation the same way."""

import itertools
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.compression import compress
from eutree.compression.rounding import rounded, shortest
from eutree.trees.boxes import leaf_boxes
from tests.compression.test_compress import actions_on, random_policy


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
