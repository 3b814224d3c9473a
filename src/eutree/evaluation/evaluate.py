"""Evaluate a frozen policy over many episodes, each with a seed of its own.

Episode k is reset with ``episode_seed(seed, k)``: it is the same episode for every policy and every
number of episodes. Where the environment has a vector form that promises the very episodes of the
single one (``"same_episodes_as_single"`` in its metadata) and the policy decides batches, up to 256
episodes run side by side, with results that are equal bit for bit. So the episodes can be divided
among processes, too: each makes an environment of its own.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError, shown
from eutree.evaluation.evaluation import Evaluation, known_successes
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.acting import Controller, as_policy
from eutree.interaction.deriving import acting_for
from eutree.interaction.episode import ending_of, success_of
from eutree.interaction.making import Environment, Recipe, made
from eutree.parallel import Workers
from eutree.policies import Policy
from eutree.schema import EnvironmentSpec
from eutree.validation import check_integer, check_seed


def run_batch(policy: Policy, vector: Any, seeds: Sequence[int]) -> Evaluation | None:
    """Run one episode in each copy, seeded one by one; None if the policy decides no batches.

    The vector environment takes a list of seeds, which Gymnasium's type annotations do not know.

    A copy that has ended goes on with a next episode until the last one has; that is ignored.
    """
    copies = len(seeds)
    observations, _ = vector.reset(seed=list(seeds))
    first = _first_actions(policy, observations)
    if first is None:
        return None
    actions, state = first
    lengths = np.zeros(copies, np.int64)  # [E] 0 while the episode runs
    successes: list[Any] = [None] * copies
    endings: list[str] = [""] * copies
    rewards: list[Floats] = []  # of each step, [E]
    starts = np.zeros(copies, dtype=bool)
    while True:
        observations, reward, terminated, truncated, info = vector.step(actions)
        rewards.append(reward)
        for copy in np.flatnonzero((terminated | truncated) & (lengths == 0)).tolist():
            lengths[copy] = len(rewards)
            own = {key: _of(info, key, copy) for key in ("is_success", "ending")}
            successes[copy] = success_of(own)
            endings[copy] = ending_of(own, terminated=bool(terminated[copy]))
        if lengths.all():
            break
        actions, state = policy.predict(
            observations, state=state, episode_start=starts, deterministic=True
        )
    return Evaluation(
        returns=_sums(np.array(rewards), lengths),
        lengths=lengths,
        endings=np.array(endings),
        successes=known_successes(successes),
        n_leaves=getattr(policy, "n_leaves", None),
    )


def _first_actions(policy: Policy, observations: Floats) -> tuple[Integers, Any] | None:
    """Return the policy's first decisions, or None if it takes single observations only."""
    starts = np.ones(len(observations), dtype=bool)
    if observations.shape[0] == observations.shape[1]:  # an answer's shape would tell nothing
        return None
    try:
        actions, state = policy.predict(
            observations, state=None, episode_start=starts, deterministic=True
        )
    except Exception:
        # A real fault of the policy will show on a single observation.
        return None
    actions = np.asarray(actions)
    if actions.shape != (len(observations),) or actions.dtype.kind not in "iu":
        return None
    return actions, state


def _of(info: dict[str, Any], key: str, copy: int) -> Any:
    """Return the entry of one copy; None if it has none."""
    if key not in info or not info.get(f"_{key}", {copy: True})[copy]:
        return None
    return info[key][copy]


def _sums(rewards: Floats, lengths: Integers) -> Floats:
    """Return the sum over each episode; added up as for a single episode, so bit for bit."""
    by_copy = np.ascontiguousarray(rewards.T)  # [E, T]
    return np.array([row[:n].sum() for row, n in zip(by_copy, lengths.tolist(), strict=True)])


MAX_COPIES = 256

MakeVector = Callable[[int], gymnasium.vector.VectorEnv[Any, Any, Any]]


