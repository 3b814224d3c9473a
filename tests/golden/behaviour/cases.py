"""What is frozen of the learners' behaviour: presets x starts x tasks x seeds, as plain numbers.

Episodes are few and short, so that all of it takes about a minute; the presets are the real ones.
Values of leaves are frozen for the presets whose values decide, and for those only.
"""

import hashlib
import itertools
from dataclasses import dataclass, replace
from functools import cache

import gymnasium
import numpy as np

import eutree
from eutree.envs.experts import experts_for
from eutree.interaction.making import make
from eutree.learners import PAPER, PAPER_D
from eutree.recording import record
from eutree.schema import EnvironmentSpec

SEEDS = range(5)
PRESETS = ("paper", "paper-d", "default")
# The settings that the presets had when their behaviour was frozen, spelled out where they have
# been read anew since.
METHODS = {
    "paper": replace(PAPER, untried_value=0.0, exploration=0.1),
    "paper-d": replace(PAPER_D, untried_value=0.0, exploration=0.1),
    "default": "default",
}
STARTS = ("nothing", "tree", "tree+demos")


@dataclass(frozen=True)
class Task:
    """An environment with a time limit, its demonstrator, and how long it is learned in."""

    environment: str
    demonstrator: str
    max_episode_steps: int | None
    episodes: int


TASKS = {
    "evasion": Task("eutree/Evasion2-v0", "gate", None, 70),
    "cart-pole": Task("CartPole-v1", "balance", 50, 45),
    "mountain-car": Task("MountainCar-v0", "rock", 130, 30),
}
CASES = tuple(itertools.product(PRESETS, STARTS, TASKS))
RACED = tuple(("default-raced", "tree+demos", task) for task in TASKS)
RACING_STEPS = {"evasion": 3_000, "cart-pole": 3_000, "mountain-car": 8_000}


def name_of(preset, start, task):
    """Return the name of a case's file."""
    return f"{preset}.{start}.{task}.json"


def behaviour(preset, start, task, seed):
    """Learn, and return what the learner does, in numbers that JSON holds exactly."""
    setting = TASKS[task]
    shown = demonstrations(task)
    result = eutree.learn(
        environment(setting),
        demonstrations=None if start == "nothing" else shown,
        start=start,
        method=METHODS[preset.removesuffix("-raced")],
        episodes=setting.episodes,
        evaluate_every=20,
        evaluation_episodes=5,
        race_steps=RACING_STEPS[task] if preset.endswith("-raced") else 0,
        seed=seed,
    )
    found = {"seed": seed} | learned(result, task)
    if preset in ("paper", "paper-d"):
        found["visits"] = column(result.learned.leaves.visits.ravel())
        found["values"] = column(result.learned.leaves.values.ravel())
    return found


def learned(result, task):
    """Return what was learned, handed over or not, in plain numbers."""
    history = result.history
    return {
        "steps": result.steps,
        **decided(result.learned, task),
        "returns": column(np.bincount(history.episodes, history.rewards)),
        "history": digest(history.observations, history.actions, history.rewards),
        "curve": [[p.episode, p.steps, p.success_rate, p.mean_return, p.n_leaves]
                  for p in result.curve],
    }  # fmt: skip


def decided(policy, task):
    """Return a policy in plain numbers: its tree, its actions, and what it does at the points."""
    rows = points(task, policy.tree.n_features)
    return {
        "tree": {name: column(getattr(policy.tree, name))
                 for name in ("feature", "threshold", "left", "right", "leaf")},
        "leaf_actions": column(policy.actions),
        "actions": "".join(map(str, policy.actions[policy.tree.leaf_index(rows)])),
    }  # fmt: skip


@cache
def demonstrations(task):
    """Record five episodes of the task's demonstrator."""
    setting = TASKS[task]
    expert = experts_for(setting.environment)[setting.demonstrator]
    return record(environment(setting), expert, episodes=5, seed=0)


def environment(setting):
    """Make the environment of a task."""
    if setting.max_episode_steps is None:
        return make(EnvironmentSpec(setting.environment))
    return gymnasium.make(setting.environment, max_episode_steps=setting.max_episode_steps)


def points(task, n_features):
    """Return fixed observations in and around the demonstrations, shape [200, d].

    Features of the past, beyond those observed, are those observed once more.
    """
    seen = demonstrations(task).observations
    low, high = seen.min(axis=0), seen.max(axis=0)
    margin = 0.25 * (high - low)
    size = (200, seen.shape[1])
    rows = np.random.default_rng(0).uniform(low - margin, high + margin, size)
    return np.resize(rows.T, (n_features, 200)).T


def column(array):
    """Return the numbers of an array, None in place of nan."""
    return [None if number != number else number for number in array.tolist()]


def digest(*arrays):
    """Return a checksum of the bytes of arrays."""
    checksum = hashlib.sha256()
    for array in arrays:
        checksum.update(np.ascontiguousarray(array).tobytes())
    return checksum.hexdigest()
