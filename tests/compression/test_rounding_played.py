"""Rounded thresholds that decide alike on all that was recorded, and otherwise in play."""

import gymnasium
import numpy as np
import pytest

from eutree.compression import RealEpisodes, compress
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree

CUT = 0.3123
RECORDED = np.array([[0.1], [0.25], [0.6], [0.9]])  # 0.3 sends them the same way


class Light(gymnasium.Env):
    """Ten looks at a light: going beyond the cut costs 1."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,), dtype=np.float64)
    action_space = gymnasium.spaces.Discrete(2)
    return_range = (-10.0, 0.0)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left, self.place = 10, self.np_random.random()
        return np.array([self.place]), {}

    def step(self, action):
        reward = -float(action != (self.place > CUT))
        self.place, self.left = self.np_random.random(), self.left - 1
        return np.array([self.place]), reward, self.left == 0, False, {}


POLICY = TreePolicy(
    DecisionTree.single_leaf(1).split(0, 0, CUT), np.array([0, 1]), Schema.anonymous(1, 2)
)


def threshold_of(policy):
    return float(np.nanmax(policy.tree.threshold))


def test_rounding_is_honoured_where_no_smaller_tree_is_found():
    """The exact thresholds came back, without a word."""
    real = RealEpisodes(Light(), margin=0.5, episodes=100)
    small, report = compress(POLICY, RECORDED, env=real, round_thresholds=True)
    assert (report.method, threshold_of(small)) == ("merge", 0.3)
    assert report.return_change.n == 100


def test_thresholds_that_play_differently_are_noticed():
    """All four recorded decisions are the same; about one episode in nine is not."""
    real = RealEpisodes(Light(), episodes=400)
    small, report = compress(POLICY, RECORDED, env=real, round_thresholds=True)
    assert (report.agreement, threshold_of(small)) == (1.0, 0.3)
    played = report.rounding
    assert played.episodes == 200
    assert 5 <= played.different <= 50
    assert played.exact == 0.0 > played.rounded == pytest.approx(-played.different / 200, abs=0.05)


def test_rounding_that_loses_more_than_the_margin_is_taken_back():
    real = RealEpisodes(Light(), margin=0.5, episodes=100)
    small, report = compress(POLICY, RECORDED, env=real, round_thresholds=0.5)
    assert threshold_of(small) == CUT
    assert not report.rounding.kept
    assert report.rounding.exact - report.rounding.rounded > 0.5


def test_rounding_alone_runs_no_evaluation():
    real = RealEpisodes(Light(), episodes=50, evaluates=False)
    _, report = compress(POLICY, RECORDED, env=real, round_thresholds=True)
    assert report.environment_steps == 2 * 50 * 10
    assert report.return_change is None
    _, exact = compress(POLICY, RECORDED, env=real)
    assert (exact.environment_steps, exact.rounding) == (0, None)
