"""An argument of another kind is refused by its name at once, wherever it is given."""

from pathlib import Path

import numpy as np
import pytest

import eutree
from eutree.errors import InvalidArgumentError

TASK = "eutree/Evasion2-v0"
SHOWN = eutree.Demonstrations.from_arrays(
    observations=np.array([[0.0], [1.0], [0.0], [1.0]]),
    actions=[0, 1, 0, 1],
    starts=[True] + [False] * 3,
)
ROWS = SHOWN.observations


@pytest.fixture(scope="module")
def tree() -> eutree.TreePolicy:
    """A tree, which compiles kernels: never while the tests are collected."""
    return eutree.fit_expert_tree(SHOWN)


@pytest.mark.parametrize("given", ["demos", [1, 2], None])
def test_demonstrations(given):
    expected = "demonstrations must be Demonstrations, got"
    for use in (
        lambda: eutree.fit_expert_tree(given),
        lambda: eutree.fit(given),
        lambda: eutree.learn(TASK, demonstrations=given or "", episodes=1),
        lambda: eutree.learn(None, demonstrations=given or ""),
        lambda: eutree.distill(lambda seen: 0, TASK, demonstrations=given or ""),
    ):
        with pytest.raises(InvalidArgumentError, match=expected):
            use()


@pytest.mark.parametrize("given", ["tree.json", Path("tree.json"), 5, lambda seen: 0])
def test_a_tree(tree, given):
    for use in (
        lambda: eutree.learn(TASK, expert=given, episodes=1),
        lambda: eutree.compress(given, ROWS),
        lambda: eutree.why(given, ROWS[0]),
        lambda: eutree.diff(tree, given),
        lambda: eutree.diff(given, tree),
        lambda: eutree.verify(given, "never action_1 when x0 <= 0"),
    ):
        with pytest.raises(InvalidArgumentError, match="must be a TreePolicy, got") as raised:
            use()
        assert ("TreePolicy.load reads that" in str(raised.value)) == ("tree.json" in str(given))


def test_settings_and_weights(tree):
    for use in (
        lambda: eutree.fit_expert_tree(SHOWN, settings={"min_objects": 3}),
        lambda: eutree.fit(SHOWN, settings={"min_objects": 3}, episodes=0),
    ):
        with pytest.raises(InvalidArgumentError, match="settings must be C45Settings, got"):
            use()
    with pytest.raises(InvalidArgumentError, match="settings must be DistillationSettings, got"):
        eutree.distill(lambda seen: 0, TASK, {"max_leaves": 3})
    with pytest.raises(InvalidArgumentError, match="weights must have 3 entries, got 2"):
        eutree.fit_expert_tree(SHOWN, weights=[1, 2])
    with pytest.raises(InvalidArgumentError, match="question must be a Property, got 5"):
        eutree.verify(tree, 5)


def test_a_budget_is_checked_where_it_is_made():
    with pytest.raises(InvalidArgumentError, match="steps must be an integer >= 1, got 0"):
        eutree.Budget(steps=0)
    with pytest.raises(InvalidArgumentError, match=r"minutes must be .*, got 'ten'"):
        eutree.Budget(minutes="ten")
