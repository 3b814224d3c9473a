"""Common episodes: those that are not run again are those that would have come out the same."""

from dataclasses import replace
from unittest import mock

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.compression import RealEpisodes
from eutree.compression.playing import CommonEpisodes, Ground, Outcome
from eutree.compression.searching import FrontSearch
from eutree.data import derive
from eutree.interaction.making import Recipe
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from tests.compression.policies import random_policy
from tests.corridor import Corridor, striped
from tests.little_search import little_search

BUSY = striped(0, 2.0, 1, 3.0, 0, 5.0, 1)
EVASION = gymnasium.make("eutree/Evasion2-v0")


def evasive(seed, n_leaves=8):
    """Return a random tree that reads an observation of 2-Evasion, about where it is."""
    policy = random_policy(seed, n_leaves, n_actions=2)
    return replace(policy, tree=replace(policy.tree, threshold=1.5 * policy.tree.threshold))


def outcomes(ground, present, challengers, n=40):
    common = CommonEpisodes(ground, n)
    common.redraw(present)
    return common, common.outcomes(challengers)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_not_run_again_would_have_been_the_same(seed):
    challengers = [evasive(seed), evasive(seed + 10), evasive(seed, 3)]
    common, found = outcomes(Ground(EVASION, seed), evasive(seed), challengers)
    steps = common.ground.steps
    assert (found[0].returns == common.outcome.returns).all()
    for challenger, outcome in zip(challengers, found, strict=True):
        common.run(challenger)
        assert (common.outcome.returns == outcome.returns).all()
        assert (common.outcome.successes == outcome.successes).all()
    assert common.ground.steps > steps


class SaysSuccess(gymnasium.Wrapper):
    """Reports success where there is one, and nothing where there is none."""

    def step(self, action):
        observation, reward, terminated, truncated, info = super().step(action)
        if not info.get("is_success"):
            info.pop("is_success", None)
        return observation, reward, terminated, truncated, info


def test_who_says_nothing_of_failures_has_no_share_of_successes():
    """All that a challenger failed counted as the successes of the present tree: 100 %."""
    common, _ = outcomes(Ground(SaysSuccess(EVASION), 0), evasive(1), [])
    returns = common.outcome.returns
    common.outcome = Outcome(returns, np.ones(returns.size, dtype=bool))
    alike, other = common.outcomes([evasive(1), evasive(2)])
    assert alike.successes.all()
    assert other.successes is None


def test_what_is_not_run_again_keeps_its_successes_where_failures_are_silent(monkeypatch):
    """Five failures that nobody reported made failures of all forty."""
    common, _ = outcomes(Ground(SaysSuccess(EVASION), 0), evasive(1), [])
    returns = common.outcome.returns
    common.outcome = Outcome(returns, np.ones(returns.size, dtype=bool))
    monkeypatch.setattr(common, "_departs", lambda challenger, n: np.arange(5))
    (other,) = common.outcomes([evasive(2)])
    assert other.successes.tolist() == [False] * 5 + [True] * 35


def test_a_challenger_that_decides_alike_costs_no_step():
    common, _ = outcomes(Ground(EVASION, 0), evasive(1), [])
    steps = common.ground.steps
    common.outcomes([evasive(1)])
    assert common.ground.steps == steps


@pytest.mark.parametrize("history", [0, 1])
def test_side_by_side_one_by_one_and_elsewhere_are_the_same(history):
    """A wrapper hides the vector form; other processes make the environment themselves."""
    policy = evasive(3)
    if history:
        tree = DecisionTree.single_leaf(6).split(0, 0, 5.0).split(1, 4, 3.0)
        policy = TreePolicy(tree, np.array([1, 0, 1]), Schema.anonymous(6, 2), history=1)
    challengers = [policy, replace(policy, actions=1 - policy.actions)]
    hidden = gymnasium.Wrapper(EVASION)
    recipe = Recipe.of(EnvironmentSpec("eutree/Evasion2-v0"))
    grounds = [Ground(EVASION, 7), Ground(hidden, 7), Ground(hidden, 7, recipe, 2)]
    assert [one.side_by_side for one in grounds] == [True, False, False]
    told = []
    for ground in grounds:
        common, found = outcomes(ground, policy, challengers, 12)
        order = np.lexsort((common.traces.features[:, 0], common.traces.episode))
        told.append((found, common.traces.features[order], ground.steps))
    for found, features, steps in told[1:]:
        for one, other in zip(found, told[0][0], strict=True):
            assert (one.returns == other.returns).all()
            assert (one.successes == other.successes).all()
        assert features.shape == told[0][1].shape
        assert steps == told[0][2]
        assert np.allclose(np.sort(features, axis=0), np.sort(told[0][1], axis=0))


def test_two_draws_have_no_start_in_common():
    common = CommonEpisodes(Ground(EVASION, 0), 20)
    common.redraw(evasive(0))
    first = common.traces.features
    common.redraw(evasive(0))
    assert not set(map(bytes, first[:20])) & set(map(bytes, common.traces.features[:20]))


