"""Derived features in imagined episodes are computed of the next state, as in those of a task."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.compiled import compiled
from eutree.features import Derivation
from eutree.learners.learner import Problem, Start
from eutree.learners.planning import PlanningMethod
from eutree.schema import Schema
from eutree.world_model import fit_world_models
from eutree.world_model._kernels_formulas import derive, formulas_of
from eutree.world_model.action_trees import packed
from eutree.world_model.rollouts import PairedRollouts
from eutree.world_model.transitions import seen_as
from tests import random_formulas
from tests.world_model.wheel import WHEEL, spins

MADE_OF_TWO = random_formulas.formulas_of("x0", "x1", "2", "0.5", "last(x1)")


@compiled
def derived_in(formulas, state):
    derive(formulas, state)


@given(
    st.lists(
        random_formulas.formulas_of("x0", "x1", "2", "0.5", "last(x1)"), min_size=1, max_size=3
    ),
    st.lists(st.sampled_from([-2.0, -0.5, 0.0, 0.3, 1.0, 7.0]), min_size=4, max_size=4),
)
def test_a_formula_is_computed_to_the_bit(formulas, numbers):
    """Also those that are made of others."""
    declared = [f"f{k} = {text}" for k, text in enumerate(formulas)]
    declared.append("last one = f0 - last(f0)")
    derivation = Derivation.of(Schema.anonymous(2, 2).derive(declared))
    before = derivation.rows(np.array(numbers[2:]))
    state = np.array([*numbers[:2], *np.zeros(len(declared)), *before])
    derived_in(formulas_of(derivation), state)
    expected = derivation.rows(np.array(numbers[:2]), before)
    np.testing.assert_array_equal(state[: expected.size], expected)


def test_derived_features_are_known_only_where_all_are_there():
    few = replace(spins(2, 0), observations=np.zeros((9, 3)), next_observations=np.zeros((9, 3)))
    assert seen_as(WHEEL, few).derivation.formulas == ()
    plain = replace(spins(2, 0), derivation=Derivation(0))
    assert seen_as(WHEEL, plain).derivation is WHEEL
    past = replace(plain, observations=np.tile(plain.observations, 2))
    assert seen_as(WHEEL, past).derivation is WHEEL


def planned(data):
    """Return the states of episodes that trees predict."""
    (model,) = fit_world_models(data, (0.5,))
    rollouts = PairedRollouts(model, 40, 1.0, np.random.default_rng(3))
    rollouts.run(packed((1, 0.0, 0, (5, 1.0, 1, 0))))
    states = rollouts._episodes.states[: rollouts.n_steps]
    later = np.flatnonzero(np.diff(rollouts._episodes.owner[: rollouts.n_steps]) == 0) + 1
    return states[later - 1], states[later]


def test_a_world_of_trees_computes_them():
    before, after = planned(spins(100, 0))
    assert len(after) > 300
    assert WHEEL.rows(after[:, :5], before[:, :7]).tolist() == after[:, :7].tolist()
    np.testing.assert_array_equal(after[:, 12:], after[:, 5:7] - before[:, 5:7])


def test_without_their_formulas_they_are_predicted_and_drift_away():
    before, after = planned(replace(spins(100, 0), derivation=Derivation(0)))
    assert np.abs(WHEEL.rows(after[:, :5], before[:, :7]) - after[:, :7]).max() > 0.1


@pytest.mark.parametrize("history", [0, 1])
def test_planning_knows_the_formulas_of_its_problem(history):
    """Those of the present step, where there are several."""
    schema = Schema.anonymous(2, 2).derive(["gap = x0 - x1"])
    problem = Problem(schema.with_history(history) if history else schema, history=history)
    derivation = PlanningMethod().start(problem, Start())._known().derivation
    assert derivation.n_measured == 2
    assert len(derivation.formulas) == 1
