"""The real environment beside a plant: counterexamples are replayed, plants are tested.

Where a proof failed, episodes may begin until it stands: in boxes of states.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError
from eutree.interaction import GuardedEnv
from eutree.interaction.spaces import encoder, spec_of
from eutree.policies import TreePolicy
from eutree.proof.certificate import Certificate, Pieces, Starts
from eutree.proof.intervals import Intervals, Truth
from eutree.proof.plant import Plant, State, plant_of

_SEEDS, _MOST_STEPS = 200, 10_000  # of an episode that is played to break a property
_LONG = 2  # of them: so many go on where Gymnasium would cut them short


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
        plant: The plant, which makes the environment and puts it there.
        policy: Chooses the actions.
        start: A state, shape [d].
        steps: Steps after which the episode is cut short.
        env: The environment, where many episodes are played; else one is made.
    """
    made = env
    env = made or plant.make()
    guard = GuardedEnv(env, max_episode_steps=steps + 1)
    seen = encoder(env.observation_space)(plant.put(env, start))
    states, over = [plant.state_of(env)], False
    while not over and len(states) <= steps:  # also where Gymnasium would cut it short
        seen, _, over, _, _ = guard.step(_chosen(policy, seen))
        plant.check_allowed(guard.allowed)
        states.append(plant.state_of(env))
    if made is None:
        env.close()
    return Trajectory(np.array(states), bool(over))


def _chosen(policy: TreePolicy, measured: Floats) -> int:
    return policy.act(policy.derivation.behind(measured).tolist())


def breaking_seed(
    plant: Plant, policy: TreePolicy, broken: Callable[[State], Truth]
) -> dict[str, int] | None:
    """Return the seed and step of a real episode that breaks conditions; None if none does."""
    env = plant.make()
    guard = GuardedEnv(env, max_episode_steps=_MOST_STEPS + 1)
    for seed in range(_SEEDS):
        seen, over, steps = guard.reset(seed), False, 0
        while not over and steps < _MOST_STEPS:
            seen, _, terminated, truncated, _ = guard.step(_chosen(policy, seen))
            plant.check_allowed(guard.allowed)
            over, steps = terminated or (truncated and seed >= _LONG), steps + 1
            state = [Intervals.of(x) for x in plant.state_of(env)[:, None]]
            if broken(state).surely[0]:
                return {"seed": seed, "steps": steps}
    return None


def check_plant(
    plant: Plant, *, episodes: int = 100, steps: int = 200, generator: np.random.Generator
) -> None:
    """Test that a plant moves as its environment does: real states must stay in its boxes.

    The environment begins where the plant says; then, at random starts, actions are random, each
    kept for a random number of steps. Before every step a box of random size is laid around the
    state.

    Args:
        plant: Plant to be tested.
        episodes: How many episodes are played.
        steps: Most steps of each.
        generator: Source of all chance.

    Raises:
        InvalidArgumentError: A real state left the box that it must be in, a step earned another
            reward, or an episode began elsewhere, went on after the plant had surely arrived, or
            ended where that moves on.
    """
    if plant.by_chance:
        raise InvalidArgumentError(
            f"the plant of {plant.environment} has no boxes that a state could leave; compare what "
            "it proves with sampled episodes"
        )
    env, (least, most) = plant.make(), np.array(plant.start).T
    plant.check_seen(env)
    guard = GuardedEnv(env, max_episode_steps=steps + 1)  # one for all episodes, to warn once
    for _ in range(episodes):
        guard.reset(seed=int(generator.integers(2**31)))
        began = plant.state_of(env)
        if not ((least <= began) & (began <= most)).all():
            raise InvalidArgumentError(
                f"plant must start as {plant.environment} does: it begins in {began.tolist()}, "
                f"outside of {plant.start}"
            )
        plant.put(env, generator.uniform(least, most))
        _follow(plant, guard, steps, generator)
    env.close()


def _follow(plant: Plant, guard: GuardedEnv, steps: int, generator: np.random.Generator) -> None:
    env, action, n_actions = guard.env, 0, guard.schema.n_actions
    for _ in range(steps):
        if generator.random() < 0.1:
            action = int(generator.integers(n_actions))
        before = plant.state_of(env)
        room = 10.0 ** generator.uniform(-12, -1) * (np.abs(before) + 0.1)
        low, high = (before + sign * room * generator.random(before.size) for sign in (-1, 1))
        boxes = [Intervals(a[None], b[None]) for a, b in zip(low, high, strict=True)]
        found = plant.step(boxes, np.array([action]))
        _, reward, over, _, _ = guard.step(action)
        plant.check_allowed(guard.allowed)
        after = plant.state_of(env)
        if plant.reward is not None and not np.isclose(reward, plant.reward):  # of any precision
            raise InvalidArgumentError(
                f"plant must earn as {plant.environment} does: after action {action} in "
                f"{before.tolist()}, the reward is {reward}, and the plant's is {plant.reward}"
            )
        for name, now, box in zip(plant.state, after.tolist(), found, strict=True):
            if not box.low[0] <= now <= box.high[0]:
                raise InvalidArgumentError(
                    f"plant must move as {plant.environment} does: after action {action} in "
                    f"{before.tolist()}, {name} is {now}, outside of [{box.low[0]}, {box.high[0]}]"
                )
        _check_end(plant, after, n_actions, over)
        if over:
            return


