"""Scripted experts: each is a function that makes a policy for an environment.

A policy has SB3's ``predict``; ``eutree.record`` takes the expert itself:
``eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=0)``.
"""

import itertools
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from typing import Any

import numpy as np
from gymnasium import registry, spaces
from numpy.typing import ArrayLike, NDArray

from eutree.envs._scripted import (
    GatePolicy,
    LookAheadPolicy,
    RulePolicy,
    balance,
    brake_upright,
    follow_the_fall,
    look_ahead,
    push_along,
    rock,
    steer_home,
    swing_both,
    swing_elbow,
    swing_upright,
    wait_at_crossing,
    wait_for_the_end,
)
from eutree.errors import UnknownNameError, warn
from eutree.validation import check_integer, check_number, check_seed

__all__ = [
    "EXPERTS", "CarelessPolicy", "Expert", "GatePolicy", "LatePolicy", "LookAheadPolicy",
    "RulePolicy", "all_experts", "balance", "brake_upright", "careless", "experts_for",
    "follow_the_fall", "known_experts", "late", "look_ahead", "push_along", "rock", "steer_home",
    "swing_both", "swing_elbow", "swing_upright", "wait_at_crossing", "wait_for_the_end",
]  # fmt: skip

Expert = Callable[[Any], Any]  # makes a policy (SB3's ``predict``) for an environment

GROUP = "eutree.experts"  # entry points of other distributions: mappings like EXPERTS

_EVASION: Mapping[str, Expert] = {"gate": wait_at_crossing, "look-ahead": look_ahead}
_PAPER_EVASION: Mapping[str, Expert] = {"gate": wait_for_the_end, "look-ahead": look_ahead}

EXPERTS: Mapping[str, Mapping[str, Expert]] = {
    **{f"eutree/Evasion{n}-v0": _EVASION for n in ("", 2, 3, 4)},
    **{f"eutree/PaperEvasion{n}-v0": _PAPER_EVASION for n in (2, 3)},
    "CartPole-v1": {"fall": follow_the_fall, "balance": balance},
    "MountainCar-v0": {"push": push_along, "rock": rock},
    "Acrobot-v1": {"both": swing_both, "elbow": swing_elbow},
    "Pendulum-v1": {"swing": swing_upright},
    "LunarLander-v3": {"brake": brake_upright, "steer": steer_home},
}


def experts_for(environment: str) -> Mapping[str, Expert]:
    """Return the scripted experts of an environment by name; the first is the default one.

    Args:
        environment: Its id, with or without the module to import (``"eutree:..."``).
    """
    if found := known_experts(environment):
        return found
    name = environment.rpartition(":")[2]
    raise UnknownNameError("environment with a scripted expert", name, all_experts())


def known_experts(environment: str) -> Mapping[str, Expert]:
    """Return ``experts_for`` an environment; its latest version if none is named."""
    name = environment.rpartition(":")[2]
    versions = [env.version or 0 for env in registry.values() if env.id == f"{name}-v{env.version}"]
    return all_experts().get(f"{name}-v{max(versions)}" if versions else name, {})


def all_experts() -> Mapping[str, Mapping[str, Expert]]:
    """Return the scripted experts of every environment, with those of other distributions.

    Those of an environment that has some come behind them. A distribution whose experts cannot be
    imported is warned of.
    """
    every = dict(EXPERTS)
    for point in entry_points(group=GROUP):
        try:
            for name, named in point.load().items():
                known = every.get(name, {})
                every[name] = {**known, **{k: v for k, v in named.items() if k not in known}}
        except (Exception, SystemExit) as error:  # a package of another author may raise anything
            warn(f"experts {point.name!r}, {point.value}, cannot be imported: {error}")
    return every


