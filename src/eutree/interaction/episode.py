"""One episode of a policy in an environment; recorded ones run again, compared bit for bit.

They run again from their seeds and actions.
"""

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.data import Demonstrations, Episode
from eutree.data.episode import ALLOWED, masks_of
from eutree.errors import EnvironmentFault, InvalidArgumentError
from eutree.interaction.acting import Actor
from eutree.interaction.deriving import acting_as
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.making import make
from eutree.policies import Policy


def run_episode(env: GuardedEnv, policy: Policy, seed: int | None = None) -> Episode:
    """Run ``policy`` from reset to the end of the episode.

    Raises:
        EnvironmentFault: The environment broke its contract.
    """
    steps = EpisodeSteps(env, env.reset(seed))
    actor = Actor(policy, env)
    while not steps.is_over:
        steps.take(actor.act(steps.present, env.allowed))
    return steps.episode(seed)


class EpisodeSteps:
    """The steps of an episode under way, from its reset on.

    Args:
        env: Where it is.
        observation: What was observed at its reset, shape [d].

    Attributes:
        present: The present observation, shape [d].
        is_over: Whether the task or a limit has ended it.
    """

    def __init__(self, env: GuardedEnv, observation: Floats) -> None:
        self._env = env
        self.present, self.is_over = observation, False
        self._observations = [self.present]
        self._actions: list[int] = []
        self._rewards: list[float] = []
        self._allowed: list[Booleans | None] = []
        self._end: tuple[bool, bool, dict[str, Any]] = (False, False, {})

    def __len__(self) -> int:
        """Return the number of steps so far."""
        return len(self._actions)

    def take(self, action: int) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Take a step, and return what the environment says.

        Raises:
            EnvironmentFault: The environment broke its contract.
        """
        self._allowed.append(self._env.allowed)
        said = self._env.step(action)
        self.present, reward, terminated, truncated, info = said
        self._observations.append(self.present)
        self._actions.append(action)
        self._rewards.append(reward)
        self._end, self.is_over = (terminated, truncated, info), terminated or truncated
        return said

    def episode(self, seed: int | None = None) -> Episode:
        """Return the episode, which has ended; ``seed`` is that of its reset, where it is known."""
        terminated, truncated, info = self._end
        allowed = masks_of(self._allowed)
        return Episode(
            observations=np.array(self._observations),
            actions=np.array(self._actions),
            rewards=np.array(self._rewards),
            terminated=terminated,
            truncated=truncated and not terminated,
            seed=seed,
            ending=ending_of(info, terminated=terminated),
            is_success=success_of(info),
            steps={} if allowed is None else {ALLOWED: allowed},
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


@dataclass(frozen=True)
class ReplayResult:
    """What came of replaying one episode.

    Attributes:
        episode: Position of the episode in ``Demonstrations.episodes``.
        n_steps: Number of steps that were replayed.
        problem: What differed first; empty if nothing did.
    """

    episode: int
    n_steps: int
    problem: str

    @property
    def is_equal(self) -> bool:
        """Whether every observation, reward and flag came out the same, bit for bit."""
        return not self.problem


def replay(
    demonstrations: Demonstrations, env: gymnasium.Env[Any, Any] | None = None
) -> list[ReplayResult]:
    """Replay every episode, discarded ones included.

    Args:
        demonstrations: What was recorded.
        env: The environment; made as the demonstrations say, if None.

    Raises:
        InvalidArgumentError: There are no episodes, no environment is known, or the environment
            is another one than that of the demonstrations.
    """
    if not demonstrations.episodes:
        raise InvalidArgumentError("there are no episodes to replay")
    world = environment_for(demonstrations) if env is None else env
    guarded = GuardedEnv(acting_as(world, demonstrations))
    check_same_environment(demonstrations, guarded)
    try:
        return [
            _replay_episode(number, episode, guarded)
            for number, episode in enumerate(demonstrations.episodes)
        ]
    finally:
        if env is None:
            guarded.env.close()


def environment_for(
    demonstrations: Demonstrations, *, render_mode: str | None = None
) -> gymnasium.Env[Any, Any]:
    """Make the environment that the demonstrations name."""
    if demonstrations.environment is None:
        raise InvalidArgumentError("the demonstrations name no environment; give one")
    return make(demonstrations.environment, render_mode=render_mode)


def check_same_environment(demonstrations: Demonstrations, guarded: GuardedEnv) -> None:
    """Raise InvalidArgumentError unless the demonstrations are of this environment."""
    recorded, present = demonstrations.environment, guarded.spec
    if recorded is not None and present is not None and recorded.id != present.id:
        raise InvalidArgumentError(f"the demonstrations are of {recorded}, not of {present}")
    mine, theirs = demonstrations.schema, guarded.schema
    if (mine.n_features, mine.n_actions) != (theirs.n_features, theirs.n_actions):
        raise InvalidArgumentError(
            f"the demonstrations have {mine.n_features} features and {mine.n_actions} actions; "
            f"{present or guarded.name} has {theirs.n_features} and {theirs.n_actions}"
        )


def _replay_episode(number: int, episode: Episode, env: GuardedEnv) -> ReplayResult:
    if episode.seed is None:
        return ReplayResult(number, 0, "its seed was not recorded")
    try:
        problem = _difference("observation", episode.observations[0], env.reset(episode.seed))
        if problem:
            return ReplayResult(number, 0, f"at reset: {problem}")
        for step in range(len(episode)):
            problem = _step_difference(episode, step, env)
            if problem:
                return ReplayResult(number, step, f"at step {step}: {problem}")
    except EnvironmentFault as error:
        return ReplayResult(number, env.step_number, str(error))
    return ReplayResult(number, len(episode), "")


def _step_difference(episode: Episode, step: int, env: GuardedEnv) -> str:
    observation, reward, terminated, truncated, _ = env.step(int(episode.actions[step]))
    last = step == len(episode) - 1
    recorded = (episode.terminated and last, episode.truncated and last)
    replayed = (terminated, truncated and not terminated)
    if recorded != replayed:
        return f"terminated, truncated were {recorded}, are {replayed}"
    return _difference("observation", episode.observations[step + 1], observation) or _difference(
        "reward", episode.rewards[step : step + 1], np.array([reward])
    )


def _difference(name: str, recorded: Floats, replayed: Floats) -> str:
    if recorded.tobytes() == np.asarray(replayed, dtype=np.float64).tobytes():
        return ""
    return f"{name} was {_brief(recorded)}, is {_brief(replayed)}"


def _brief(values: Floats) -> str:
    shown = [repr(value) for value in values.tolist()[:6]]
    return "[" + ", ".join(shown + ["..."] * (len(values) > 6)) + "]"
