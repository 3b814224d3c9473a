"""Re-run recorded episodes from their seeds and actions, and compare bit for bit."""

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.data import Demonstrations, Episode
from eutree.errors import EnvironmentFault, InvalidArgumentError
from eutree.interaction.deriving import acting_as
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.making import make


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
