"""When the leaf MDP is solved exactly, and that nothing else depends on who asks when."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.errors import FormatError, InvalidArgumentError
from eutree.learners import CORRECTED, PAPER, Start, Step, UTreeMethod
from eutree.mdp import TabularMDP
from eutree.splitting import Naive
from tests.learners.battery import checked_state
from tests.worlds import Walk
from tests.worlds import learned_to_walk as learned

SPLITS = replace(CORRECTED, significance=Naive(), solve_growth=1.5)


@pytest.fixture
def solved(monkeypatch):
    """Return the number of leaves at each exact solution."""
    sizes, solve = [], TabularMDP.solve
    monkeypatch.setattr(
        TabularMDP, "solve", lambda self, **options: sizes.append(self.n_states) or solve(self)
    )
    return sizes


def go_on(learner, phases, seed=5, episodes=4):
    world, generator = Walk(np.random.default_rng(seed)), np.random.default_rng(seed + 1)
    for _ in range(phases):
        for _ in range(episodes):
            world.run(learner, generator)
        learner.update(generator)


def test_expansions_between_exact_solutions_do_not_solve(solved):
    learner = learned(SPLITS, phases=1, episodes=4)
    marks = [learner.history.n_seen]
    assert len(solved) == 1
    split_between = 0
    for phase in range(30):
        leaves = learner.tree.n_leaves
        go_on(learner, 1, seed=phase)
        due = learner.history.n_seen >= 1.5 * marks[-1]
        if due:
            marks.append(learner.history.n_seen)
        else:
            split_between += learner.tree.n_leaves - leaves
        assert len(solved) == len(marks)
    assert 5 < len(marks) < 15
    assert split_between > 0


def test_the_papers_settings_solve_in_every_expansion(solved):
    assert PAPER.solve_growth == 1.0
    learner = learned(replace(PAPER, solve_each_split=False), phases=1)
    go_on(learner, 5)
    assert len(solved) == 6


def test_a_history_that_does_not_grow_is_solved_in_every_expansion(solved):
    learner = learned(SPLITS)
    n_solved = len(solved)
    for _ in range(3):
        learner.update(np.random.default_rng(0))
    assert len(solved) >= n_solved + 2
    exact = learner.mdp.values.copy()
    learner.mdp.solve(tolerance=1e-9)
    np.testing.assert_allclose(learner.mdp.values, exact, atol=1e-5)


def test_the_turnover_of_a_bounded_history_counts(solved):
    """A full history does not grow; what has been replaced in it counts instead."""
    learner = learned(replace(SPLITS, max_transitions=100), phases=4)
    n_solved, seen = len(solved), learner.history.n_seen
    go_on(learner, 20)
    turnovers = (learner.history.n_seen - seen) / 100
    assert turnovers > 4
    assert len(solved) - n_solved >= turnovers


def test_halves_of_split_leaves_are_backed_up_without_an_exact_solution(solved):
    """Each half gets a Q of its own, and values end close to the exact ones."""
    learner = learned(replace(SPLITS, solve_growth=100.0), phases=1)
    assert len(solved) == 1
    go_on(learner, 12)
    assert len(solved) == 1
    assert learner.tree.n_leaves > 5
    tried = learner.mdp.counts.visits > 0
    assert np.isfinite(learner.mdp.action_values[tried]).all()
    swept = learner.mdp.values.copy()
    learner.mdp.queue()
    learner.mdp.sweep(100_000)
    np.testing.assert_allclose(swept, learner.mdp.values, atol=5.0)  # of values up to 100


@pytest.mark.parametrize("growth", [1.0, 1.3, 3.0])
def test_a_restored_learner_solves_when_the_original_does(growth):
    settings = replace(SPLITS, solve_growth=growth)
    original = learned(settings, phases=5)
    state = {k: v.copy() for k, v in original.state().items()}
    assert ("solved_at" in state) == (growth > 1.0)
    checked_state("checkpoint.npz", state, settings, Walk.problem, Start())
    copy = settings.restore(Walk.problem, Start(), state)
    for learner in (original, copy):
        go_on(learner, 8)
    mine, theirs = original.state(), copy.state()
    assert mine.keys() == theirs.keys()
    assert all(mine[k].tobytes() == theirs[k].tobytes() for k in mine)


def test_a_discarded_episode_leaves_no_trace_between_solutions():
    learner = learned(replace(SPLITS, backups=1, solve_growth=100.0), phases=6)
    Walk(np.random.default_rng(8)).run(learner, np.random.default_rng(9))
    assert learner.mdp.state()["queue"].size > 1
    before = learner.state()
    learner.start_episode(np.zeros(2), np.random.default_rng(0))
    for step in range(9):
        learner.observe(Step(learner.act(), -3.25, np.array([step, 0.5]), False, False))
    learner.discard_episode()
    after = learner.state()
    assert all(before[k].tobytes() == after[k].tobytes() for k in before)


@pytest.mark.parametrize("solved_at", [np.array([-1]), np.array([10**9]), np.array([0.5]), None])
def test_a_stored_state_says_when_it_was_solved(solved_at):
    state = dict(learned(SPLITS).state())
    state["solved_at"] = solved_at
    if solved_at is None:
        del state["solved_at"]
    with pytest.raises(FormatError, match="solved_at"):
        checked_state("checkpoint.npz", state, SPLITS, Walk.problem, Start())


def test_a_growth_below_one_is_refused():
    with pytest.raises(InvalidArgumentError, match="solve_growth must be a number"):
        UTreeMethod(solve_growth=0.9)
