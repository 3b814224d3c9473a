"""Environments that report success at some ends only: where they are silent, nothing succeeded."""

import numpy as np
import pytest

from eutree.evaluation import Evaluation, against
from eutree.evaluation.evaluation import known_successes


def evaluation(successes, returns=1.0):
    n = 4
    return Evaluation(np.full(n, returns), np.ones(n), np.full(n, "end"), successes)


@pytest.mark.parametrize(
    ("reported", "known"),
    [
        ((None, None), None),
        ((True, None), [True, False]),
        ((None, False), [False, False]),
        ((True, False), [True, False]),
    ],
)
def test_an_end_that_says_nothing_was_no_success_where_others_say_something(reported, known):
    found = known_successes(reported)
    assert found is None if known is None else found.tolist() == known


def test_parts_that_say_nothing_are_failures_beside_those_that_do():
    parts = [evaluation(None), evaluation(np.ones(4, bool))]
    assert Evaluation.join(parts).success_rate == 0.5
    assert Evaluation.join([evaluation(None)] * 2).success_rate is None


def test_a_policy_that_always_times_out_succeeds_less_often():
    """Its rate was unknown, and so no loss: 100 % could turn into 0 % unnoticed."""
    found = against(evaluation(None, 2.0), evaluation(np.ones(4, bool)))
    assert found.success_change == -1.0
    assert against(evaluation(None), evaluation(None)).success_change is None
