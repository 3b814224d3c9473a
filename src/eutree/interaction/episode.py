"""One episode of a policy in an environment; recorded ones run again, compared bit for bit.

They run again from their seeds and actions. The seed of an episode is a pure function of the run's
seed and its number, so that episode k can be replayed, or a run resumed at it, without knowing
anything of those before. It has 31 bits: simulators written in C++ keep theirs in a signed integer
of 32.
"""

import logging
from collections.abc import Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from enum import IntEnum, unique
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
from eutree.interaction.making import Recipe, make
from eutree.parallel import Workers
from eutree.policies import Policy, TreePolicy
from eutree.validation import check_integer, check_seed

MAX_EPISODE_SEED = 2**31 - 1
logger = logging.getLogger(__name__)


@unique
class Stream(IntEnum):
    """The uses of random numbers: two uses never draw the same ones from one seed."""

    EPISODES = 0  # where only one use is made of a seed
    RECORDING = 1
    TRAINING = 2  # the starts of a run's episodes
    EXPLORATION = 3  # its random actions
    EXPANSION = 4  # its updates
    EVALUATION = 5
    PERSON = 6  # the starts that a person gets
    WATCHING = 7  # episodes shown in a report
    JUDGING = 8  # a run's last tree against its first
    HOLD_OUT = 9
    START = 10  # random trees to start from
    COMPRESSION = 11  # races between prunings
    FRONT = 12  # the best tree of each size at the end of a run
    GATHERING = 21  # DAgger's episodes
    VALIDATION = 22
    RACING = 31
    PROPOSING = 32  # variants of a tree
    COMPARING = 33  # starts at which a learner compares trees
    FITTING = 41  # the trees of a fit that are played
    SELECTION = 42  # the best of many runs is chosen
    WINNER = 43  # and judged
    AGAINST = 44  # a result against another policy


def episode_seed(seed: int, episode: int, stream: int = Stream.EPISODES) -> int:
    """Return the seed that ``reset`` gets for one episode of a run, from 0 to 2**31 - 1.

    Args:
        seed: Seed of the run, evaluation or recording.
        episode: Number of the episode, from 0.
        stream: The use of the episodes, so that those of different uses never coincide.
    """
    entropy = (check_seed(seed), check_integer("stream", stream), check_integer("episode", episode))
    return int(np.random.SeedSequence(entropy).generate_state(1)[0]) & MAX_EPISODE_SEED


def run_episode(env: GuardedEnv, policy: Policy, seed: int | None = None) -> Episode:
    """Run ``policy`` from reset to the end of the episode.

    Raises:
        EnvironmentFault: The environment broke its contract.
    """
    steps = EpisodeSteps(env, env.reset(seed))
    actor = Actor(policy, env)
    while not steps.is_over:
        steps.take(actor.act(steps.present, env.allowed))
    logger.debug("%s, seed %s: %d steps", env.spec, seed, len(steps))
    return steps.episode(seed)


def run_pairs(
    env: gymnasium.Env[Any, Any], pairs: Sequence[tuple[TreePolicy, int]], *, strict: bool = False
) -> list[Episode]:
    """Run each tree, all of the same features, from the seed beside it."""
    guarded = GuardedEnv(acting_as(env, pairs[0][0]), strict=strict)
    return [run_episode(guarded, tree, seed) for tree, seed in pairs]


@dataclass(frozen=True)
class RunPairs:
    """``run_pairs`` in an environment of its own, in whichever process."""

    recipe: Recipe
    strict: bool = False

    def __call__(self, pairs: Sequence[tuple[TreePolicy, int]]) -> list[Episode]:
        """Make the environment, and run each tree from the seed beside it."""
        with closing(self.recipe.make()) as env:
            return run_pairs(env, pairs, strict=self.strict)

    def over(
        self, workers: Workers, pairs: Sequence[tuple[TreePolicy, int]], most: int
    ) -> list[Episode]:
        """Return the episodes of pairs; each worker runs some, in blocks of at most so many."""
        blocks = [pairs[block.start : block.stop] for block in workers.blocks(len(pairs), most)]
        return [episode for part in workers.map(self, blocks) for episode in part]


class EpisodeSteps:
    """The steps of an episode under way, from its reset on."""

    def __init__(self, env: GuardedEnv, observation: Floats) -> None:
        self._env = env
        self.present = observation  # [d]
        self.is_over = False  # whether the task or a limit has ended it
        self._observations = [self.present]
        self._actions: list[int] = []
        self._rewards: list[float] = []
        self._allowed: list[Booleans | None] = []
        self._end: tuple[bool, bool, dict[str, Any]] = (False, False, {})

    def __len__(self) -> int:
        """Return the number of steps so far."""
        return len(self._actions)

    def take(self, action: int) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Take a step, and return the environment's answer.

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
    """The result of replaying one episode."""

    episode: int  # position of the episode in ``Demonstrations.episodes``
    n_steps: int  # number of steps that were replayed
    problem: str  # the first difference; empty if there is none

    @property
    def is_equal(self) -> bool:
        """Whether every observation, reward and flag came out the same, bit for bit."""
        return not self.problem


def replay(
    demonstrations: Demonstrations, env: gymnasium.Env[Any, Any] | None = None
) -> list[ReplayResult]:
    """Replay every episode, discarded ones included.

    Args:
        demonstrations: The recorded episodes.
        env: The environment; made as the demonstrations say, if None.

    Raises:
        InvalidArgumentError: There are no episodes, no environment is known, or the environment
            is another one than that of the demonstrations.
    """
    if not demonstrations.episodes:
        raise InvalidArgumentError("there are no episodes to replay")
    world = closing(environment_for(demonstrations)) if env is None else nullcontext(env)
    with world as opened:
        guarded = GuardedEnv(acting_as(opened, demonstrations))
        check_same_environment(demonstrations, guarded)
        return [
            _replay_episode(*numbered, guarded) for numbered in enumerate(demonstrations.episodes)
        ]


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
        if problem := _difference("observation", episode.observations[0], env.reset(episode.seed)):
            return ReplayResult(number, 0, f"at reset: {problem}")
        for step in range(len(episode)):
            if problem := _step_difference(episode, step, env):
                return ReplayResult(number, step, f"at step {step}: {problem}")
    except (EnvironmentFault, InvalidArgumentError) as error:  # an action that is masked now
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
