"""Record demonstrations of any controller: a scripted expert, an SB3 model, a tree."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium

from eutree.data import DemonstrationFolder, Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.files import check_new_folder
from eutree.interaction.decoding import warn_of_codes
from eutree.interaction.episode import run_episode
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.seeding import Stream, episode_seed
from eutree.policies import Policy
from eutree.validation import check_integer, check_seed

Controller = Policy | Callable[[gymnasium.Env[Any, Any]], Policy]


def record(
    env: gymnasium.Env[Any, Any],
    controller: Controller,
    *,
    episodes: int = 15,
    seed: int = 0,
    strict: bool = False,
    out: str | Path | None = None,
    on_episode: Callable[[int, Episode], None] | None = None,
) -> Demonstrations:
    """Record episodes of ``controller`` acting in ``env``.

    Args:
        env: The environment.
        controller: Anything with SB3's ``predict``, or a function that makes such a thing for
            the environment, like ``eutree.experts.wait_at_crossing``.
        episodes: How many.
        seed: Seed of the recording; episode k is seeded with ``episode_seed(seed, k, 1)``.
        strict: Refuse observations outside the observation space.
        out: A new folder, as ``Demonstrations.save`` makes it, in which each episode is written
            when it ends: what ends the recording costs the episode under way and no other.
        on_episode: Called after each episode with its number and the episode.

    Raises:
        EnvironmentFault: The environment broke its contract.
        FileError: ``out`` is not empty, or cannot be written.
    """
    count = check_integer("episodes", episodes, low=1)
    check_seed(seed)
    guarded = GuardedEnv(env, strict=strict)
    warn_of_codes(env)
    policy = as_policy(controller, env)
    name = str(getattr(controller, "__name__", type(controller).__name__))
    folder = None
    if out is not None:
        check_new_folder(out)
        folder = DemonstrationFolder.create(out, guarded.schema, guarded.spec, name)
    recorded = []
    for number in range(count):
        episode = run_episode(guarded, policy, episode_seed(seed, number, Stream.RECORDING))
        if folder is not None:
            folder.write(number, episode)
        recorded.append(episode)
        if on_episode is not None:
            on_episode(number, episode)
    return Demonstrations(tuple(recorded), guarded.schema, guarded.spec, expert=name)


def trained_steps(controller: object) -> int | None:
    """Return the environment steps of a controller's training, if it counts them, as SB3 does."""
    own = getattr(controller, "num_timesteps", None)
    return own if isinstance(own, int) and own >= 0 else None


def as_policy(controller: Controller, env: gymnasium.Env[Any, Any]) -> Policy:
    """Return ``controller`` if it has ``predict``, else what it makes for ``env``."""
    if hasattr(controller, "predict"):
        return controller
    if not callable(controller):
        raise InvalidArgumentError(
            f"controller must have a method predict or be a function of an environment, "
            f"got {controller!r}"
        )
    policy = controller(env)
    if not hasattr(policy, "predict"):
        raise InvalidArgumentError(f"controller(env) must have a method predict, got {policy!r}")
    return policy
