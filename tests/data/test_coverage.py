"""Histograms and the map of two features, against cases worked out by hand and naive counts."""

import numpy as np
import pytest

from eutree.data import Demonstrations
from eutree.data.coverage import GRID_BINS, coverage_map, histograms, mutual_information
from eutree.schema import Feature, Schema


def demos_of(observations, actions, schema=None):
    observations = np.asarray(observations, dtype=float)
    return Demonstrations.from_arrays(
        observations,
        actions,
        starts=np.ones(len(actions), bool),
        next_observations=observations,
        schema=schema,
    )


def test_information_in_bits():
    assert mutual_information(np.array([[4, 0], [0, 4]])) == 1.0
    assert mutual_information(np.array([[3, 3], [1, 1]])) == 0.0
    assert mutual_information(np.zeros((2, 2), int)) == 0.0
    # H(X) = H(Y) = 1, H(X, Y) = -(6/8) log2(3/8) - (2/8) log2(1/8)
    expected = 2 + 0.75 * np.log2(3 / 8) + 0.25 * np.log2(1 / 8)
    assert mutual_information(np.array([[3, 1], [1, 3]])) == pytest.approx(expected)


def test_histogram_counts_by_bin_and_action():
    schema = Schema((Feature("x", low=0, high=GRID_BINS),), ("a", "b"))
    (found,) = histograms(demos_of([[0.5], [0.6], [3.0], [20.0]], [0, 1, 1, 1], schema))
    assert found.counts[0].tolist() == [1, 1]
    assert found.counts[3].tolist() == [0, 1]
    assert found.counts[-1].tolist() == [0, 1]  # the upper end belongs to the last bin
    assert found.counts.sum() == 4
    assert (found.low, found.high) == (0, GRID_BINS)


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        ([-1.0, 3.0], (-1.0, 3.0)),  # a fifth of the bounds: the values seen
        ([-6.0, 6.0], (-10.0, 10.0)),  # most of them: the bounds
        ([2.0, 2.0], (-10.0, 10.0)),  # never moved
        ([-0.0, 3.0], (0.0, 3.0)),
    ],
)
def test_bins_lie_where_something_was_seen(values, ends):
    schema = Schema((Feature("x", low=-10, high=10),), ("a", "b"))
    (found,) = histograms(demos_of([[value] for value in values], [0, 1], schema))
    assert (found.low, found.high) == ends
    assert str(found.low) == str(ends[0])  # 0 and not -0
    assert found.counts.sum() == 2


def test_map_takes_the_features_that_tell_most_together():
    """The action is the exclusive or of features 1 and 3; 1 is also a little biased."""
    rng = np.random.default_rng(0)
    observations = rng.integers(0, 2, (400, 4)).astype(float)
    both = (observations[:, 1] == 1) & (observations[:, 3] == 1)
    observations[both & (rng.random(400) < 0.5), 3] = 0.0
    actions = observations[:, 1].astype(int) ^ observations[:, 3].astype(int)
    found = coverage_map(demos_of(observations, actions))
    assert set(found.features) == {1, 3}
    assert found.share == 4 / GRID_BINS**2
    i, j = found.features
    expected = sum((observations[:, i] == 1) & (observations[:, j] == 0) & (actions == 1))
    assert found.counts[-1, 0, 1] == expected


def test_one_feature_has_no_map_and_no_step_has_no_information():
    assert coverage_map(demos_of([[1.0], [2.0]], [0, 1])) is None
    empty = Demonstrations((), Schema.anonymous(2, 2))
    assert coverage_map(empty).share == 0.0
    assert [h.counts.sum() for h in histograms(empty)] == [0, 0]
