import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError
from eutree.mdp import TERMINAL, TabularMDP, TransitionCounts
from eutree.mdp import _kernels_sweeping as kernels
from tests.naive_mdp import NaiveQueue

EXACT = 0.0  # precision


def rows_of(generator, n_rows, n_states, n_actions):
    states = generator.integers(0, n_states, n_rows)
    ends = np.clip(states + generator.integers(-2, 4, n_rows), 0, n_states)
    return (
        states, generator.integers(0, n_actions, n_rows), generator.normal(size=n_rows),
        np.where(ends == n_states, TERMINAL, ends),
    )  # fmt: skip


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.one_of(st.none(), st.tuples(st.integers(0, 7), st.sampled_from([0.5, 1.0, 2.0, 3.5])))
    )
)
def test_the_queue_equals_its_naive_twin(operations):
    """Bug of others: a queue that kept the lower of two priorities."""
    heap = np.full((2, 8), kernels.NO_PLACE, np.int32)
    priority, counters, naive = np.zeros(8), np.zeros(2, np.int64), NaiveQueue()
    for operation in operations:
        if operation is not None:
            naive.push(*operation)
            kernels.push(heap, priority, counters, *operation)
        elif naive.priorities:
            assert kernels.pop(heap, priority, counters) == naive.pop()
    while naive.priorities:
        assert kernels.pop(heap, priority, counters) == naive.pop()
    assert counters[kernels.QUEUED] == 0


def test_a_queued_state_keeps_the_larger_priority():
    """Bug of others, as it shows: state 1 must be backed up before 2, and both before 0.

    States 1 and 2 both lead to 3 and 4. When 3 changes by 10, state 1 gets priority 10 and state 2
    priority 5; when 4 changes by 1 afterwards, they must not fall to 0.5.
    """
    heap = np.full((2, 3), kernels.NO_PLACE, np.int32)
    priority, counters = np.zeros(3), np.zeros(2, np.int64)
    for state, value in ((0, 4.0), (1, 10.0), (2, 5.0), (1, 0.5), (2, 0.5)):
        kernels.push(heap, priority, counters, state, value)
    assert [kernels.pop(heap, priority, counters) for _ in range(3)] == [1, 2, 0]


@pytest.mark.promise(18)
@pytest.mark.parametrize("discount", [0.5, 0.9, 0.99])
@pytest.mark.parametrize("untried", [None, 0.0])
def test_it_converges_to_the_exact_solution(discount, untried):
    rows = rows_of(np.random.default_rng(0), 400, 30, 3)
    swept = TabularMDP(TransitionCounts(30, 3), discount, untried=untried, precision=EXACT)
    for row in zip(*rows, strict=True):
        swept.observe(*row, 3)
    swept.queue()
    assert swept.sweep(10**6) < 10**6
    exact = TabularMDP(
        TransitionCounts.of(*rows, n_states=30, n_actions=3), discount, untried=untried
    )
    exact.solve(tolerance=1e-11)
    np.testing.assert_allclose(swept.values, exact.values, atol=1e-9)
    np.testing.assert_allclose(swept.action_values, exact.action_values, atol=1e-9)


@pytest.mark.promise(18)
def test_it_converges_without_discount():
    mdp = TabularMDP(TransitionCounts(3, 2), 1.0, precision=EXACT)
    for state in range(3):
        mdp.observe(state, 0, -2.0, state)  # stop: a loop
        mdp.observe(state, 1, -1.0, state + 1 if state < 2 else TERMINAL)
        mdp.observe(state, 1, -1.0, state)
    mdp.queue()
    assert mdp.sweep(10_000) < 10_000
    np.testing.assert_allclose(mdp.values, [-6.0, -4.0, -2.0], atol=1e-9)
    np.testing.assert_allclose(mdp.solve(tolerance=1e-10).values, [-6.0, -4.0, -2.0], atol=1e-9)


@pytest.mark.parametrize(
    ("stop", "go", "value"), [(-2.0, None, -2000.0), (-0.01, -50.0, -50.0), (1.0, -50.0, 1000.0)]
)
def test_an_endless_loop_is_worth_the_same_as_to_the_solver(stop, go, value):
    """It pays, or nothing else was tried: the horizon; else it is left, however bad the end."""
    mdp = TabularMDP(TransitionCounts(1, 2), 1.0)
    mdp.observe(0, 0, stop, 0, 5)
    if go is not None:
        mdp.observe(0, 1, go, TERMINAL, 5)
    assert mdp.values[0] == pytest.approx(value)
    assert mdp.sweep(1000) == 0
    assert mdp.solve().values[0] == pytest.approx(value)


def test_the_first_backup_is_of_the_state_just_left():
    mdp = TabularMDP(TransitionCounts(3, 1), 1.0)
    mdp.observe(0, 0, 0.0, 1)
    mdp.observe(1, 0, 0.0, 2)
    mdp.observe(2, 0, 8.0, TERMINAL, 1)
    assert mdp.values.tolist() == [0.0, 0.0, 8.0]


def test_a_change_travels_backwards_within_the_budget():
    mdp = TabularMDP(TransitionCounts(4, 1), 1.0)
    for state in range(3):
        mdp.observe(state, 0, 0.0, state + 1, 10)
    mdp.observe(3, 0, 8.0, TERMINAL, 3)
    assert mdp.values.tolist() == [0.0, 8.0, 8.0, 8.0]
    assert mdp.sweep(10) == 1
    assert mdp.values.tolist() == [8.0, 8.0, 8.0, 8.0]


def test_small_changes_rest_below_the_threshold():
    mdp = TabularMDP(TransitionCounts(2, 1), 0.9, precision=1.0)
    mdp.observe(0, 0, 0.0, 1, 10)
    mdp.observe(1, 0, 0.05, TERMINAL, 10)
    assert mdp.values.tolist() == [0.0, 0.05]
    mdp.observe(1, 0, 100.05, TERMINAL, 10)
    assert mdp.values[0] == pytest.approx(0.9 * 50.05)


def test_the_solution_empties_the_queue():
    mdp = TabularMDP(TransitionCounts(2, 1), 0.9)
    mdp.observe(0, 0, 1.0, 1)
    mdp.solve()
    assert mdp.sweep(10) == 0


def test_what_cannot_be_swept_is_refused():
    with pytest.raises(InvalidArgumentError, match="precision must be a number"):
        TabularMDP(TransitionCounts(2, 1), 0.9, precision=-1.0)
    with pytest.raises(InvalidArgumentError, match=r"states must be an integer from 0 to 1"):
        TabularMDP(TransitionCounts(2, 1), 0.9).queue([2])
