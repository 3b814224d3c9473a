"""A savepoint of the leaf MDP against a copy of its state; the sweep against a plain one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError
from eutree.mdp import TERMINAL, TabularMDP, TransitionCounts
from eutree.mdp import _kernels_sweeping as kernels
from tests import naive_mdp

transitions = st.lists(
    st.tuples(
        st.integers(0, 5), st.integers(0, 1), st.sampled_from([-2.0, 0.1, 1 / 3, 100.0]),
        st.integers(TERMINAL, 5),
    ),
    max_size=30,
)  # fmt: skip


def bits(mdp):
    return {name: array.tobytes() for name, array in mdp.state().items()}


def observed(rows, backups=2):
    mdp = TabularMDP(TransitionCounts(6, 2), 0.9)
    for row in rows:
        mdp.observe(*row, backups)
    return mdp


def take_back(mdp, rows):
    if rows:
        states, actions, rewards, ends = zip(*rows, strict=True)
        mdp.counts.forget(states, actions, rewards, ends)
    mdp.rollback()


@settings(max_examples=100, deadline=None)
@given(before=transitions, after=transitions, again=transitions, backups=st.integers(0, 6))
def test_a_rollback_restores_every_bit(before, after, again, backups):
    mdp, twin = observed(before), observed(before)
    expected = bits(mdp)
    for rows in (after, again):
        mdp.savepoint()
        for row in rows:
            mdp.observe(*row, backups)
        mdp.sweep(backups)
        take_back(mdp, rows)
        assert bits(mdp) == expected
    for row in again:
        mdp.observe(*row, 3)
        twin.observe(*row, 3)
    assert bits(mdp) == bits(twin)


@settings(max_examples=60, deadline=None)
@given(before=transitions, after=transitions)
def test_a_savepoint_changes_nothing_of_what_follows(before, after):
    mdp, twin = observed(before), observed(before)
    mdp.savepoint()
    for row in after:
        mdp.observe(*row, 4)
        twin.observe(*row, 4)
    assert bits(mdp) == bits(twin)


CHANGES = {
    "solve": lambda mdp: mdp.solve(),
    "restore": lambda mdp: mdp.restore(mdp.state()),
    "add_state": lambda mdp: mdp.add_state(),
    "queue": lambda mdp: mdp.queue([0]),
    "values": lambda mdp: setattr(mdp, "values", np.ones(6)),
    "observe_batch": lambda mdp: mdp.counts.observe([0], [0], [1.0], [1]),
    "set_rewards": lambda mdp: mdp.counts.set_rewards([3], [3], [0], [1.0]),
    "relabel": lambda mdp: mdp.counts.relabel(
        [0], states=[0], next_states=[1], new_states=[2], new_next_states=[1]
    ),
    "rollback": lambda mdp: mdp.rollback(),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_savepoint_does_not_outlive_other_changes(change):
    mdp = observed([(0, 0, 1.0, 1)])
    mdp.savepoint()
    mdp.observe(1, 0, 1.0, 2, 3)
    CHANGES[change](mdp)
    with pytest.raises(InvalidArgumentError, match="rollback needs a savepoint"):
        mdp.rollback()
    mdp.savepoint()
    expected = bits(mdp)
    mdp.observe(1, 0, 5.0, 2, 3)
    take_back(mdp, [(1, 0, 5.0, 2)])
    assert bits(mdp) == expected


@settings(max_examples=100, deadline=None)
@given(rows=transitions, budget=st.integers(0, 20))
def test_the_sweep_equals_its_naive_twin(rows, budget):
    mdp, twin = observed(rows, 0), observed(rows, 0)
    queue = naive_mdp.NaiveQueue()
    for state in range(6):
        mdp.queue([state])
        queue.push(state, kernels.SOON)

    def back_up(state):
        return kernels.back_up(twin.arrays, state, np.empty(twin.counts.n_actions, np.int64))

    done = naive_mdp.sweep(twin, queue, back_up, budget, twin.arrays.settings[kernels.THRESHOLD])
    assert mdp.sweep(budget) == done
    assert mdp.values.tobytes() == twin.values.tobytes()
    assert mdp.action_values.tobytes() == twin.action_values.tobytes()
    state = mdp.state()
    assert {s: state["priority"][s] for s in state["queue"].tolist()} == queue.priorities
