"""Episodes of a search: run once, known to trees that decide alike, and within the budget."""

import numpy as np
import pytest

from eutree.data import Episode
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.training.raced_episodes import STARTS, Block, RacedEpisodes
from eutree.trees import DecisionTree

ROOMY = Block(number=2, limit=10_000)


def tree_of(threshold: float) -> TreePolicy:
    tree = DecisionTree.single_leaf(1).split(leaf=0, feature=0, threshold=threshold)
    return TreePolicy(tree, np.array([0, 1]), Schema.anonymous(1, 2))


def episode_of(policy: TreePolicy, start: int) -> Episode:
    """Return an episode of three steps at places that follow from the start."""
    places = (start % STARTS) + np.arange(4.0)[:, np.newaxis]
    actions = policy.actions[policy.tree.leaf_index(places[:-1])]
    return Episode(places, actions, np.ones(3), True, False, is_success=bool(actions[0]))


def drive(running, asked):
    """Run what is asked for; return the result."""
    try:
        policy, start = next(running)
        while True:
            asked.append(start)
            policy, start = running.send(episode_of(policy, start))
    except StopIteration as end:
        return end.value


@pytest.fixture
def raced() -> RacedEpisodes:
    return RacedEpisodes(3, grows=False)


def test_a_tree_runs_each_start_once(raced: RacedEpisodes) -> None:
    asked: list[int] = []
    first = drive(raced.of(tree_of(0.5), range(2), ROOMY), asked)
    again = drive(raced.of(tree_of(0.5), range(1, 3), ROOMY), asked)
    assert asked == [2 * STARTS, 2 * STARTS + 1, 2 * STARTS + 2]
    assert again[0] is first[1]
    assert raced.steps == 9


def test_what_another_tree_ran_deciding_alike_is_known(raced: RacedEpisodes) -> None:
    asked: list[int] = []
    drive(raced.of(tree_of(0.5), range(2), ROOMY), asked)
    drive(raced.of(tree_of(0.6), range(2), ROOMY), asked)  # alike at whole numbers
    assert len(asked) == 2
    drive(raced.of(tree_of(1.5), range(2), ROOMY), asked)
    assert len(asked) == 4


def test_an_episode_begins_only_if_the_longest_fits(raced: RacedEpisodes) -> None:
    asked: list[int] = []
    assert drive(raced.of(tree_of(0.5), range(2), Block(0, limit=5)), asked) is None
    assert (asked, raced.steps) == ([0], 3)


def test_another_block_has_other_answers(raced: RacedEpisodes) -> None:
    asked: list[int] = []
    drive(raced.of(tree_of(0.5), range(1), Block(0, 99)), asked)
    raced.leave_block()
    drive(raced.of(tree_of(0.5), range(1), Block(1, 99)), asked)
    assert asked == [0, STARTS]


def test_success_is_compared_start_by_start(raced: RacedEpisodes) -> None:
    eager, late = tree_of(-1.0), tree_of(0.5)  # action 1 at start 0, or only from 1 on
    for policy in (eager, late):
        drive(raced.of(policy, range(3), ROOMY), [])
    assert raced.succeeds_less(eager, late)
    assert not raced.succeeds_less(late, eager)


def test_what_was_run_after_the_state_is_taken_up_and_not_run_again(raced: RacedEpisodes) -> None:
    policy = tree_of(0.5)
    episodes = drive(raced.of(policy, range(3), ROOMY), [])
    again, asked = RacedEpisodes(1, grows=True), []
    again.take_back(episodes, 1, policy, [0])
    assert (again.steps, again.longest, again.stored) == (3, 3, tuple(episodes[1:]))
    assert drive(again.of(policy, range(4), ROOMY), asked)[:3] == episodes
    assert asked == [2 * STARTS + 3]