def test_the_search_finds_the_tree_that_is_right():
    """Five stripes too many; what is right has two leaves, with the cut at 5."""
    policy = striped(0, 2.0, 1, 3.0, 0, 4.6, 1, 7.0, 0, 7.5, 1, 9.0, 1)
    search = FrontSearch([policy], CommonEpisodes(Ground(Corridor(), 1), 60), 10**9)
    search.run()
    two = search.found[2][0]
    assert two.actions.tolist() == [0, 1]
    assert two.tree.threshold[0] == pytest.approx(5.0, abs=0.3)
    assert set(search.found) <= set(range(2, policy.n_leaves + 1))
    assert all(one.n_leaves == size for size, found in search.found.items() for one in found)


def test_a_budget_ends_the_search():
    ground = Ground(Corridor(), 1)
    search = FrontSearch([BUSY], CommonEpisodes(ground, 60), 1)
    search.run()
    assert search.found == {}


def test_the_best_of_at_most_so_many_leaves_is_never_worse_because_it_is_smaller():
    """Asked for at most three leaves, the tree of two that is right is given."""
    small, report = eutree.compress(BUSY, np.empty((0, 1)), env=Corridor(), max_leaves=3, seed=2)
    assert (small.n_leaves, report.by) == (2, "episodes")
    assert report.mean_return_after > report.mean_return_before
    sizes = [one.policy.n_leaves for one in report.front]
    assert sizes == [4, 2]  # the input first; what two leaves do as well is left out
    assert report.front[1].mean_return == report.mean_return_after


class Eight(gymnasium.Env):
    """Eight stripes with an action each; the first four come more often, and need it less."""

    observation_space = gymnasium.spaces.Box(0.0, 8.0, (1,), dtype=np.float64)
    action_space = gymnasium.spaces.Discrete(8)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        often = self.np_random.random() < 0.6
        self.place = 4.0 * self.np_random.random() + (0.0 if often else 4.0)
        return np.array([self.place]), {}

    def step(self, action):
        wrong = 0.9 if self.place < 4.0 else 0.0
        return np.array([self.place]), 1.0 if action == int(self.place) else wrong, True, False, {}


def test_a_limit_far_below_is_kept_by_playing_whatever_each_size_loses():
    """The search ended with the first size that loses; labels then kept what is frequent.

    Two leaves are best in the last four stripes: 0.54 + 0.2, in place of 0.57.
    """
    tree = DecisionTree.single_leaf(1)
    for cut in range(1, 8):
        tree = tree.split(tree.n_leaves - 1, 0, float(cut))
    policy = TreePolicy(tree, np.arange(8), Schema.anonymous(1, 8))
    rows = 8.0 * np.random.default_rng(0).random((400, 1)) ** 1.5
    env = RealEpisodes(Eight(), episodes=40, searches=True)
    small, report = eutree.compress(policy, rows, env=env, max_leaves=2, seed=1)
    assert (small.n_leaves, report.by) == (2, "episodes")
    assert eutree.evaluate(small, Eight(), episodes=2000).mean_return > 0.7


def test_a_limit_of_leaves_holds_where_the_steps_end_before_a_small_tree_is_found():
    """It used to hand the tree back as it was; labels say which nodes to cut, though."""
    policy = striped(0, 2.0, 1, 3.0, 0, 4.6, 1, 7.0, 0, 7.5, 1, 9.0, 1)
    with mock.patch.multiple("eutree.compression.front", STEPS=1, FEW_STEPS=1):
        small, report = eutree.compress(policy, np.empty((0, 1)), env=Corridor(), max_leaves=3)
    assert small.n_leaves <= 3 < policy.n_leaves
    assert (report.method, report.by) == ("budget", "labels")


@pytest.mark.parametrize("episodes", [2, 20])
def test_a_search_plays_less_where_few_episodes_judge(episodes):
    """Of two starts a quarter is none; at least twelve are played."""
    env = RealEpisodes(Corridor(), episodes=episodes, searches=True)
    small, report = eutree.compress(BUSY, np.empty((0, 1)), env=env)
    many = eutree.compress(BUSY, np.empty((0, 1)), env=replace(env, episodes=200))[1]
    assert small.n_leaves < BUSY.n_leaves
    assert report.environment_steps < many.environment_steps


@pytest.mark.parametrize("n_jobs", [None, 2])
def test_trees_that_ask_for_what_is_derived_play_where_nobody_declared_it(n_jobs):
    falls = eutree.experts.EXPERTS["CartPole-v1"]["fall"]
    demos = eutree.record("CartPole-v1", falls, episodes=3, seed=0)
    policy = eutree.fit_expert_tree(derive(demos, ['lean = angle + "turn rate"']))
    assert policy.tree.n_features == 5
    episodes = RealEpisodes(EnvironmentSpec("CartPole-v1"), episodes=4, n_jobs=n_jobs,
                            searches=True)  # fmt: skip
    with little_search():
        small, report = eutree.compress(policy, np.empty((0, 5)), max_leaves=2, env=episodes)
    assert small.n_leaves <= 2
    assert report.front
