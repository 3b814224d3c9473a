"""What model-based planning says of itself: returns of the incumbent, doubt about who acts."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.compression import compress
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.learners import DEFAULT, PlanningMethod, Problem, Start, Step
from eutree.learners.episode_buffer import transitions_of
from eutree.schema import Schema
from tests.worlds import Walk, learned_to_walk

QUICK = replace(DEFAULT, planner=replace(DEFAULT.planner, n_episodes=40, min_episodes=5))


@pytest.fixture(scope="module")
def learner():
    return learned_to_walk(QUICK, phases=4)


def test_values_are_the_returns_to_go_of_the_incumbents_own_episodes(learner):
    found, history = learner.decisions(), learner.history
    known = found.statistics
    leaves = found.tree.leaf_index(history.observations)
    returns = np.zeros(history.size)
    for row in range(history.size - 1, -1, -1):
        follows = row + 1 < history.size and history.continues[row + 1]
        returns[row] = history.rewards[row] + (returns[row + 1] if follows else 0.0)
    mine = np.isin(history.episodes, learner.plan.incumbent_episodes)
    assert mine.any()
    for leaf in range(found.tree.n_leaves):
        for action in range(2):
            rows = mine & (leaves == leaf) & (history.actions == action)
            assert known.visits[leaf, action] == rows.sum()
            if rows.any():
                assert known.values[leaf, action] == pytest.approx(returns[rows].mean())
            else:
                assert np.isnan(known.values[leaf, action])
            if rows.sum() > 1:
                error = returns[rows].std(ddof=1) / np.sqrt(rows.sum())
                assert known.deviations[leaf, action] == pytest.approx(error)


def test_a_learner_without_episodes_of_its_own_shows_no_values():
    assert QUICK.start(Walk.problem, Start()).decisions().statistics is None


def test_weights_by_values_are_refused_where_no_values_decide(learner):
    """q-gap read a table over leaves that had not decided."""
    policy = learner.decisions().policy(Walk.problem)
    with pytest.raises(InvalidArgumentError, match='weights must be "visits" for a policy without'):
        compress(policy, learner.history.observations, max_disagreement=0.1, weights="q-gap")


def test_it_has_one_discount_and_only_choices_of_its_own():
    names = set(PlanningMethod.__dataclass_fields__)
    assert names >= {"planner", "exploration", "gathering_episodes", "max_transitions"}
    assert not names & {"discount", "splitter", "significance", "target", "untried_value"}
    assert PlanningMethod().planner.discount == 1.0


def test_an_episode_without_a_row_has_no_number():
    """Returns were those of other episodes, or of none: "index 26 is out of bounds"."""
    schema = Schema.anonymous(1, 2)

    def shown(n, reward):
        places, actions = np.linspace(0.0, 1.0, n + 1)[:, None], np.arange(n) % 2
        return Episode(places, actions, np.full(n, reward), terminated=n > 0, truncated=False)

    start = Start(episodes=(shown(5, 1.0), shown(0, 0.0), shown(5, 2.0)))
    learner = replace(DEFAULT, max_transitions=100).start(Problem(schema), start)
    for n, reward in ((10, 1.0), (150, 1.0), (10, 5.0)):
        learner.start_episode(np.zeros(1), np.random.default_rng(0))
        for k in range(n):
            learner.observe(Step(0, reward, np.array([0.2 * k]), k == n - 1, False))
        if n > 100:
            with pytest.warns(UserWarning, match="nothing can be learned from it"):
                learner.end_episode()
        else:
            learner.end_episode()
    earned = transitions_of(learner.history, 2).episode_returns
    assert earned.tolist() == [5.0, 10.0, 10.0, 50.0]
    assert learner.plan.demonstrations == 2
    assert max(learner.plan.incumbent_episodes) < earned.size
