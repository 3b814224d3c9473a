"""The example of two tanks: its contract, its water, its mediocre teacher."""

import itertools

import gymnasium
import numpy as np
import pytest
from examples.two_tanks import AREA, EPISODE_STEPS, STEP, FloatSwitch, TwoTanks, method_for
from gymnasium.utils.env_checker import check_env

import eutree

PUMP_OFF_VALVE_SHUT, PUMP_ON_VALVE_SHUT, PUMP_ON_VALVE_OPEN = 0, 2, 3


@pytest.fixture
def env():
    return gymnasium.make("TwoTanks-v0")


@pytest.mark.filterwarnings("ignore:.*render:UserWarning", "ignore:.*WARN.*:UserWarning")
def test_it_keeps_gymnasiums_contract():
    check_env(TwoTanks(), skip_render_check=True)


def test_what_the_valve_lets_through_is_what_the_upper_tank_loses(env):
    """With the pump off, both levels fall together by what is drawn, and by nothing else."""
    env.reset(seed=3)
    inner = env.unwrapped
    for _ in range(20):
        before, demand = inner._levels.copy(), inner._demand
        observation, *_ = env.step(1)
        lost = float(np.dot(before - observation[:2], AREA))
        assert lost == pytest.approx(STEP * demand, abs=STEP * 0.004)
        assert observation[0] < before[0] + 1e-12


def test_a_pump_against_a_shut_valve_runs_over_and_costs(env):
    env.reset(seed=0)
    rewards = [env.step(PUMP_ON_VALVE_SHUT)[1] for _ in range(EPISODE_STEPS)]
    assert env.unwrapped._levels[0] == 2.0
    assert rewards[-1] < -5.0


def test_the_same_seed_gives_the_same_episode(env):
    found = []
    for _ in range(2):
        observation, _ = env.reset(seed=8)
        steps = [env.step(PUMP_ON_VALVE_OPEN) for _ in range(30)]
        found.append([observation.tolist(), *[(o.tolist(), r) for o, r, *_ in steps]])
    assert found[0] == found[1]


def test_the_float_switch_is_mediocre(env):
    """Better by far than leaving all off, worse by far than keeping the upper tank full."""

    class Full(FloatSwitch):
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            of = np.asarray(observation)
            return (2 * (of[..., 0] < 1.3) + (of[..., 1] < of[..., 4])).astype(np.int64), state

    class Off(FloatSwitch):
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.full(np.shape(observation)[:-1], PUMP_OFF_VALVE_SHUT), state

    returns = [
        eutree.evaluate(policy, env, episodes=40, seed=5).returns
        for policy in (Off(), FloatSwitch(), Full())
    ]
    for worse, better in itertools.pairwise(returns):
        gain = better - worse
        assert gain.mean() > 3.0 * gain.std() / np.sqrt(gain.size)


def test_its_method_knows_the_displacement_before():
    assert method_for(12).world_model.memory
    assert method_for(12).max_leaves == 12
