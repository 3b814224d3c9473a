"""The real environment beside a plant: counterexamples are replayed, plants are tested."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.proof.intervals import Intervals, Truth
from eutree.proof.plant import Plant, State

_MOST_STEPS = 10_000  # of an episode that is played to break a property


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An episode of the real environment.

    Attributes:
        states: Where it was before each step and at the end.
        is_over: Whether the environment ended it.
    """

    states: Floats  # [T + 1, d]
    is_over: bool


def replay(
    plant: Plant,
    policy: TreePolicy,
    start: Floats,
    steps: int,
    *,
    env: gymnasium.Env[Any, Any] | None = None,
) -> Trajectory:
    """Return the real episode from a start, of at most so many steps.

    Args:
        plant: What makes the environment and puts it there.
        policy: The policy.
        start: A state, shape [d].
        steps: Most steps.
        env: The environment, where many episodes are played; else one is made.
    """
    made = env
    env = made or plant.make()
    observation = plant.put(env, start)
    states, over = [plant.state_of(env)], False
    while not over and len(states) <= steps:
        action = policy.act(np.asarray(observation, dtype=np.float64).tolist())
        observation, _, over, _, _ = env.unwrapped.step(action)
        states.append(plant.state_of(env))
    if made is None:
        env.close()
    return Trajectory(np.array(states), bool(over))


def breaking_seed(
    plant: Plant, policy: TreePolicy, broken: Callable[[State], Truth], *, episodes: int = 200
) -> dict[str, int] | None:
    """Return the seed and step of a real episode that breaks conditions; None if none does.

    Args:
        plant: The plant.
        policy: The policy.
        broken: Whether states break them.
        episodes: How many are played, of the seeds 0, 1, 2 ...
    """
    env = plant.make()
    for seed in range(episodes):
        observation, _ = env.reset(seed=seed)
        over, steps = False, 0
        while not over and steps < _MOST_STEPS:
            action = policy.act(np.asarray(observation, dtype=np.float64).tolist())
            observation, _, terminated, truncated, _ = env.step(action)
            over, steps = terminated or truncated, steps + 1
            state = [Intervals.of(x) for x in plant.state_of(env)[:, None]]
            if broken(state).surely[0]:
                return {"seed": seed, "steps": steps}
    return None


def check_plant(
    plant: Plant, *, episodes: int = 100, steps: int = 200, generator: np.random.Generator
) -> None:
    """Test that a plant moves as its environment does: real states must stay in its boxes.

    Episodes begin at random starts; actions are random, each kept for a random number of steps.
    Before every step a box of random size is laid around the state.

    Args:
        plant: The plant.
        episodes: How many episodes are played.
        steps: Most steps of each.
        generator: Source of all chance.

    Raises:
        InvalidArgumentError: A real state left the box that it must be in, or an episode went on
            after the plant had surely arrived.
    """
    if plant.by_chance:
        raise InvalidArgumentError(
            f"the plant of {plant.environment} has no boxes that a state could leave; compare what "
            "it proves with sampled episodes"
        )
    env = plant.make()
    for _ in range(episodes):
        start = generator.uniform(*np.array(plant.start).T)
        plant.put(env, start)
        _follow(plant, env, steps, generator)
    env.close()


def _follow(
    plant: Plant, env: gymnasium.Env[object, int], steps: int, generator: np.random.Generator
) -> None:
    n_actions = int(env.action_space.n)  # type: ignore[attr-defined]  # Discrete, as for any tree
    action = 0
    for _ in range(steps):
        if generator.random() < 0.1:
            action = int(generator.integers(n_actions))
        before = plant.state_of(env)
        room = 10.0 ** generator.uniform(-12, -1) * (np.abs(before) + 0.1)
        low, high = (before + sign * room * generator.random(before.size) for sign in (-1, 1))
        boxes = [Intervals(a[None], b[None]) for a, b in zip(low, high, strict=True)]
        found = plant.step(boxes, np.array([action]))
        _, _, over, _, _ = env.unwrapped.step(action)
        after = plant.state_of(env)
        for name, now, box in zip(plant.state, after.tolist(), found, strict=True):
            if not box.low[0] <= now <= box.high[0]:
                raise InvalidArgumentError(
                    f"plant must move as {plant.environment} does: after action {action} in "
                    f"{before.tolist()}, {name} is {now!r}, outside of [{box.low[0]!r}, "
                    f"{box.high[0]!r}]"
                )
        arrived = plant.arrives([Intervals.of(np.array([x])) for x in after])
        if arrived.surely[0] and not over:
            raise InvalidArgumentError(
                f"plant must end as {plant.environment} does: it says that {after.tolist()} has "
                "arrived, where the environment goes on"
            )
        if over:
            return
