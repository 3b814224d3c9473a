"""Growing and pruning on small cases whose trees are known."""

import numpy as np
import pytest

from eutree.c45 import C45Settings, grow
from eutree.errors import InvalidArgumentError


def test_one_cut_at_the_greatest_value_below_the_midpoint() -> None:
    observations = np.array([[1.0], [2.0], [3.0], [7.0], [8.0], [9.0]])
    tree = grow(observations, [0, 0, 0, 1, 1, 1], n_classes=2)
    assert tree.feature.tolist() == [0, -1, -1]
    assert tree.threshold[0] == 3.0
    assert tree.distribution.tolist() == [[3, 3], [3, 0], [0, 3]]


def test_converts_to_a_decision_tree_that_decides_the_same() -> None:
    rng = np.random.default_rng(0)
    observations = rng.normal(size=(500, 3))
    actions = (observations[:, 0] * observations[:, 1] > 0).astype(int) + 2 * (
        observations[:, 2] > 1
    )
    tree = grow(observations, actions, n_classes=4, settings=C45Settings.lossless())
    decision, leaf_action = tree.to_decision_tree()
    assert decision.n_leaves == tree.n_leaves
    assert decision.depth == tree.depth
    assert np.array_equal(leaf_action[decision.leaf_index(observations)], actions)


@pytest.mark.parametrize("seed", range(6))
def test_tests_of_nominal_values_become_tests_of_their_codes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    observations = np.column_stack(
        [rng.integers(0, 7, 600), rng.integers(0, 3, 600), rng.normal(size=600)]
    ).astype(float)
    wanted = np.isin(observations[:, 0], [1, 2, 5]) ^ (observations[:, 2] > 0.3)
    actions = wanted.astype(int) + (observations[:, 1] == 1)
    settings = C45Settings(prune=bool(seed % 2))
    tree = grow(observations, actions, n_classes=3, n_values=[7, 3, 0], settings=settings)
    assert (tree.n_values[tree.feature[tree.feature >= 0]] > 0).any()
    decision, leaf_action = tree.to_decision_tree()
    codes = np.stack(np.meshgrid(np.arange(7), np.arange(3), rng.normal(size=40)), -1)
    rows = codes.reshape(-1, 3).astype(float)
    same = leaf_action[decision.leaf_index(rows)] == tree.predict(rows)
    assert same.all(), rows[~same][:3]
    assert leaf_action.size == decision.n_leaves


def test_a_single_class_gives_a_single_leaf() -> None:
    tree = grow(np.arange(6.0).reshape(3, 2), [1, 1, 1], n_classes=3)
    decision, actions = tree.to_decision_tree()
    assert decision.n_leaves == 1
    assert actions.tolist() == [1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"observations": [[np.inf]]}, "infinity at"),
        ({"observations": [1.0]}, "shape"),
        ({"observations": np.empty((0, 2)), "actions": []}, "at least one row"),
        ({"actions": [2]}, "actions must be in 0..1, got 2"),
        ({"actions": [0, 1]}, "actions must have 1 entries, got 2"),
        ({"weights": [-1.0]}, "weights must not be negative"),
        ({"weights": [0.0]}, "at least one row with weight"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    good = {"observations": [[1.0]], "actions": [0]}
    with pytest.raises(InvalidArgumentError, match=message):
        grow(**(good | arguments), n_classes=2)
