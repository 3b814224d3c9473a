import itertools

import numpy as np
import pytest
from benchmarks import planning
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree import compiled
from eutree.errors import InvalidArgumentError
from eutree.mdp import NO_ACTION, TERMINAL, Model, TabularMDP, TransitionCounts, solve
from tests import naive_mdp


def model_of(probabilities, rewards, visits=None):
    """Return the sparse model of Pr [S, A, S] and R [S, A]; NaN rewards mean untried."""
    tried = ~np.isnan(rewards)
    dense = np.where(tried[..., np.newaxis], probabilities, 0.0)
    flat = dense.reshape(-1, dense.shape[2])
    pair, successor = np.nonzero(flat)
    return Model(
        indptr=np.searchsorted(pair, np.arange(len(flat) + 1)),
        successor=successor,
        probability=flat[pair, successor],
        termination=np.where(tried, np.round(1.0 - dense.sum(axis=2), 12), 0.0),
        reward=np.nan_to_num(rewards),
        visits=tried.astype(int) if visits is None else visits,
    )


def random_mdp(generator, n_states, n_actions, *, terminates=0.2, untried=0.0):
    """Return Pr and R with few successors, small whole rewards (so that there are ties)."""
    probabilities = np.zeros((n_states, n_actions, n_states))
    for s, a in itertools.product(range(n_states), range(n_actions)):
        ends = generator.choice(n_states, size=min(3, n_states), replace=False)
        probabilities[s, a, ends] = generator.dirichlet(np.ones(len(ends)))
        probabilities[s, a] *= 1.0 - terminates * generator.integers(0, 2)
    rewards = generator.integers(-2, 3, (n_states, n_actions)).astype(float)
    rewards[generator.random(rewards.shape) < untried] = np.nan
    return probabilities, rewards


@pytest.mark.parametrize("discount", [0.0, 0.5, 0.95, 0.999])
@pytest.mark.parametrize("seed", range(15))
def test_small_mdps_equal_the_best_of_all_policies(seed, discount):
    generator = np.random.default_rng(seed)
    probabilities, rewards = random_mdp(generator, int(generator.integers(1, 5)), 3)
    solution = solve(model_of(probabilities, rewards), discount, tolerance=1e-9)
    best = naive_mdp.best_of_all_policies(probabilities, rewards, discount)
    np.testing.assert_allclose(solution.values, best, atol=1e-9 / (1 - discount))
    assert solution.converged
    own = naive_mdp.policy_values(probabilities, rewards, discount, solution.policy)
    np.testing.assert_allclose(own, best, atol=1e-8 / (1 - discount))


@pytest.mark.parametrize("seed", range(30))
def test_undiscounted_small_mdps_equal_the_best_of_all_policies(seed):
    """All actions cost something and may end, so every policy has a value."""
    generator = np.random.default_rng(seed)
    probabilities, rewards = random_mdp(generator, 4, 3, terminates=0.0)
    probabilities[generator.integers(4), :, :] *= 0.5
    rewards = -1.0 - generator.random(rewards.shape)
    solution = solve(model_of(probabilities, rewards), 1.0, tolerance=1e-9)
    if solution.trapped.size == 0:
        best = naive_mdp.best_of_all_policies(probabilities, rewards, 1.0)
        np.testing.assert_allclose(solution.values, best, atol=1e-8)
        assert solution.discount == 1.0
        assert solution.converged


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.3, 0.9, 0.99]), st.booleans())
def test_the_true_error_is_within_the_bound(seed, discount, episodic):
    """The interval of MacQueen counts the absorbing state, or it would be too narrow."""
    generator = np.random.default_rng(seed)
    probabilities, rewards = random_mdp(generator, 30, 2, terminates=0.2 * episodic, untried=0.2)
    for tolerance in (1.0, 1e-3, 1e-6):
        solution = solve(model_of(probabilities, rewards), discount, tolerance=tolerance)
        exact = naive_mdp.value_iteration(probabilities, rewards, discount)
        error = np.abs(solution.values - exact).max()
        assert solution.bound <= tolerance
        assert error <= solution.bound + 1e-9
        touched = ~np.isnan(rewards).all(axis=1)
        best = np.nanmax(solution.action_values[touched], axis=1)
        np.testing.assert_array_equal(solution.values[touched], best)


