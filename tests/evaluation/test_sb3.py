import gymnasium
import numpy as np
import pytest

from eutree.evaluation import evaluate_policy
from tests.evaluation.acting import random_policy


class Halting:
    """Acts at random unless it is asked to be deterministic."""

    def __init__(self):
        self.generator = np.random.default_rng(0)

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        steps = 0 if state is None or episode_start else state
        action = 1 if deterministic else int(self.generator.integers(2))
        return np.array(action), steps + 1


def test_it_returns_mean_and_deviation_or_the_episodes():
    env = gymnasium.make("CartPole-v1")
    env.reset(seed=3)
    policy = random_policy(4, n_leaves=3)
    returns, lengths = evaluate_policy(policy, env, 7, return_episode_rewards=True)
    assert returns == [float(length) for length in lengths]
    env.reset(seed=3)
    mean, deviation = evaluate_policy(policy, env, n_eval_episodes=7)
    assert (mean, deviation) == (np.mean(returns), np.std(returns))


def test_it_passes_on_deterministic_and_the_state():
    env = gymnasium.make("CartPole-v1")
    env.reset(seed=3)
    always, _ = evaluate_policy(Halting(), env, 20)
    random, _ = evaluate_policy(Halting(), env, 20, deterministic=False)
    assert always < 11 < random


def test_the_callback_sees_every_step():
    seen = []
    env = gymnasium.make("CartPole-v1")
    _, lengths = evaluate_policy(
        Halting(), env, 3, True, False, lambda local, _: seen.append(local["reward"]),
        return_episode_rewards=True,
    )  # fmt: skip
    assert seen == [1.0] * sum(lengths)


def test_it_renders_when_asked():
    env = gymnasium.make("eutree/Evasion2-v0", render_mode="ansi")
    evaluate_policy(random_policy(3), env, 1, render=True)


def test_a_threshold_must_be_passed():
    env = gymnasium.make("CartPole-v1")
    evaluate_policy(Halting(), env, 2, reward_threshold=5.0)
    with pytest.raises(AssertionError, match="Mean reward below threshold"):
        evaluate_policy(Halting(), env, 2, reward_threshold=400.0)
