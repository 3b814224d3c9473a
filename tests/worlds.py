"""Toy worlds that tests share, each with a known answer.

``Walk`` is lived in without an environment. ``Corridor`` is a ``gymnasium.Env``: ``play`` lets a
learner act in one, as the loop of a run does, and ``recorded`` gives demonstrations of its expert.
"""

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from eutree.data import Demonstrations, Episode
from eutree.interaction import GuardedEnv
from eutree.learners import CORRECTED, DEFAULT, Problem, Start, Step
from eutree.recording import record
from eutree.schema import Schema
from eutree.splitting import Permutation

# The corrected method at the fewest permutations its level allows, a tenth of the default, for
# tests of something else: nearly all of its time goes into them.
FEW_DRAWS = replace(
    CORRECTED, significance=Permutation(alpha=0.01, n_permutations=99, by_episode=True)
)

# The default method with a tenth of its imagined episodes, for tests of what is around a learner:
# logs, callbacks, going on. How well it plans is seen elsewhere.
FEW_IMAGINED = replace(
    DEFAULT, planner=replace(DEFAULT.planner, n_episodes=100, n_explorer_episodes=30)
)


class Walk:
    """A walk of ten steps to a goal; action 1 goes on, action 0 stays and costs 2."""

    problem = Problem(Schema.anonymous(2, 2))

    def __init__(self, generator):
        self.generator = generator

    def run(self, learner, generator, steps=40):
        """Let a learner live through an episode of at most so many steps."""
        at = 0.0
        learner.start_episode(np.array([at, self.generator.random()]), generator)
        for step in range(steps):
            action = learner.act()
            at += action * (0.9 + 0.2 * self.generator.random())
            done = at >= 10
            reward = 100.0 if done else -2.0 * (1 - action)
            observation = np.array([at, self.generator.random()])
            cut = step == steps - 1 and not done
            learner.observe(Step(action, reward, observation, terminated=done, truncated=cut))
            if done or cut:
                learner.end_episode()
                return


def learned_to_walk(method, seed=0, phases=3, episodes=8):
    """Return a learner after so many phases of so many walks."""
    learner = method.start(Walk.problem, Start())
    world = Walk(np.random.default_rng(seed))
    generator = np.random.default_rng(seed + 1)
    for _ in range(phases):
        for _ in range(episodes):
            world.run(learner, generator)
        learner.update(generator)
    return learner


def take(learner, *steps):
    """Let a learner observe steps of (action, reward, observation, terminated, truncated)."""
    for action, reward, observation, terminated, truncated in steps:
        learner.observe(Step(action, reward, np.array(observation), terminated, truncated))
        if terminated or truncated:
            learner.end_episode()


class Corridor(gymnasium.Env[Any, Any]):
    """Walk to the goal at the right end of a corridor of length 1, which has a closed door.

    Observation: position in [0, 1], whether the door at 0.5 is open, and a constant. Actions: 0
    waits, 1 walks an eighth. Walking into the closed door ends the episode with -10; the goal is
    worth 10, every step -0.1. The door opens and closes at random, so the best rule needs two cuts:
    wait just before the door while it is closed, walk everywhere else. ``scale`` multiplies the
    position, the way another unit would.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(self, scale: float = 1.0) -> None:
        self.scale = scale
        high = np.array([scale, 1.0, 2.0])
        self.observation_space = spaces.Box(np.array([0.0, 0.0, 2.0]), high, dtype=np.float64)
        self.action_space = spaces.Discrete(2)
        self.spec = None

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.place = int(self.np_random.integers(4))  # tenths
        self.open = bool(self.np_random.random() < 0.5)
        self.left = 60
        return self._observation(), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        crashed = action == 1 and self.place == 4 and not self.open
        self.place += int(action == 1 and not crashed)
        self.left -= 1
        done = self.place >= 8
        self.open = bool(self.np_random.random() < 0.5)
        reward = 10.0 if done else -10.0 if crashed else -0.1
        info = {"is_success": done}
        ended = done or crashed
        return self._observation(), reward, ended, self.left == 0 and not ended, info

    def _observation(self) -> Any:
        return np.array([self.place * 0.125 * self.scale, float(self.open), 2.0])


class CorridorExpert:
    """Waits before the closed door, walks everywhere else."""

    def __init__(self, scale: float = 1.0) -> None:
        self.scale = scale

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        rows = np.atleast_2d(observation)
        before_the_door = np.abs(rows[:, 0] / self.scale - 0.5) < 0.01
        actions = np.where(before_the_door & (rows[:, 1] < 0.5), 0, 1)
        return (actions if np.ndim(observation) > 1 else int(actions[0])), state


def problem_of(env: gymnasium.Env[Any, Any], **options: Any) -> Problem:
    """Return what a learner may know of an environment."""
    guarded = GuardedEnv(env)
    return Problem(schema=guarded.schema, environment=guarded.spec, **options)


def recorded(scale: float = 1.0, episodes: int = 12, seed: int = 0) -> Demonstrations:
    """Return demonstrations of the corridor's expert."""
    return record(Corridor(scale), CorridorExpert(scale), episodes=episodes, seed=seed)


