import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from eutree.errors import InvalidArgumentError
from eutree.mdp import TERMINAL, TabularMDP, TransitionCounts
from tests import naive_mdp

REWARDS = st.sampled_from([-2.0, 0.0, 0.1, 1 / 3, 100.0])


class Twins(RuleBasedStateMachine):
    """TabularMDP beside a list of transitions, under any order of operations."""

    @initialize(n_states=st.integers(1, 4), n_actions=st.integers(1, 3), data=st.data())
    def start(self, n_states, n_actions, data):
        self.discount = data.draw(st.sampled_from([0.5, 0.9]))
        self.naive = naive_mdp.NaiveMDP(n_states, n_actions, self.discount)
        self.fast = TabularMDP(TransitionCounts(n_states, n_actions), self.discount)

    def draw(self, data):
        return (
            data.draw(st.integers(0, self.naive.n_states - 1)),
            data.draw(st.integers(0, self.naive.n_actions - 1)),
            data.draw(REWARDS),
            data.draw(st.integers(TERMINAL, self.naive.n_states - 1)),
        )

    @rule(data=st.data(), backups=st.integers(0, 5))
    def observe(self, data, backups):
        transition = self.draw(data)
        self.naive.observe(*transition)
        self.fast.observe(*transition, backups)

    @rule(data=st.data(), size=st.integers(0, 40))
    def observe_batch(self, data, size):
        rows = [self.draw(data) for _ in range(size)]
        for row in rows:
            self.naive.observe(*row)
        self.fast.counts.observe(*columns(rows))

    @precondition(lambda self: self.naive.transitions)
    @rule(data=st.data())
    def forget(self, data):
        transition = data.draw(st.sampled_from(self.naive.transitions))
        self.naive.forget(transition)
        self.fast.counts.forget(*([value] for value in transition))
        self.sum_rewards_again()

    @precondition(lambda self: self.naive.transitions)
    @rule(data=st.data())
    def split(self, data):
        """Give some transitions out of and into a state to a new one."""
        state = data.draw(st.integers(0, self.naive.n_states - 1))
        self.naive.add_state()
        new = self.fast.add_state(self.fast.values[state])
        assert new == self.naive.n_states - 1
        old_rows = self.naive.transitions
        moves = data.draw(st.lists(st.booleans(), min_size=2, max_size=2 * len(old_rows)))
        choice = np.resize(moves, (len(old_rows), 2))
        new_rows = [
            (new if s == state and left else s, a, r, new if end == state and right else end)
            for (s, a, r, end), (left, right) in zip(old_rows, choice, strict=True)
        ]
        self.naive.transitions = new_rows
        states, actions, _, ends = columns(old_rows)
        new_states, _, _, new_ends = columns(new_rows)
        self.fast.counts.relabel(
            actions, states=states, next_states=ends, new_states=new_states,
            new_next_states=new_ends,
        )  # fmt: skip
        self.sum_rewards_again()

    def sum_rewards_again(self):
        states, actions, rewards, _ = columns(self.naive.transitions)
        self.fast.counts.set_rewards(range(self.naive.n_states), states, actions, rewards)

    @rule()
    def solve(self):
        before = self.fast.values.copy()
        solution = self.fast.solve(tolerance=1e-9)
        assert solution.converged
        expected = naive_mdp.value_iteration(*self.naive.model(), self.discount, values=before)
        np.testing.assert_allclose(self.fast.values, expected, atol=2e-9)

    @invariant()
    def same_counts(self):
        np.testing.assert_array_equal(self.fast.counts.visits, self.naive.visits())
        np.testing.assert_array_equal(self.fast.counts.reward_sums, self.naive.reward_sums())
        for s in range(self.naive.n_states):
            assert list(
                zip(*self.fast.counts.predecessors(s), strict=True)
            ) == self.naive.predecessors(s)
            for a in range(self.naive.n_actions):
                found = list(zip(*self.fast.counts.successors(s, a), strict=True))
                assert found == self.naive.successors(s, a)

    @invariant()
    def same_model(self):
        probabilities, rewards = self.naive.model()
        np.testing.assert_allclose(self.fast.counts.rewards, rewards, rtol=1e-15)
        model = self.fast.counts.model()
        np.testing.assert_allclose(model.dense(), np.nan_to_num(probabilities), rtol=1e-15)
        for s in range(self.naive.n_states):
            for a in range(self.naive.n_actions):
                np.testing.assert_array_equal(
                    self.fast.counts.probabilities(s, a), probabilities[s, a]
                )

    @invariant()
    def equal_to_a_rebuild(self):
        rebuilt = TransitionCounts.of(
            *columns(self.naive.transitions), n_states=self.naive.n_states,
            n_actions=self.naive.n_actions,
        )  # fmt: skip
        mine, other = self.fast.counts.model(), rebuilt.model()
        for name in ("indptr", "successor", "probability", "termination", "reward", "visits"):
            assert getattr(mine, name).tobytes() == getattr(other, name).tobytes()


