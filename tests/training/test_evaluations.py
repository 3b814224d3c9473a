"""The evaluations of a run: one run of the episodes for each policy, and success that is kept."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.training.evaluations import KNOWN, Arena, Evaluations, PlayedStarts
from eutree.training.phases import Plan, RunState
from eutree.trees import DecisionTree


def policy_of(action: int) -> TreePolicy:
    return TreePolicy(DecisionTree.single_leaf(1), np.array([action]), Schema.anonymous(1, 3))


class Evaluator:
    """Action k succeeds in k of four episodes in turn; notes what it was asked."""

    def __init__(self, reports=True):
        self.asked = []
        self._reports = reports

    def __call__(self, policy, starts, seed):
        self.asked.append((int(policy.actions[0]), seed))
        successes, n = np.array(starts) % 4 < policy.actions[0], len(starts)
        return Evaluation(
            successes.astype(float), np.ones(n), np.full(n, "end"),
            successes if self._reports else None,
        )  # fmt: skip


def arena_of(evaluator):
    return Arena(None, evaluator, None)


PLAN = Plan(evaluation_episodes=4)


def test_no_policy_plays_the_same_episodes_twice() -> None:
    found, evaluator = Evaluations(PLAN, RunState()), Evaluator()
    for action in (1, 1, 2, 1):
        found.add(policy_of(action), arena_of(evaluator))
    assert [action for action, _ in evaluator.asked] == [1, 2]
    assert len({seed for _, seed in evaluator.asked}) == 1
    assert [point.success_rate for point in found.curve] == [0.25, 0.25, 0.5, 0.25]


def test_a_policy_that_succeeds_less_is_noted_and_not_kept() -> None:
    state, evaluator = RunState(), Evaluator()
    found = Evaluations(replace(PLAN, keep_success=True), state)
    for action in (2, 1):
        found.add(policy_of(action), arena_of(evaluator))
    assert found.kept is not None
    assert (found.kept[0].actions.tolist(), found.kept[1]) == ([2], 2)
    assert [point.success_rate for point in found.curve] == [0.5, 0.5]
    refused = [event for event in state.events if event["event"] == "kept"]
    assert [(one["successes"], one["successes_refused"]) for one in refused] == [(2, 1)]


def test_success_is_compared_in_as_many_episodes() -> None:
    """One of one was no better than one of four: a run that was longer took a worse policy."""
    state, evaluator = RunState(), Evaluator()
    found = Evaluations(replace(PLAN, keep_success=True), state)
    found.kept = policy_of(2), 1  # of the one episode that a shorter run could afford
    found.add(policy_of(1), arena_of(evaluator))
    assert found.kept[0].actions.tolist() == [2]
    refused = [event for event in state.events if event["event"] == "kept"]
    assert [(one["successes"], one["successes_refused"]) for one in refused] == [(2, 1)]


def test_success_cannot_be_kept_where_none_is_reported() -> None:
    found = Evaluations(replace(PLAN, keep_success=True), RunState())
    with pytest.raises(InvalidArgumentError, match="keep_success needs an environment"):
        found.add(policy_of(1), arena_of(Evaluator(reports=False)))


def test_the_judgement_is_on_other_episodes_than_the_curve() -> None:
    state, evaluator = RunState(), Evaluator()
    found = Evaluations(PLAN, state)
    found.add(policy_of(2), arena_of(evaluator))
    found.judge(policy_of(1), policy_of(2), 5, arena_of(evaluator))
    assert found.judgement is not None
    assert (found.judgement.return_change, found.judgement.challengers) == (0.25, 5)
    assert len({seed for _, seed in evaluator.asked}) == 2
    assert state.at.judged
    assert state.whole is False  # the run says when the phase is over


def test_a_result_that_is_the_start_is_not_run() -> None:
    found, evaluator = Evaluations(PLAN, RunState()), Evaluator()
    found.judge(policy_of(1), policy_of(1), 5, arena_of(evaluator))
    assert (evaluator.asked, found.judgement.is_start) == ([], True)


def test_what_was_played_is_played_on_from_there_and_forgotten_when_it_is_old():
    played, evaluator = PlayedStarts(), Evaluator()
    arena = arena_of(evaluator)
    played.of(policy_of(1), range(4), 7, arena)
    assert played.of(policy_of(1), range(2, 6), 7, arena).returns.tolist() == [0, 0, 1, 0]
    assert (played.episodes, played.steps, len(evaluator.asked)) == (6, 6, 2)
    for seed in range(100, 100 + KNOWN):
        played.of(policy_of(1), range(2), seed, arena)
    assert played.known(policy_of(1), 7) == 0
    assert len(played.counts) == KNOWN


def test_what_a_stopped_run_has_to_play_again_is_counted_once():
    before, after, evaluator = PlayedStarts(), PlayedStarts(), Evaluator()
    before.of(policy_of(1), range(4), 7, arena_of(evaluator))
    after.counts = dict(before.counts)
    after.of(policy_of(1), range(4, 6), 7, arena_of(evaluator))
    assert (before.episodes + after.episodes, len(evaluator.asked)) == (6, 2)


def test_an_interruption_within_a_contest_leaves_no_trace_in_the_counts():
    """Its checkpoint had some episodes of the contest, and went on to another number of pairs."""
    found, evaluator = Evaluations(PLAN, RunState()), Evaluator()
    found.add(policy_of(1), arena_of(evaluator))
    before = dict(found.counts)

    def stopped(policy, starts, seed):
        if policy.actions[0] == 2:
            raise KeyboardInterrupt
        return evaluator(policy, starts, seed)

    with pytest.raises(KeyboardInterrupt):
        found.judge(policy_of(1), policy_of(2), 0, arena_of(stopped))
    assert found.counts == before
    assert len(before) == 1
    assert len(found.played.counts) == 2
