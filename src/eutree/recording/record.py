"""Record demonstrations of any controller: a scripted expert, an SB3 model, a tree."""

from collections.abc import Callable
from pathlib import Path

from eutree.data import DemonstrationFolder, Demonstrations, Episode
from eutree.files import check_new_folder
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.acting import Controller, as_policy
from eutree.interaction.deriving import acting_for
from eutree.interaction.episode import Stream
from eutree.interaction.first_look import look_at
from eutree.interaction.making import Environment, opened
from eutree.validation import check_integer, check_seed


def record(
    env: Environment,
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
        env: The environment, its id, or how to make it.
        controller: Anything with SB3's ``predict``; a function that makes such a thing for the
            environment, like ``eutree.experts.wait_at_crossing``; or a function from an observation
            to an action. Of an action that sets quantities it may answer with the number, an
            integer, or with the quantities, floats: the nearest levels are recorded.
        episodes: How many to record.
        seed: Seed of the recording; episode k is seeded with ``episode_seed(seed, k, 1)``.
        strict: Refuse observations outside the observation space.
        out: A new folder, as ``Demonstrations.save`` makes it, in which each episode is written
            when it ends: an early end of the recording costs only the episode under way.
        on_episode: Called after each episode with its number and the episode.

    Raises:
        EnvironmentFault: The environment broke its contract.
        FileError: ``out`` is not empty, or cannot be written.
    """
    count = check_integer("episodes", episodes, low=1)
    check_seed(seed)
    with opened(env) as given:
        guarded = GuardedEnv(acting_for(given, controller, "controller"), strict=strict)
        look_at(given, episode_seed(seed, 0, Stream.RECORDING))
        policy = as_policy(controller, given)
        name = str(getattr(controller, "__name__", type(controller).__name__))
        if out is not None:
            check_new_folder(out)
        folder = None  # made with its first episode: nothing is left of a controller that has none
        recorded = []
        for number in range(count):
            episode = run_episode(guarded, policy, episode_seed(seed, number, Stream.RECORDING))
            if out is not None:
                folder = folder or DemonstrationFolder.create(
                    out, guarded.schema, guarded.spec, name
                )
                folder.write(number, episode)
            recorded.append(episode)
            if on_episode is not None:
                on_episode(number, episode)
    return Demonstrations(tuple(recorded), guarded.schema, guarded.spec, expert=name)


def play(policy: Controller, env: Environment, *, seed: int | None = None) -> Episode:
    """Let a policy act in an environment for one episode, and return the episode.

    A tree gets the features that it needs, the past included, whichever form the observations have,
    and its quantities reach the environment in the form of its action space. To watch it,
    make the environment with ``render_mode="human"``.

    Args:
        policy: As ``record`` takes it.
        env: The environment, its id, or how to make it.
        seed: Seed of the reset; None goes on with the environment's own chance.

    Raises:
        EnvironmentFault: The environment broke its contract.
    """
    if seed is not None:
        check_seed(seed)
    with opened(env) as given:
        guarded = GuardedEnv(acting_for(given, policy, "policy"))
        return run_episode(guarded, as_policy(policy, given), seed)