def columns(rows):
    states, actions, rewards, ends = ([row[i] for row in rows] for i in range(4))
    integer = np.int64
    return (
        np.array(states, integer), np.array(actions, integer), np.array(rewards, float),
        np.array(ends, integer),
    )  # fmt: skip


Twins.TestCase.settings = settings(max_examples=25, stateful_step_count=25, deadline=None)
TestTwins = Twins.TestCase


def random_rows(generator, n_rows, n_states, n_actions):
    return (
        generator.integers(0, n_states, n_rows),
        generator.integers(0, n_actions, n_rows),
        generator.normal(size=n_rows),
        generator.integers(-1, n_states, n_rows),
    )


def test_one_by_one_equals_batch_equals_all_at_once():
    rows = random_rows(np.random.default_rng(0), 3000, 40, 3)
    single = TabularMDP(TransitionCounts(40, 3), 0.9)
    for row in zip(*rows, strict=True):
        single.observe(*row)
    batch = TabularMDP(TransitionCounts(40, 3), 0.9)
    batch.counts.observe(*rows)
    whole = TabularMDP(TransitionCounts.of(*rows, n_states=40, n_actions=3), 0.9)
    whole.counts.observe(*rows)
    whole.counts.forget(*rows)
    whole.counts.set_rewards(range(40), *rows[:3])
    for other in (batch, whole):
        assert other.counts.reward_sums.tobytes() == single.counts.reward_sums.tobytes()
        for name in ("indptr", "successor", "probability", "termination"):
            mine, theirs = getattr(single.counts.model(), name), getattr(other.counts.model(), name)
            assert mine.tobytes() == theirs.tobytes()


def test_memory_follows_the_distinct_triples():
    generator = np.random.default_rng(0)
    mdp = TabularMDP(TransitionCounts(50, 2), 0.9)
    states = generator.integers(0, 50, 200_000)
    ends = np.clip(states + generator.integers(-2, 3, 200_000), 0, 49)
    for block in np.array_split(np.arange(200_000), 20):
        mdp.counts.observe(states[block], block % 2, np.zeros(len(block)), ends[block])
    assert mdp.nbytes < 40_000


def test_many_states_are_added_one_at_a_time():
    mdp = TabularMDP(TransitionCounts(1, 2), 0.9)
    for expected in range(1, 1000):
        assert mdp.add_state(value=float(expected)) == expected
        mdp.observe(expected - 1, 0, 1.0, expected)
    assert mdp.n_states == 1000
    assert mdp.values[999] == 999.0
    assert mdp.counts.visits.sum() == 999
    assert mdp.counts.predecessors(999)[0].tolist() == [998]


