"""Planning in a world model of trees."""

from types import SimpleNamespace

import numpy as np
import pytest

from eutree.policy_search.improvement import Improvement
from eutree.policy_search.planner import Planned, Planner
from eutree.world_model import Transitions, leaf_node
from eutree.world_model.action_trees import packed
from eutree.world_model.rollouts import Gain


def known():
    """A walk in the unit square; what action 1 earns depends on the first feature alone.

    Above the middle it earns 5, below it costs 5; action 0 earns nothing.
    """
    generator = np.random.default_rng(0)
    n, length = 200, 10
    x = np.empty((n, length + 1, 2))
    x[:, 0] = generator.random((n, 2))
    for t in range(length):
        x[:, t + 1] = np.clip(x[:, t] + 0.2 * generator.standard_normal((n, 2)), 0.0, 1.0)
    before, after = x[:, :-1].reshape(-1, 2), x[:, 1:].reshape(-1, 2)
    actions = generator.integers(2, size=n * length)
    rewards = np.where(actions == 1, np.where(before[:, 0] > 0.5, 5.0, -5.0), 0.0)
    ends = np.zeros(n * length, dtype=np.bool_)
    return Transitions(before, actions, rewards, after, ends, np.repeat(np.arange(n), length), 2)


def test_a_challenger_is_found_in_model_trees():
    planner = Planner(n_steps=4_000, improvement=Improvement(deviations=1000))
    plan = planner.plan(Planned(packed(0)), known(), np.random.default_rng(1))
    assert plan.challenger is not None
    assert plan.model_steps > 0
    for place, action in ((0.2, 0), (0.8, 1)):
        for elsewhere in (0.2, 0.8):
            at = leaf_node(plan.challenger, 0, np.array([place, elsewhere]))
            assert plan.challenger.action[at] == action


@pytest.mark.parametrize(
    ("n_actions", "steps"), [(2, 6000), (3, 6000), (4, 4000), (7, 2000), (13, 1000)]
)
def test_many_actions_are_tried_no_more_often_than_two_others(n_actions, steps):
    """The cost of planning grew with the number of actions."""
    asked = []

    def deviations(chosen):
        asked.append(chosen.size)
        return np.zeros((chosen.size, n_actions))

    rollouts = SimpleNamespace(
        n_actions=n_actions,
        n_steps=50_000,
        n_episodes=100,
        generator=np.random.default_rng(0),
        observations=np.zeros((50_000, 1)),
        node=np.zeros(50_000, dtype=np.int64),
        deviations=deviations,
    )
    Improvement()._deviations(rollouts)
    assert asked == [steps]


@pytest.mark.parametrize(("length", "deserves"), [(20, False), (399, False), (400, True)])
def test_a_trial_of_long_episodes_is_over_after_fewer(length, deserves):
    """Ten episodes ahead by a little: too few of 20 steps, but as many steps as 200 of those."""
    returns = np.append(np.tile([1.0, 3.0], 5), np.tile([1.1, 3.1], 5))
    data = SimpleNamespace(episode_returns=returns, episode_lengths=np.full(20, length))
    plan = Planned(
        packed(0),
        challenger=packed(1),
        incumbent_episodes=tuple(range(10)),
        challenger_episodes=tuple(range(10, 20)),
    )
    model = SimpleNamespace(run=lambda tree: None, gain=lambda tree: Gain(1.0, 0.1, True))
    assert Planner()._deserves(plan, plan.challenger, data, model) is deserves