@pytest.mark.parametrize("discount", [0.9, 1.0])
def test_a_chain_solved_by_hand(discount):
    """Start 0 -> 1 -> 2 -> goal worth 100, where each step but the last costs 2."""
    mdp = TabularMDP(TransitionCounts(3, 1), discount)
    for state in range(2):
        mdp.observe(state, 0, -2.0, state + 1)
    mdp.observe(2, 0, 100.0, TERMINAL)
    third, second = 100.0, -2.0 + discount * 100.0
    solution = mdp.solve(tolerance=1e-10)
    expected = [-2.0 + discount * second, second, third]
    np.testing.assert_allclose(solution.values, expected, rtol=1e-12)
    np.testing.assert_allclose(mdp.values, expected, rtol=1e-12)


def test_the_two_state_example_of_the_textbook():
    """Puterman (1994), section 3.1 with discount 0.95, as solved in his section 6.2."""
    probabilities = np.array([[[0.5, 0.5], [0.0, 1.0]], [[0.0, 1.0], [0.0, 0.0]]])
    rewards = np.array([[5.0, 10.0], [-1.0, np.nan]])
    solution = solve(model_of(probabilities, rewards), 0.95, tolerance=1e-10)
    np.testing.assert_allclose(solution.values, [60 / 7 - 120 / 7, -20.0], atol=1e-8)
    assert solution.policy.tolist() == [0, 0]
    assert np.isnan(solution.action_values[1, 1])


def waiting(n_waits, go):
    """Return an MDP in which one waits (costs 2, stays) or goes (ends)."""
    mdp = TabularMDP(TransitionCounts(1, 2), 1.0)
    for _ in range(n_waits):
        mdp.observe(0, 0, -2.0, 0)
    for reward in go:
        mdp.observe(0, 1, reward, TERMINAL)
    return mdp


def test_a_loop_that_costs_is_left():
    solution = waiting(5, [80.0]).solve()
    assert solution.values[0] == 80.0
    assert solution.action_values[0, 0] == pytest.approx(78.0)
    assert solution.policy[0] == 1
    assert solution.discount == 1.0


def test_a_loop_that_costs_is_left_even_for_a_worse_end():
    solution = waiting(5, [-1e6]).solve()
    assert solution.values[0] == -1e6
    assert solution.policy[0] == 1


def test_a_trapped_state_gets_the_floor():
    """Only waiting was ever tried: a stop loop alone makes I - P singular."""
    mdp = waiting(5, [])
    solution = mdp.solve()
    assert solution.trapped.tolist() == [0]
    np.testing.assert_allclose(solution.values, [-2.0 * mdp.horizon])


def test_a_trap_is_avoided_and_its_floor_reaches_those_before_it():
    mdp = TabularMDP(TransitionCounts(3, 2), 1.0, horizon=100.0)
    mdp.observe(2, 0, -2.0, 2)  # the trap
    mdp.observe(0, 0, 0.0, 2)
    mdp.observe(0, 0, 0.0, TERMINAL)
    mdp.observe(0, 1, -10.0, TERMINAL)
    mdp.observe(1, 0, 0.0, 2)
    solution = mdp.solve(tolerance=1e-9)
    assert solution.trapped.tolist() == [1, 2]
    np.testing.assert_allclose(solution.values, [-10.0, -198.0, -200.0])
    np.testing.assert_allclose(solution.action_values[0], [-100.0, -10.0])


def test_a_cycle_that_costs_nothing_is_not_taken_for_an_answer():
    mdp = TabularMDP(TransitionCounts(2, 2), 1.0)
    for state in range(2):
        mdp.observe(state, 0, 0.0, 1 - state)
        mdp.observe(state, 1, 7.0 + state, TERMINAL)
    solution = mdp.solve()
    np.testing.assert_allclose(solution.values, [8.0, 8.0])
    assert solution.discount == 1.0


