"""Leaves that keep their action until there is evidence for another one."""

import numpy as np
import pytest

from eutree.errors import FormatError, InvalidArgumentError
from eutree.learners import Start
from eutree.learners.learner import Step
from eutree.learners.starts import STARTS, start_of
from eutree_lab.history_u_tree.evidence import FEWEST
from eutree_lab.history_u_tree.method import HistoryUTreeMethod
from tests.learners.battery import checked_state
from tests.worlds import Corridor, play, problem_of, recorded

SEEDS = range(5)


def method(**choices):
    return HistoryUTreeMethod(history=0, past_actions=0, fringe=1, **choices)


def bandit(chosen, pulls):
    """Return a learner that has seen episodes of one step, ``(action, reward)`` each."""
    problem = problem_of(Corridor())
    learner = chosen.start(problem, Start())
    generator = np.random.default_rng(0)
    for action, reward in pulls:
        learner.start_episode(np.zeros(problem.n_features), generator)
        learner.observe(Step(action, reward, np.zeros(problem.n_features), True, False))
        learner.end_episode()
    learner.update(generator)
    return learner


def noisy(generator, action, mean, n, spread=5.0):
    return [(action, float(r)) for r in mean + spread * generator.normal(size=n)]


@pytest.mark.parametrize("seed", SEEDS)
def test_luck_does_not_overrule_what_is_kept_but_evidence_does(seed):
    """Action 0 is kept. The best of a few equal means is another action half of the time."""
    generator = np.random.default_rng(seed)
    pulls = noisy(generator, 0, 0.0, 40)
    lucky = pulls + [(1, 30.0)] * (FEWEST - 1)  # so few are none, whatever they earned
    assert bandit(method(), lucky).decisions().actions.tolist() == [1]  # Eq. 1
    assert bandit(method(evidence=2.0), lucky).decisions().actions.tolist() == [0]
    better = pulls + noisy(generator, 1, 10.0, 40)
    assert bandit(method(evidence=2.0), better).decisions().actions.tolist() == [1]


def test_as_many_standard_errors_as_are_asked_for_are_what_it_takes():
    """The lead is known: the variance within both actions is one, 50 pulls of each."""
    ones = [1.0, -1.0] * 25
    for lead, errors, expected in ((0.5, 2.0, 1), (0.5, 3.0, 0), (0.7, 3.0, 1), (0.0, 0.0, 0)):
        pulls = [(0, r) for r in ones] + [(1, r + lead) for r in ones]
        learner = bandit(method(evidence=errors), pulls)
        standard_error = np.sqrt((100 / 99) * 2 / 50)
        assert (lead > errors * standard_error) == bool(expected)
        assert learner.decisions().actions.tolist() == [expected]


def naive_values(tree, discount):
    """Solve V of the kept policy by following every stored row by itself, many times."""
    history, kept = tree.history, tree.greedy_actions()
    values = np.zeros(tree.tree.n_leaves)
    for _ in range(300):
        found = [[] for _ in values]
        for row in range(history.size):
            if history.actions[row] != kept[history.left[row]]:
                continue
            total, weight, at = 0.0, 1.0, row
            while True:
                total += weight * history.rewards[at]
                weight *= discount
                if history.entered[at] < 0:
                    break
                goes_on = at + 1 < history.size and history.continues[at + 1]
                if not goes_on or history.actions[at + 1] != kept[history.left[at + 1]]:
                    total += weight * values[history.entered[at]]
                    break
                at += 1
            found[history.left[row]].append(total)
        values = np.array([np.mean(f) if f else v for f, v in zip(found, values, strict=True)])
    return values


def lived(chosen, start_name, episodes=12):
    problem = problem_of(Corridor())
    generator = np.random.default_rng(3)
    start = start_of(start_name, problem, demonstrations=recorded(), generator=generator)
    learner = chosen.start(problem, start)
    for number in range(episodes):
        play(learner, Corridor(), seed=100 + number)
        if number % 4 == 3:
            learner.update(np.random.default_rng(number))
    return problem, start, learner


def test_the_value_of_what_is_kept_is_that_of_a_naive_evaluation():
    _, _, learner = lived(method(evidence=2.0), "tree+demos")
    tree = learner.tree
    visited = np.unique(
        tree.history.left[tree.history.actions == tree.greedy_actions()[tree.history.left]]
    )
    naive = naive_values(tree, tree.method.discount)
    np.testing.assert_allclose(learner.state()["kept_values"][visited], naive[visited], atol=0.1)


@pytest.mark.parametrize("start_name", STARTS)
def test_it_goes_on_to_the_same_bytes_from_what_was_stored(start_name, tmp_path):
    chosen = HistoryUTreeMethod(evidence=2.0)
    problem, start, learner = lived(chosen, start_name)
    state = {name: np.array(array) for name, array in learner.state().items()}
    checked_state(tmp_path, state, chosen, problem, start)
    other = chosen.restore(problem, start, state)
    for one in (learner, other):
        play(one, Corridor(), seed=7)
        one.update(np.random.default_rng(7))
    one, two = learner.state(), other.state()
    assert {k: a.tobytes() for k, a in one.items()} == {k: a.tobytes() for k, a in two.items()}
    longer = state | {"kept_values": np.zeros(10**3)}
    with pytest.raises(FormatError, match="kept_values"):
        checked_state(tmp_path, longer, chosen, problem, start)
    with pytest.raises(FormatError, match="kept_values"):
        checked_state(tmp_path, state, HistoryUTreeMethod(), problem, start)


def test_where_only_demonstrations_are_given_a_leaf_keeps_what_was_done_there():
    shown = recorded()
    problem = problem_of(Corridor())
    start = start_of("demos", problem, demonstrations=shown, generator=np.random.default_rng(0))
    learner = method(evidence=2.0).start(problem, start)
    most = np.bincount(shown.actions).argmax()
    assert learner.decisions().actions.tolist() == [most]


def test_a_locked_leaf_keeps_its_action_whatever_the_evidence():
    problem = problem_of(Corridor())
    start = start_of("tree", problem, demonstrations=recorded(), generator=np.random.default_rng(0))
    learner = method(evidence=0.0, exploration=1.0).start(problem, start)
    before = learner.decisions()
    learner.tree._locked = frozenset(range(before.tree.n_leaves))
    for number in range(8):
        play(learner, Corridor(), seed=number)
    learner.update(np.random.default_rng(0))
    assert learner.decisions().actions.tolist() == before.actions.tolist()


@pytest.mark.parametrize("evidence", [-1.0, float("nan")])
def test_a_wrong_amount_of_evidence_is_refused(evidence):
    with pytest.raises(InvalidArgumentError, match="evidence"):
        HistoryUTreeMethod(evidence=evidence)