def test_a_transition_changes_only_the_action_that_was_taken():
    """Bug of others: the update ran over all actions for one transition."""
    mdp = TabularMDP(TransitionCounts(2, 3), 0.9)
    mdp.observe(0, 1, 5.0, TERMINAL, 10)
    assert mdp.counts.visits.tolist() == [[0, 1, 0], [0, 0, 0]]
    assert np.isnan(mdp.action_values[0, [0, 2]]).all()
    assert mdp.action_values[0, 1] == 5.0


def test_the_mean_reward_weighs_all_visits_alike():
    """Bug of others: a step size written 1 / 1 + visits forgets or overshoots."""
    mdp = TabularMDP(TransitionCounts(1, 1), 0.9)
    for reward in (1.0, 2.0, 6.0):
        mdp.observe(0, 0, reward, TERMINAL, 1)
    assert mdp.counts.rewards[0, 0] == 3.0
    assert mdp.values[0] == 3.0


def test_nothing_is_bootstrapped_through_a_terminal():
    """Bug of others: termination was discarded and the next state's value counted."""
    mdp = TabularMDP(TransitionCounts(2, 1), 0.9)
    mdp.observe(1, 0, 100.0, TERMINAL, 5)
    mdp.observe(0, 0, 1.0, TERMINAL, 5)
    assert mdp.values.tolist() == [1.0, 100.0]
    assert mdp.solve().values.tolist() == [1.0, 100.0]


def test_a_new_state_has_values_of_its_own():
    """Bug of others: new leaves got no Q, a random Q, or all shared one vector."""
    mdp = TabularMDP(TransitionCounts(1, 2), 0.5)
    mdp.observe(0, 0, 4.0, TERMINAL, 1)
    first, second = mdp.add_state(mdp.values[0]), mdp.add_state(mdp.values[0])
    assert mdp.values.tolist() == [4.0, 4.0, 4.0]
    mdp.observe(first, 1, 8.0, TERMINAL, 1)
    assert mdp.values.tolist() == [4.0, 8.0, 4.0]
    assert np.isnan(mdp.action_values[second]).all()


def test_properties_cannot_be_written_to():
    mdp = TabularMDP(TransitionCounts(2, 2), 0.9)
    for array in (mdp.counts.visits, mdp.counts.reward_sums, mdp.values, mdp.action_values):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize(
    "transition",
    [(2, 0, 0.0, 0), (-1, 0, 0.0, 0), (0, 2, 0.0, 0), (0, -1, 0.0, 0), (0, 0, 0.0, 2),
     (0, 0, 0.0, -2), (0, 0, np.nan, 0), (0, 0, np.inf, 0)],
)  # fmt: skip
def test_a_transition_that_cannot_be_is_refused_and_nothing_changes(transition):
    mdp = TabularMDP(TransitionCounts(2, 2), 0.9)
    with pytest.raises(InvalidArgumentError, match=r"states in 0\.\.1"):
        mdp.observe(*transition)
    with pytest.raises(InvalidArgumentError, match=r"must be"):
        mdp.counts.observe(*([value] for value in transition))
    assert mdp.counts.visits.sum() == 0


def test_a_transition_that_never_was_cannot_be_forgotten_or_moved():
    mdp = TabularMDP(TransitionCounts(2, 1), 0.9)
    mdp.observe(0, 0, 1.0, 1)
    with pytest.raises(InvalidArgumentError, match="row 0 must be a transition that was counted"):
        mdp.counts.forget([0], [0], [1.0], [0])
    with pytest.raises(InvalidArgumentError, match="row 0 must be a transition that was counted"):
        mdp.counts.relabel([0], states=[1], next_states=[1], new_states=[0], new_next_states=[0])
    with pytest.raises(InvalidArgumentError, match="vectors of one size"):
        mdp.counts.observe([0, 0], [0], [0.0], [0])
    with pytest.raises(InvalidArgumentError, match="vector of integers"):
        mdp.counts.observe([0.5], [0], [0.0], [0])