def test_a_cycle_that_pays_is_cut_at_the_horizon():
    """Balancing: every step earns 1 and one may go on for ever."""
    mdp = TabularMDP(TransitionCounts(2, 2), 1.0, horizon=500.0)
    for state in range(2):
        mdp.observe(state, 0, 1.0, 1 - state)
        mdp.observe(state, 1, 1.0, TERMINAL)
    solution = mdp.solve()
    assert solution.discount == pytest.approx(0.998)
    np.testing.assert_allclose(solution.values, [500.0, 500.0], atol=1e-5)
    assert solution.converged


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6))
def test_an_undiscounted_solution_always_comes_to_an_end(seed):
    """Loops, traps, positive cycles, untried actions: all values finite, and consistent."""
    generator = np.random.default_rng(seed)
    n_states = int(generator.integers(1, 8))
    probabilities, rewards = random_mdp(
        generator, n_states, 2, terminates=float(generator.choice([0.0, 0.01, 0.5])), untried=0.2
    )
    solution = solve(model_of(probabilities, rewards), 1.0, tolerance=1e-6, horizon=200.0)
    assert np.isfinite(solution.values).all()
    assert solution.n_iterations < 100
    discounts = np.full((n_states, 1), solution.discount)
    discounts[solution.trapped] = 1.0 - 1.0 / 200.0
    q = rewards + discounts * np.einsum("ijk,k->ij", probabilities, solution.values)
    slack = 1e-4 * (1.0 + np.abs(solution.values).max())
    np.testing.assert_allclose(solution.action_values, q, atol=slack)


def test_an_end_that_is_as_good_as_none_is_treated_as_none():
    """A policy that ends after 10^15 steps makes I - Pr singular to the last digit."""
    model = Model(
        indptr=[0, 1], successor=[0], probability=[1.0], termination=[[1e-15]], reward=[[-2.0]],
        visits=[[1]],
    )  # fmt: skip
    solution = solve(model, 1.0)
    assert solution.discount == pytest.approx(0.999)
    np.testing.assert_allclose(solution.values, [-2000.0])


def test_untried_actions_are_left_out_or_count_what_they_are_told_to():
    mdp = TabularMDP(TransitionCounts(2, 2), 0.5)
    mdp.observe(0, 0, -3.0, 1)
    mdp.observe(1, 0, -4.0, TERMINAL)
    assert mdp.solve().values.tolist() == [-5.0, -4.0]
    counts = TransitionCounts.of(
        [0, 1], [0, 0], [-3.0, -4.0], [1, TERMINAL], n_states=2, n_actions=2
    )
    paper = TabularMDP(counts, 0.5, untried=0.0)
    solution = paper.solve()
    assert solution.values.tolist() == [0.0, 0.0]
    assert solution.policy.tolist() == [1, 1]
    assert solution.action_values.tolist() == [[-3.0, 0.0], [-4.0, 0.0]]


def test_a_state_in_which_nothing_was_tried_keeps_its_value():
    mdp = TabularMDP(TransitionCounts(2, 2), 0.5)
    mdp.observe(0, 0, 1.0, 1)
    mdp.values = [0.0, 40.0]
    solution = mdp.solve(tolerance=1e-9)
    np.testing.assert_allclose(solution.values, [21.0, 40.0])
    assert solution.policy.tolist() == [0, NO_ACTION]
    assert np.isnan(solution.action_values[1]).all()


def test_ties_keep_the_old_action():
    probabilities = np.zeros((1, 3, 1))
    rewards = np.array([[1.0, 1.0 + 1e-14, 1.0]])
    for old in range(3):
        solution = solve(model_of(probabilities, rewards), 0.9, initial_policy=[old])
        assert solution.policy.tolist() == [old]
    assert solve(model_of(probabilities, rewards), 0.9).policy.tolist() == [1]


