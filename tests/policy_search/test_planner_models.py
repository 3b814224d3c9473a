"""Planning in a world model of trees."""

import numpy as np

from eutree.policy_search.improvement import Improvement
from eutree.policy_search.planner import Planner, Rivals
from eutree.world_model import Transitions, leaf_node
from eutree.world_model.action_trees import single_action


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
    plan = planner.plan(Rivals(single_action(0)), known(), np.random.default_rng(1))
    assert plan.challenger is not None
    assert plan.model_steps > 0
    for place, action in ((0.2, 0), (0.8, 1)):
        for elsewhere in (0.2, 0.8):
            at = leaf_node(plan.challenger, 0, np.array([place, elsewhere]))
            assert plan.challenger.action[at] == action
