"""The evaluations of a run: one run of the episodes for each policy, and success that is kept."""

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.training.evaluations import Arena, Evaluations
from eutree.training.phases import Plan, RunState
from eutree.trees import DecisionTree


def policy_of(action: int) -> TreePolicy:
    return TreePolicy(DecisionTree.single_leaf(1), np.array([action]), Schema.anonymous(1, 3))


class Evaluator:
    """Action k succeeds in k of four episodes; notes what it was asked."""

    def __init__(self, reports=True):
        self.asked = []
        self._reports = reports

    def __call__(self, policy, seed):
        self.asked.append((int(policy.actions[0]), seed))
        successes = np.arange(4) < policy.actions[0]
        return Evaluation(
            successes.astype(float), np.ones(4), np.full(4, "end"),
            successes if self._reports else None,
        )  # fmt: skip


def arena_of(evaluator):
    return Arena(None, evaluator, lambda policy, starts, seed: evaluator(policy, seed), None)


def test_a_policy_evaluated_twice_in_a_row_runs_once_on_the_same_episodes() -> None:
    found, evaluator = Evaluations(Plan(), RunState()), Evaluator()
    for action in (1, 1, 2):
        found.add(policy_of(action), evaluator)
    assert [action for action, _ in evaluator.asked] == [1, 2]
    assert len({seed for _, seed in evaluator.asked}) == 1
    assert [point.success_rate for point in found.curve] == [0.25, 0.25, 0.5]


def test_a_policy_that_succeeds_less_is_noted_and_not_kept() -> None:
    state, evaluator = RunState(), Evaluator()
    found = Evaluations(Plan(keep_success=True), state)
    for action in (2, 1):
        found.add(policy_of(action), evaluator)
    assert found.kept is not None
    assert (found.kept[0].actions.tolist(), found.kept[1]) == ([2], 2)
    assert [point.success_rate for point in found.curve] == [0.5, 0.5]
    refused = [event for event in state.events if event["event"] == "kept"]
    assert [(one["successes"], one["successes_refused"]) for one in refused] == [(2, 1)]


def test_success_cannot_be_kept_where_none_is_reported() -> None:
    found = Evaluations(Plan(keep_success=True), RunState())
    with pytest.raises(InvalidArgumentError, match="keep_success needs an environment"):
        found.add(policy_of(1), Evaluator(reports=False))


def test_the_judgement_is_on_other_episodes_than_the_curve() -> None:
    state, evaluator = RunState(), Evaluator()
    found = Evaluations(Plan(), state)
    found.add(policy_of(2), evaluator)
    found.judge(policy_of(1), policy_of(2), 5, arena_of(evaluator))
    assert found.judgement is not None
    assert (found.judgement.return_change, found.judgement.challengers) == (0.25, 5)
    assert len({seed for _, seed in evaluator.asked}) == 2
    assert state.at.judged
    assert state.whole is False  # the run says when the phase is over


def test_a_result_that_is_the_start_is_not_run() -> None:
    found, evaluator = Evaluations(Plan(), RunState()), Evaluator()
    found.judge(policy_of(1), policy_of(1), 5, arena_of(evaluator))
    assert (evaluator.asked, found.judgement.is_start) == ([], True)
