"""An argument of another kind is refused by its name at once, wherever it is given."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import LogFormat
from eutree.errors import InvalidArgumentError
from eutree.proof import plant_of, prove

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


def test_a_folder_of_a_log(tree):
    with pytest.raises(InvalidArgumentError, match="tensorboard must be a folder, got 4"):
        eutree.learn(TASK, episodes=1, tensorboard=4)


def test_a_proof(tree):
    plant = plant_of(eutree.EnvironmentSpec("CartPole-v1"))
    with pytest.raises(InvalidArgumentError, match="policy must be a TreePolicy, got 5"):
        prove(5, plant)
    with pytest.raises(InvalidArgumentError, match="question must be a EpisodeProperty, got 5"):
        prove(tree, plant, 5)


@pytest.mark.parametrize("name", ["drop", "nominal", "actions"])
def test_what_a_log_lists_is_no_text(name):
    with pytest.raises(InvalidArgumentError, match=f"{name} must be a list, got the text 'mode'"):
        LogFormat(**{name: "mode"})
    assert LogFormat(missing=0) == LogFormat(missing="0")


def test_a_message_about_many_numbers_is_one_line():
    with pytest.raises(
        InvalidArgumentError, match=r"seed must be an integer .* got array"
    ) as raised:
        eutree.record("CartPole-v1", lambda seen: 0, seed=np.zeros((3, 3)))
    assert "\n" not in str(raised.value)
    wide = gymnasium.spaces.MultiDiscrete([[2, 3], [4, 5]])
    env = gymnasium.wrappers.TransformObservation(
        gymnasium.make("CartPole-v1"), lambda seen: np.zeros((2, 2), int), wide
    )
    with pytest.raises(InvalidArgumentError, match="must have a flat Box") as raised:
        eutree.record(env, lambda seen: 0)
    assert "\n" not in str(raised.value)