def play(learner: Any, env: gymnasium.Env[Any, Any], seed: int) -> float:
    """Let a learner act for one episode; return what it earned."""
    guarded = GuardedEnv(env)
    learner.start_episode(guarded.reset(seed), np.random.default_rng(seed))
    earned = 0.0
    while True:
        action = learner.act()
        observation, reward, terminated, truncated, info = guarded.step(action)
        learner.observe(Step(action, reward, observation, terminated, truncated, info))
        earned += reward
        if terminated or truncated:
            learner.end_episode()
            return earned


def play_in_part(learner: Any, env: gymnasium.Env[Any, Any], seed: int, steps: int) -> None:
    """Let a learner act for some steps of an episode, and discard it."""
    guarded = GuardedEnv(env)
    learner.start_episode(guarded.reset(seed), np.random.default_rng(seed))
    for _ in range(steps):
        action = learner.act()
        observation, reward, terminated, truncated, info = guarded.step(action)
        learner.observe(Step(action, reward, observation, terminated, truncated, info))
        if terminated or truncated:
            break
    learner.discard_episode()


ROOM = Schema.anonymous(2, 2)


def room_episode(generator, act, *, steps=60, random=0.1):
    """Return an episode of a room that cools: action 1 heats, and 20 degrees are best.

    Args:
        generator: Source of the weather, of noise in the second feature, and of random actions.
        act: What whoever acts does at an observation.
        steps: Steps until the time limit.
        random: Share of random actions.
    """
    degrees = generator.uniform(16, 24)
    observations, actions, rewards = [[degrees, generator.normal()]], [], []
    for _ in range(steps):
        at_random = generator.random() < random
        action = int(generator.integers(2)) if at_random else act(observations[-1])
        degrees += (1.0 if action else -0.5) + 0.3 * generator.normal()
        actions.append(action)
        rewards.append(-abs(degrees - 20.0) - 0.2 * action)
        observations.append([degrees, generator.normal()])
    return Episode(np.array(observations), actions, rewards, terminated=False, truncated=True)


def clustered_noise(generator, *, episodes=20, steps=40):
    """Return episodes whose rewards depend on nothing observed, but much on their episode.

    A reward is a level of the episode's own and slow noise; of the three features one is the same
    throughout an episode, one is slow noise, one is white noise.
    """
    found = []
    for _ in range(episodes):
        observations = generator.normal(size=(steps + 1, 3))
        observations[:, 0] = generator.normal()
        observations[:, 1] = _slow(generator, steps + 1)
        rewards = generator.normal() + _slow(generator, steps)
        actions = generator.integers(0, 2, steps)
        found.append(Episode(observations, actions, rewards, terminated=False, truncated=True))
    return tuple(found)


def _slow(generator, n):
    """Return noise whose neighbours correlate by 0.9, variance 1."""
    values = generator.normal(size=n)
    for k in range(1, n):
        values[k] = 0.9 * values[k - 1] + np.sqrt(1 - 0.81) * values[k]
    return values
