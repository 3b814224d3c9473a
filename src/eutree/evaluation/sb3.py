"""``evaluate_policy`` with the signature of Stable-Baselines3, for code that was written for it."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from eutree.interaction import GuardedEnv
from eutree.interaction.acting import Actor, Controller, as_policy
from eutree.interaction.action_grid import acting_as
from eutree.validation import check_integer

Callback = Callable[[dict[str, Any], dict[str, Any]], None]


def evaluate_policy(
    model: Controller,
    env: gymnasium.Env[Any, Any],
    n_eval_episodes: int = 10,
    deterministic: bool = True,
    render: bool = False,
    callback: Callback | None = None,
    *,
    reward_threshold: float | None = None,
    return_episode_rewards: bool = False,
    warn: bool = True,
) -> tuple[float, float] | tuple[list[float], list[int]]:
    """Return mean and standard deviation of the returns, as Stable-Baselines3 does.

    Episodes go on with the environment's own chance; for seeded ones and intervals, use
    ``eutree.evaluate``.

    Args:
        model: As ``eutree.evaluate`` takes it: anything with SB3's ``predict``, or a function.
        env: A single Gymnasium environment.
        n_eval_episodes: Number of episodes.
        deterministic: Passed to ``predict``.
        render: Whether to call ``env.render()`` after each step.
        callback: Called after each step with ``locals()`` and ``globals()``.
        reward_threshold: The mean return must be above it.
        return_episode_rewards: Return the returns and lengths of the episodes instead.
        warn: Ignored: rewards come from the environment as it is.

    Raises:
        AssertionError: The mean return is not above ``reward_threshold``.
    """
    guarded = GuardedEnv(acting_as(env, model))
    actor = Actor(as_policy(model, env), guarded, deterministic=deterministic)
    episode_rewards: list[float] = []
    episode_lengths: list[int] = []
    for _ in range(check_integer("n_eval_episodes", n_eval_episodes, low=1)):
        observation = guarded.reset()
        actor.start()
        total, length, ended = 0.0, 0, False
        while not ended:
            action = actor.act(observation)
            observation, reward, terminated, truncated, info = guarded.step(action)
            total, length = total + reward, length + 1
            ended = terminated or truncated
            if callback is not None:
                callback(locals(), globals())
            if render:
                env.render()
        episode_rewards.append(total)
        episode_lengths.append(length)
    mean = float(np.mean(episode_rewards))
    if reward_threshold is not None and not mean > reward_threshold:
        raise AssertionError(f"Mean reward below threshold: {mean:.2f} < {reward_threshold:.2f}")
    if return_episode_rewards:
        return episode_rewards, episode_lengths
    return mean, float(np.std(episode_rewards))