def evaluate(
    policy: Controller,
    environment: Environment,
    *,
    episodes: int = 100,
    seed: int = 0,
    environment_arguments: Mapping[str, Any] | None = None,
    n_jobs: int | None = None,
) -> Evaluation:
    """Return how ``policy`` does over episodes seeded with ``episode_seed(seed, k)``.

    Args:
        policy: As ``eutree.record`` takes it: anything with SB3's ``predict``, or a function. A
            tree that sets quantities can be evaluated where nobody has named levels, too.
        environment: An environment, its id, or how to make it.
        episodes: Number of episodes.
        seed: Seed of the evaluation.
        environment_arguments: Passed to ``gymnasium.make``, with an id or a spec.
        n_jobs: Processes, as joblib counts them (-1 for all cores), with an id or a spec: each
            makes an environment of its own. The result is the same, bit for bit, unless the policy
            itself draws lots. None is 1, unless ``joblib.parallel_config`` says otherwise.

    Raises:
        EnvironmentFault: The environment broke its contract.
    """
    workers = Workers(n_jobs)
    episodes = check_integer("episodes", episodes, low=1)
    check_seed(seed)
    seeds = [episode_seed(seed, k) for k in range(episodes)]
    if isinstance(environment, gymnasium.Env):
        if environment_arguments:
            raise InvalidArgumentError(
                "environment_arguments must be empty for an environment that is made already, "
                f"got {dict(environment_arguments)}"
            )
        return _evaluate(policy, made(environment, n_jobs)[0], seeds)
    env, spec = made(_spec(environment, environment_arguments), n_jobs)
    with closing(env):
        if spec is None:
            return _evaluate(policy, env, seeds)
        block = partial(_evaluated_block, policy, Recipe.of(spec), seeds)
        return Evaluation.join(workers.map(block, workers.blocks(episodes, MAX_COPIES)))


def evaluate_starts(
    policy: Policy, env: gymnasium.Env[Any, Any], starts: Sequence[int], *, seed: int
) -> Evaluation:
    """Return how ``policy`` does from some of the starts of an evaluation with this seed.

    The starts ascend; episode k has ``episode_seed(seed, k)``.
    """
    return _evaluate(policy, env, [episode_seed(seed, k) for k in starts], first=starts[0])


def _evaluated_block(
    policy: Controller, recipe: Recipe, seeds: Sequence[int], numbers: range
) -> Evaluation:
    """Evaluate some of the episodes, in whichever process."""
    with closing(recipe.make()) as env:
        return _evaluate(policy, env, seeds[numbers.start : numbers.stop], first=numbers.start)


def _spec(environment: Environment, more: Mapping[str, Any] | None) -> EnvironmentSpec:
    if not isinstance(environment, EnvironmentSpec | str):
        raise InvalidArgumentError(
            f"environment must be a gymnasium.Env, an id or an EnvironmentSpec, "
            f"got {shown(environment)}"
        )
    spec = EnvironmentSpec(environment) if isinstance(environment, str) else environment
    return spec.override(more or {})


def _evaluate(
    controller: Controller, env: gymnasium.Env[Any, Any], seeds: Sequence[int], *, first: int = 0
) -> Evaluation:
    """Evaluate the episodes of these seeds, numbered from ``first``."""
    policy = as_policy(controller, env)
    env = acting_for(env, policy, "policy")
    together = _side_by_side(policy, env, seeds) if len(seeds) > 1 else None
    if together is not None:
        return together
    guarded = GuardedEnv(env)
    guarded.episode += first  # a fault is to name the episode by its number
    run = [run_episode(guarded, policy, seed) for seed in seeds]
    return Evaluation.of(run, getattr(policy, "n_leaves", None))


def _side_by_side(
    policy: Policy, env: gymnasium.Env[Any, Any], seeds: Sequence[int]
) -> Evaluation | None:
    """Evaluate many episodes at once; None if the environment or the policy does not allow it."""
    make_copies = vector_form(env)
    if make_copies is None:
        return None
    parts = []
    for first in range(0, len(seeds), MAX_COPIES):
        block = seeds[first : first + MAX_COPIES]
        vector = make_copies(len(block))
        part = run_batch(policy, vector, block) if same_parameters(vector, env) else None
        if part is None:
            return None
        parts.append(part)
    return Evaluation.join(parts)


def vector_form(env: gymnasium.Env[Any, Any]) -> MakeVector | None:
    """Return the maker of copies of ``env`` with the same episodes; None if there is none.

    An environment that is watched, or wrapped in more than Gymnasium's own checks, has none: the
    copies would lack the wrapper.
    """
    inner = env
    while isinstance(inner, OrderEnforcing | PassiveEnvChecker):
        inner = inner.env
    spec = env.spec
    if inner is not env.unwrapped or env.render_mode is not None or spec is None:
        return None
    if spec.vector_entry_point is None:
        return None
    creator: Any = spec.vector_entry_point
    creator = load_env_creator(creator) if isinstance(creator, str) else creator
    if not getattr(creator, "metadata", {}).get("same_episodes_as_single", False):
        return None
    # Only the first episode of each copy is looked at, as ``run_batch`` does.
    arguments = {**spec.kwargs, "render_mode": None, "goes_on": False}
    return lambda copies: creator(copies, **arguments)


def same_parameters(vector: Any, env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether the environment still has the parameters of its spec."""
    return bool(vector.parameters == getattr(env.unwrapped, "parameters", None))