class CarelessPolicy:
    """Takes a random action now and then.

    Args:
        policy: Makes all other decisions.
        choices: The actions to choose from at random: how many there are, or the numbers that each
            of them sets, shape [A, K], of which a policy that answers with such numbers gets a row.
            Whole numbers are the environment's own actions.
        probability: Share of decisions that are random.
        generator: Source of chance.
    """

    def __init__(
        self,
        policy: Any,
        choices: int | NDArray[Any],
        probability: float,
        generator: np.random.Generator,
    ) -> None:
        self.reads_features = bool(getattr(policy, "reads_features", False))
        self._policy = policy
        self._choices = choices
        self._probability = probability
        self._generator = generator

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the policy's action, or a random one, for one observation or each of a batch."""
        actions, state = self._policy.predict(
            observation, state=state, episode_start=episode_start, deterministic=deterministic
        )
        chosen, rows = np.asarray(actions), self._choices
        own = np.asarray(rows).dtype.kind == "i" and not self.reads_features
        # Is the answer a row of numbers that an action sets, and not the action's index?
        if not isinstance(rows, int) and (own or chosen.dtype.kind == "f" or chosen.size > 1):
            if self._generator.random() < self._probability:
                row = rows[self._generator.integers(len(rows))]
                actions = row.astype(chosen.dtype).reshape(chosen.shape)
            return actions, state
        n_actions = rows if isinstance(rows, int) else len(rows)
        is_random = self._generator.random(chosen.shape) < self._probability
        return np.where(
            is_random, self._generator.integers(n_actions, size=chosen.shape), actions
        ), state


class LatePolicy:
    """Acts on the observation of some steps ago; until then the first decision holds.

    The decisions under way are the policy's state: pass back the state that ``predict`` returned,
    as for a recurrent policy of Stable-Baselines3.

    Args:
        policy: Decides at once, on each observation.
        steps: Delay in steps.
    """

    def __init__(self, policy: Any, steps: int) -> None:
        self.reads_features = bool(getattr(policy, "reads_features", False))
        self._policy = policy
        self._steps = steps

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action decided ``steps`` steps ago, for one observation or each of a batch."""
        inner, pending = (None, None) if state is None else state
        chosen, inner = self._policy.predict(
            observation, state=inner, episode_start=episode_start, deterministic=deterministic
        )
        chosen = np.asarray(chosen)
        if pending is None:
            pending = np.broadcast_to(chosen, (self._steps, *chosen.shape))  # [steps, ...]
        elif episode_start is not None:
            pending = np.where(np.asarray(episode_start, dtype=np.bool_), chosen, pending)
        pending = np.concatenate([pending, chosen[None]])
        return pending[0], (inner, pending[1:])


def careless(expert: Expert, probability: float, *, seed: int = 0) -> Expert:
    """Return ``expert`` with a share of its decisions replaced by random actions.

    Args:
        expert: Makes a policy for an environment, as ``wait_at_crossing`` does.
        probability: Share of decisions that are random, in [0, 1].
        seed: Seed of the random actions.
    """
    share = check_number("probability", probability, low=0.0, high=1.0)
    check_seed(seed)

    def make(env: Any) -> CarelessPolicy:
        return CarelessPolicy(expert(env), _choices(env), share, np.random.default_rng(seed))

    make.__name__ = f"careless({_name(expert)}, {share:g})"
    return make


def late(expert: Expert, steps: int) -> Expert:
    """Return ``expert`` with every decision delayed by ``steps`` steps."""
    delay = check_integer("steps", steps, low=0)

    def make(env: Any) -> LatePolicy:
        return LatePolicy(expert(env), delay)

    make.__name__ = f"late({_name(expert)}, {delay})"
    return make


def _choices(env: Any) -> int | NDArray[Any]:
    """Return the actions of an environment as ``CarelessPolicy`` takes them."""
    space = getattr(env, "single_action_space", env.action_space)
    if isinstance(space, spaces.Discrete):
        if space.start:
            return np.arange(space.start, space.start + space.n)[:, np.newaxis]
        try:
            levels = [control.levels for control in env.get_wrapper_attr("controls")]
        except AttributeError:
            return int(space.n)
    elif isinstance(space, spaces.MultiBinary):
        levels = [range(2)] * int(np.prod(space.shape))
    else:
        pairs = zip(np.ravel(space.start), np.ravel(space.nvec), strict=True)
        levels = [range(first, first + size) for first, size in pairs]
    return np.array(list(itertools.product(*levels)))


def _name(expert: Expert) -> str:
    return str(getattr(expert, "__name__", type(expert).__name__))
