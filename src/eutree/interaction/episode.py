"""One episode of a policy in an environment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.data import Episode
from eutree.data.episode import ALLOWED
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
    masks = Masks()
    while True:
        masks.add(env.allowed)
        action = actor.act(observation, env.allowed)
        observation, reward, terminated, truncated, info = env.step(action)
        observations.append(observation)
        actions.append(action)
        rewards.append(reward)
        if terminated or truncated:
            break
    end = End(terminated, truncated, info)
    return masks.given_to(ended_episode(observations, actions, rewards, end, seed=seed))


class Masks:
    """Which actions were allowed at each step of an episode."""

    def __init__(self) -> None:
        self._rows: list[Booleans | None] = []

    def add(self, allowed: Booleans | None) -> None:
        """Take those of the next step, shape [A]; None where all are."""
        self._rows.append(allowed)

    def given_to(self, episode: Episode) -> Episode:
        """Return the episode with them, as ``steps["allowed"]``; as it is where there are none."""
        known = next((row for row in self._rows if row is not None), None)
        if known is None:
            return episode
        every = np.ones_like(known)
        rows = [every if row is None else row for row in self._rows[: len(episode)]]
        return replace(episode, steps={**episode.steps, ALLOWED: np.array(rows)})


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
