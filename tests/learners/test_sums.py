"""Weighted sums are found where a teacher decides by them, and are what their formulas say."""

import numpy as np
import pytest

from eutree.features import Derivation
from eutree.learners.distilled_dqn.sums import Labels, Sums, found_sums
from eutree.schema import Schema

N, SCHEMA = 4000, Schema.anonymous(4, 2)


def labels_of(decide, seed=0, n=N):
    """Return the labels of a teacher that gains by how far a number is above 0; a flag is last."""
    generator = np.random.default_rng(seed)
    observations = generator.normal(size=(n, 4)) * [1.0, 20.0, 0.05, 1.0]
    observations[:, 3] = observations[:, 3] > 0.0
    gain = decide(*observations.T)
    values = np.column_stack([np.zeros(n), gain])
    return Labels(observations, values.argmax(axis=1), values)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_sum_that_a_teacher_decides_by_is_found(seed):
    labels = labels_of(lambda a, b, c, flag: a - 0.05 * b + 12.0 * c - 0.3, seed)
    sums = found_sums(labels, 3)
    assert sums.weights[0] == pytest.approx([1.0, -0.05, 12.0, 0.0], rel=0.2)
    assert (sums.weights[:, 3] == 0.0).all()  # a flag is no quantity
    assert labels.losses(sums.behind(labels.columns)[:, 4]).mean() < 0.3 * labels.losses().mean()
    assert len(found_sums(labels, 1)) == 1


@pytest.mark.parametrize(
    "decide",
    [lambda a, b, c, flag: a - 0.3, lambda a, b, c, flag: np.where(b > 5.0, a - 0.3, c + 0.01)],
)
def test_no_sum_is_found_where_single_features_say_all(decide):
    assert len(found_sums(labels_of(decide), 3)) == 0


@pytest.mark.parametrize("seed", [3, 4])
def test_no_sum_is_found_in_chance_or_in_few_labels(seed):
    noise = np.random.default_rng(seed).normal(size=10 * N)
    assert len(found_sums(labels_of(lambda a, b, c, flag: noise, n=10 * N), 3)) == 0
    whole = labels_of(lambda a, b, c, flag: a - 0.05 * b)
    assert len(found_sums(whole.at(np.arange(900)), 3)) == 0


def test_what_no_action_changes_asks_for_no_sum():
    labels = labels_of(lambda a, b, c, flag: np.zeros(N))
    assert len(found_sums(labels, 3)) == 0


def test_sums_are_their_formulas_to_the_bit():
    """A policy computes what its schema says; the learner's trees must be asked the same."""
    generator = np.random.default_rng(5)
    weights = generator.normal(size=(6, 4)) * 10.0 ** generator.integers(-6, 6, size=(6, 4))
    weights[0], weights[1], weights[2, 1:3] = [0.0, 1.0, 0.0, -1.0], [-1.0, 0, 0, 2e-7], 0.0
    rows = generator.normal(size=(500, 4)) * 10.0 ** generator.integers(-9, 9, size=(500, 4))
    sums = Sums(weights)
    derivation = Derivation.of(SCHEMA.derive(sums.declarations(SCHEMA)))
    assert sums.behind(rows).tobytes() == derivation.rows(rows).tobytes()
    assert sums.behind(rows[7]).tobytes() == derivation.rows(rows[7]).tobytes()
    assert derivation.behind(rows).tobytes() == derivation.rows(rows).tobytes()


def test_a_declaration_can_be_read_and_its_name_is_free():
    schema = Schema.anonymous(3, 2).derive(["sum 1 = x0 / x1"])
    names = schema.feature_names
    declared = Sums(np.array([[1.0, 0.0, -0.25, 3.0], [0.0, 1.0, 1.0, 0.0]])).declarations(schema)
    assert [one.partition(" = ")[0] for one in declared] == ["sum 2", "sum 3"]
    assert declared[0].endswith(f'{names[0]} - 0.25 * {names[2]} + 3.0 * "sum 1"')
    assert declared[1].endswith(f"{names[1]} + {names[2]}")
    assert schema.derive(declared).n_features == 6


def test_derived_features_that_are_there_are_not_derived_again():
    schema = SCHEMA.derive(["a = x0 + x1", "b = a - x2"])
    derivation = Derivation.of(schema)
    rows = np.random.default_rng(0).normal(size=(9, 4))
    whole = derivation.rows(rows)
    for width in (4, 5, 6):
        assert (derivation.behind(whole[:, :width]) == whole).all()
    wider = np.ones((2, 9))  # with the past behind them
    assert derivation.behind(wider) is wider
    narrower = np.ones((2, 3))  # of another task, whose reader says so
    assert derivation.behind(narrower) is narrower
