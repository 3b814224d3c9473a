"""Planning in either world model."""

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.envs.experts import follow_the_fall
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.learners.choices import with_choices
from eutree.learners.model_planning import PlanningMethod
from eutree.policy_search import planner as module
from eutree.policy_search.improvement import Improvement
from eutree.policy_search.planner import Plan, Planner
from eutree.world_model import Transitions, leaf_node
from eutree.world_model.action_trees import single_action
from eutree.world_model.ensemble import EnsembleSettings

QUICK = EnsembleSettings(members=2, hidden=16, batch=64, updates=1200, memory=True, rate=3e-3)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(module, "_NETWORKS", QUICK)


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


@pytest.mark.parametrize("world_model", ["trees", "neural"])
def test_a_challenger_is_found_in_either_model(world_model):
    planner = Planner(
        world_model=world_model, n_steps=4_000, improvement=Improvement(deviations=1000)
    )
    plan = planner.plan(Plan(single_action(0)), known(), np.random.default_rng(1))
    assert plan.challenger is not None
    assert plan.model_steps > 0
    for place, action in ((0.2, 0), (0.8, 1)):
        for elsewhere in (0.2, 0.8):
            at = leaf_node(plan.challenger, 0, np.array([place, elsewhere]))
            assert plan.challenger.action[at] == action


def test_the_choice_is_checked():
    with pytest.raises(UnknownNameError, match="world_model"):
        Planner(world_model="crystal")
    with pytest.raises(InvalidArgumentError, match="discount must be 1"):
        Planner(world_model="neural", discount=0.9)
    chosen = with_choices(PlanningMethod(), {"world_model": "neural"})
    assert chosen.planner.world_model == "neural"


def test_a_run_plans_in_networks_to_the_same_bytes():
    env = gymnasium.make("CartPole-v1")
    shown = eutree.record(env, follow_the_fall, episodes=3)
    method = PlanningMethod(
        planner=Planner(world_model="neural", n_steps=1_000, improvement=Improvement(deviations=50))
    )
    one, other = (
        eutree.learn(
            env, demonstrations=shown, method=method, episodes=20, evaluation_episodes=1, seed=2
        )
        for _ in range(2)
    )
    assert one.policy.to_bytes() == other.policy.to_bytes()
