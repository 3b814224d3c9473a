"""Teachers where actions are masked: what is at stake, and what the tree is told of it."""

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.distillation import DistillationSettings, stakes_of
from eutree.errors import InvalidArgumentError
from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree

STAY, RIGHT, LEFT = range(3)
FEW = DistillationSettings(iterations=3, episodes=3, validation_episodes=4, max_leaves=6)


class Line(gymnasium.Env):
    """A place on a line, to be at 0; nobody may stay where it is above 0, if that is masked."""

    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (1,), np.float64)
    action_space = gymnasium.spaces.Discrete(3)

    def __init__(self, masked=True):
        self.masked, self.place, self.steps = masked, 0.0, 0

    def info(self):
        allowed = np.array([self.place <= 0.0, True, True])
        return {"action_mask": allowed.astype(np.int8)} if self.masked else {}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.steps = float(self.np_random.uniform(-5.0, 5.0)), 0
        return np.array([self.place]), self.info()

    def step(self, action):
        assert not self.masked or self.info()["action_mask"][action]
        self.place = float(np.clip(self.place + (0.0, 0.5, -0.5)[int(action)], -9.0, 9.0))
        self.steps += 1
        return np.array([self.place]), -abs(self.place), False, self.steps >= 20, self.info()


class Values:
    """Goes to 0, by values; that of what is forbidden is given."""

    def __init__(self, forbidden):
        self.forbidden = forbidden

    def predict(self, observation):
        return LEFT if observation[0] > 0.0 else RIGHT

    def action_values(self, rows):
        place = rows[:, 0]
        staying = np.where(place > 0.0, self.forbidden, 0.0)
        return np.stack([staying, -place, place], axis=1)


@pytest.mark.parametrize("forbidden", [-1e6, 1e6, -np.inf, np.nan])
def test_the_value_of_what_is_forbidden_changes_nothing(forbidden) -> None:
    """A large one made half of the observations count for nothing; -inf was refused."""
    settings = DistillationSettings(
        method="viper", iterations=3, episodes=3, validation_episodes=10, max_leaves=6
    )
    tree, report = eutree.distill(Values(0.0), Line(), settings, seed=1)
    again, other = eutree.distill(Values(forbidden), Line(), settings, seed=1)
    assert tree == again
    assert report == other
    assert report.weighted


def test_stakes_are_those_of_allowed_actions() -> None:
    rows, allowed = np.array([[-3.0], [4.0]]), np.array([[True] * 3, [False, True, True]])
    at_stake = stakes_of(Values(-np.inf), None, 3)
    assert at_stake(rows, allowed).tolist() == [6.0, 8.0]
    with pytest.raises(InvalidArgumentError, match="one that is not finite"):
        at_stake(rows)
    with pytest.raises(InvalidArgumentError, match=r"got shape \(2, 2\)"):
        stakes_of(None, lambda o: np.zeros((len(o), 2)), 3)(rows, allowed)


def test_stakes_by_leaves_are_those_of_allowed_actions() -> None:
    schema = Schema((Feature("x"),), ("stay", "right", "left"))
    values = np.array([[0.0, 5.0, 3.0], [9.0, 2.0, 6.0]])
    leaves = LeafStatistics(np.ones((2, 3), dtype=np.int64), values, np.zeros((2, 3)))
    policy = TreePolicy(
        DecisionTree.single_leaf(1).split(0, 0, 0.0), np.array([1, 0]), schema, leaves=leaves
    )
    rows = np.array([[-1.0], [1.0]])
    at_stake = stakes_of(policy, None, 3)
    assert at_stake(rows).tolist() == [5.0, 7.0]
    allowed = np.array([[False, True, True], [False, True, True]])
    assert at_stake(rows, allowed).tolist() == [2.0, 4.0]


@pytest.mark.parametrize("method", ["dagger", "viper"])
def test_a_tree_that_acted_under_masks_says_so_whatever_was_shown(method) -> None:
    """It was not ``masked`` where the demonstrations were recorded without masks."""
    shown = eutree.record(Line(masked=False), Values(0.0), episodes=3, seed=1)
    settings = DistillationSettings(
        method=method, iterations=3, episodes=3, validation_episodes=4, max_leaves=6
    )
    for known in (shown, None):
        tree, _ = eutree.distill(Values(0.0), Line(), settings, demonstrations=known, seed=1)
        assert tree.masked
        assert "_allowed" in eutree.export.to_c(tree)
    free, _ = eutree.distill(Values(0.0), Line(masked=False), FEW, demonstrations=shown, seed=1)
    assert not free.masked


def test_a_teacher_that_remembers_actions_has_no_stakes_in_observations():
    """VIPER asked it for stakes of rows without what was done before, and failed."""
    leaves = LeafStatistics(np.ones((1, 2), dtype=np.int64), np.eye(1, 2), np.zeros((1, 2)))
    schema = Schema((Feature("x"),), ("a", "b"))
    for history, actions in ((1, 0), (0, 1)):
        known = schema.with_history(history, actions)
        one = DecisionTree.single_leaf(len(known.features))
        past = {"history": history, "past_actions": actions}
        teacher = TreePolicy(one, np.array([0]), known, leaves=leaves, **past)
        assert stakes_of(teacher, None, 2) is None
    present = TreePolicy(DecisionTree.single_leaf(1), np.array([0]), schema, leaves=leaves)
    assert stakes_of(present, None, 2)(np.zeros((3, 1))).tolist() == [1.0, 1.0, 1.0]