def _check_end(plant: Plant, state: Floats, n_actions: int, over: bool) -> None:
    """Raise InvalidArgumentError unless an episode goes on, or ends, in a state as in the plant."""
    here = [Intervals.of(np.full(n_actions, x)) for x in state]
    ends = plant.ends(here)
    if ends.surely[0] and not over:
        raise InvalidArgumentError(
            f"plant must end as {plant.environment} does: it says that an episode is over in "
            f"{state.tolist()}, where the environment goes on"
        )
    if ends.maybe[0] or not over:
        return
    for one, later in zip(here, plant.step(here, np.arange(n_actions)), strict=True):
        if (later.low != one.low).any() or (later.high != one.high).any():
            raise InvalidArgumentError(
                f"plant must end as {plant.environment} does: that ends in {state.tolist()}, "
                "which has not arrived and which a step of the plant leaves"
            )


MOST_BOXES = 1000  # that a certificate keeps, the largest
SHARE = 0.5  # of the episodes of learning that begin in them


def starts_among(pieces: Pieces, chosen: Booleans) -> Starts | None:
    """Return some pieces of the starts, neighbours along one number joined; None for none."""
    if not chosen.any():
        return None
    low, high = pieces.low[chosen], pieces.high[chosen]
    varies = np.flatnonzero((pieces.high > pieces.low).any(axis=0))
    if varies.size == 1:
        low, high = _joined(low, high, int(varies[0]))
    largest = np.argsort(-(high - low).sum(axis=1), kind="stable")[:MOST_BOXES]
    return Starts(pieces.names, low[largest], high[largest])


def digest_of(certificate: Certificate) -> str:
    """Return the SHA-256 of where episodes begin; empty for a certificate without starts."""
    if (starts := certificate.starts) is None:
        return ""
    return sha256(starts.low.tobytes() + starts.high.tobytes()).hexdigest()


def _joined(low: Floats, high: Floats, along: int) -> tuple[Floats, Floats]:
    """Return boxes of which those that touch along a number are one."""
    order = np.argsort(low[:, along], kind="stable")
    low, high = low[order], high[order]
    begins = np.concatenate([[True], low[1:, along] > high[:-1, along]])
    ends = np.concatenate([begins[1:], [True]])
    return low[begins], high[ends]


class BeginningThere(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment whose episodes begin where certificates say that a proof failed.

    A certificate is drawn, then one of its boxes, all with equal chances, then a state in the box,
    uniformly; all of it follows from the seed of the reset.

    Args:
        env: The environment; a plant must be known for it, which puts it there.
        certificates: Certificates with starts, for example those of all rounds so far.
        share: Share of the episodes that begin there; the others begin as ever.

    Raises:
        InvalidArgumentError: A certificate has no starts, or they are no states of the environment.
    """

    same_task = True  # what is learned from there is meant for all starts

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        certificates: Sequence[Certificate],
        *,
        share: float = 1.0,
    ) -> None:
        super().__init__(env)
        spec = spec_of(env)
        plant = plant_of(spec)
        if plant is None:
            raise InvalidArgumentError(
                f"starts need a plant, which puts an environment there; none is known for {spec}"
            )
        self._plant, self._starts = plant, []
        for certificate in certificates:
            starts = certificate.starts
            if starts is None:
                raise InvalidArgumentError(
                    "certificate must have boxes in which the proof fails or is undecided, got one "
                    f"without any: {certificate}"
                )
            if plant.state != starts.names:
                raise InvalidArgumentError(
                    f"certificate must be of {plant.environment}, whose state is "
                    f"{', '.join(plant.state)}, got starts of {', '.join(starts.names)}"
                )
            self._starts.append(starts)
        self._share = share
        self._generator = np.random.default_rng()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; return its first observation and the environment's info."""
        observation, info = self.env.reset(seed=seed, options=options)
        if seed is not None:
            self._generator = np.random.default_rng(seed)
        if self._generator.random() >= self._share:
            return observation, info
        starts = self._starts[int(self._generator.integers(len(self._starts)))]
        point = starts.draw(self._generator)
        observation = self._plant.put(self.env, point)
        self.env.unwrapped.np_random = self._generator  # putting it there has used the same seed
        return observation, info
