"""One episode of a policy in an environment."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.interaction.acting import Actor
from eutree.interaction.guard import GuardedEnv
from eutree.policies import Policy


def run_episode(env: GuardedEnv, policy: Policy, seed: int | None = None) -> Episode:
    """Run ``policy`` from reset to the end of the episode.

    Raises:
        EnvironmentFault: The environment broke its contract.
    """
    observation = env.reset(seed)
    observations, actions, rewards = [observation], [], []
    actor = Actor(policy, env)
    while True:
        action = actor.act(observation)
        observation, reward, terminated, truncated, info = env.step(action)
        observations.append(observation)
        actions.append(action)
        rewards.append(reward)
        if terminated or truncated:
            break
    end = End(terminated, truncated, info)
    return ended_episode(observations, actions, rewards, end, seed=seed)


@dataclass(frozen=True)
class End:
    """What the environment says with the last step of an episode."""

    terminated: bool
    truncated: bool
    info: dict[str, Any]


def ended_episode(
    observations: Sequence[Floats],
    actions: Sequence[int],
    rewards: Sequence[float],
    end: End,
    *,
    seed: int | None = None,
) -> Episode:
    """Return an episode that the task or a limit has ended.

    Args:
        observations: T + 1 observations.
        actions: T actions.
        rewards: T rewards.
        end: What was said with the last step.
        seed: Seed of its reset.
    """
    return Episode(
        observations=np.array(observations),
        actions=np.array(actions),
        rewards=np.array(rewards),
        terminated=end.terminated,
        truncated=end.truncated and not end.terminated,
        seed=seed,
        ending=ending_of(end.info, terminated=end.terminated),
        is_success=success_of(end.info),
    )


def ending_of(info: dict[str, Any], *, terminated: bool) -> str:
    """Return why an episode ended: ``info["ending"]`` if it is a text, else by its flags."""
    ending = info.get("ending")
    own = str(ending) if isinstance(ending, str) else ""
    return own or ("terminated" if terminated else "truncated")


def success_of(info: dict[str, Any]) -> bool | None:
    """Return ``info["is_success"]``, or None where the environment reports none."""
    success = info.get("is_success")
    return None if success is None else bool(success)