@pytest.mark.parametrize("discount", [0.9, 1.0])
def test_the_same_model_gives_the_same_bytes(discount):
    model = model_of(*random_mdp(np.random.default_rng(3), 60, 3))
    first, second = solve(model, discount), solve(model, discount)
    for name in ("values", "action_values", "policy"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_a_warm_start_needs_fewer_rounds():
    generator = np.random.default_rng(1)
    rows = (
        generator.integers(0, 200, 20_000), generator.integers(0, 2, 20_000),
        generator.normal(size=20_000), generator.integers(-1, 200, 20_000),
    )  # fmt: skip
    mdp = TabularMDP(TransitionCounts.of(*rows, n_states=200, n_actions=2), 0.99)
    cold = mdp.solve()
    assert mdp.solve().n_iterations == 1 < cold.n_iterations


def test_a_random_walk_of_many_steps_without_discount():
    """The greedy policy of zero values takes about 10,000 steps to end, or drifts away."""
    generator = np.random.default_rng(0)
    states = generator.integers(0, 150, 12_000)
    ends = np.clip(states + generator.integers(-3, 4, 12_000), TERMINAL, 149)
    rewards = generator.normal(-1.0, 1.0, 12_000)
    actions = generator.integers(0, 2, 12_000)
    mdp = TabularMDP(
        TransitionCounts.of(states, actions, rewards, ends, n_states=150, n_actions=2), 1.0
    )
    solution = mdp.solve(tolerance=1e-8)
    assert solution.converged
    assert solution.discount == 1.0
    model = mdp.counts.model()
    q = model.reward + model.dense() @ solution.values
    np.testing.assert_allclose(q.max(axis=1), solution.values, atol=1e-9)


def test_a_far_horizon_does_not_magnify_what_evaluations_leave():
    """Loose evaluations once drove the values of this walk to 10^154."""
    generator = np.random.default_rng(1000)
    near = np.arange(1000)[:, np.newaxis] + np.array([-19, -13, -8, -3, 1, 2, 6, 11, 16, 20])
    successors = np.sort(np.clip(near, 0, 999), axis=1)
    probabilities = np.zeros((1000, 4, 1000))
    for s, a in itertools.product(range(1000), range(4)):
        np.add.at(probabilities[s, a], successors[s], generator.dirichlet(np.ones(10)))
    model = model_of(probabilities, generator.random((1000, 4)))
    solution = solve(model, 0.9999)
    assert solution.converged
    q = model.reward + 0.9999 * (model.dense() @ solution.values)
    assert np.abs(q.max(axis=1) - solution.values).max() < 1e-9


@pytest.mark.skipif(not compiled.ENABLED, reason="there is no speed without compilation")
def test_it_is_much_faster_than_gauss_seidel():
    """Measured: 0.1 of it at this size and discount (benchmarks/planning.py); 0.4 is the goal."""
    model = planning.random_model("plane", 1000, np.random.default_rng(0))
    cost = planning.measure(model, 0.99, 3, peers=False)
    assert cost["ours"] < 0.6 * cost["GS"]


def test_what_cannot_be_solved_is_refused():
    model = model_of(*random_mdp(np.random.default_rng(0), 3, 2))
    with pytest.raises(InvalidArgumentError, match=r"discount must be a number in \[0, 1\]"):
        solve(model, 1.1)
    with pytest.raises(InvalidArgumentError, match="initial_values must have 3 entries"):
        solve(model, 0.9, initial_values=[0.0])
    with pytest.raises(InvalidArgumentError, match="initial_policy must have 3 actions"):
        solve(model, 0.9, initial_policy=[0, 0, 2])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"visits": [1, 1]}, "visits must have shape"),
        ({"reward": [[0.0]]}, "must have the shape"),
        ({"indptr": [0, 1]}, "indptr must have 3 entries"),
        ({"successor": [0, 0]}, "as many entries"),
        ({"successor": [5, 0, 0]}, r"successor must be in 0\.\.0"),
        ({"reward": [[np.nan, 0.0]]}, "reward must be finite"),
        ({"termination": [[0.9, 0.0]]}, "probabilities must sum to 1, got 1.4"),
    ],
)
def test_a_model_that_is_none_is_refused(change, message):
    fields = {
        "indptr": [0, 1, 3], "successor": [0, 0, 0], "probability": [0.5, 0.5, 0.5],
        "termination": [[0.5, 0.0]], "reward": [[0.0, 0.0]], "visits": [[1, 1]],
    }  # fmt: skip
    Model(**fields)
    with pytest.raises(InvalidArgumentError, match=message):
        Model(**(fields | change))
