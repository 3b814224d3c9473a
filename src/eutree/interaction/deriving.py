"""Derived features: numbers made of several of an environment's own, ``distance / speed``.

A tree asks for one number at a test; a ratio, a difference or a minimum takes it a staircase of
tests. A person who knows the task declares such a number once (:mod:`eutree.formulas`). The
declaration goes with the schema into demonstrations and policies, so that a policy derives its
features itself where an environment does not, and exports compute them.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.features import Derivation
from eutree.interaction.action_grid import name_of, with_grid_of
from eutree.interaction.spaces import describe, encoder
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema


class DerivedObservation(
    gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs
):
    """An environment that observes derived features behind its own.

    Args:
        env: Any environment with a flat observation.
        declarations: ``"time_to_crossing = distance / speed"`` and the like.
        names: A schema whose names the declarations use, where the environment has none.

    Attributes:
        schema: Its features and its actions.

    Raises:
        InvalidArgumentError: A declaration is none, or its name is taken.
        UnknownNameError: A formula names no feature before it.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        declarations: Sequence[str | Feature],
        *,
        names: Schema | None = None,
    ) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(
            self, declarations=list(declarations), names=names
        )
        super().__init__(env)
        measured = describe(env)
        self.schema = (measured if names is None else measured.with_names_of(names)).derive(
            declarations
        )
        self._encode = encoder(env.observation_space)
        self._derivation = Derivation.of(self.schema)
        self._before: Floats | None = None
        bounds = [(feature.low, feature.high) for feature in self.schema.features]
        low, high = np.array(bounds, dtype=np.float64).T
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; ``last`` values are those of its first observation."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._before = None
        return self._derived(observation), info

    def step(self, action: Any) -> tuple[Floats, Any, bool, bool, dict[str, Any]]:
        """Take one step."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._derived(observation), reward, terminated, truncated, info

    def _derived(self, observation: Any) -> Floats:
        self._before = self._derivation.rows(self._encode(observation), self._before)
        return self._before


def acting_as(env: gymnasium.Env[Any, Any], known: object) -> gymnasium.Env[Any, Any]:
    """Return ``env`` with the grid and the derived features that are known, where it has none.

    So a tree that chooses among levels can act where nobody has named any, and one that asks for a
    derived feature where nobody has declared it. ``known`` is a policy or demonstrations, whose
    schema names both; or anything.

    Raises:
        InvalidArgumentError: The environment has a grid of other levels, or other formulas.
    """
    schema = getattr(known, "schema", None)
    if not isinstance(schema, Schema):
        return env
    env = with_grid_of(env, schema)
    observed = describe(env)
    first = schema.measured.n_features + len(observed.derived)
    names = replace(schema, features=schema.features[:first])
    if observed.with_names_of(names).feature_names != names.feature_names:
        return env  # a comparison of the names reports the error
    if Derivation.of(observed).formulas != Derivation.of(names).formulas:
        mine, theirs = ([one.formula for one in of.derived] for of in (observed, names))
        raise InvalidArgumentError(
            f"derived features must be computed as those of the environment, {mine}, got {theirs}"
        )
    more = schema.derived[len(observed.derived) :]
    return DerivedObservation(env, more, names=names) if more else env


def acting_for(env: gymnasium.Env[Any, Any], policy: object, what: str) -> gymnasium.Env[Any, Any]:
    """Return ``acting_as(env, policy)``, unless that is a tree of another task.

    Raises:
        InvalidArgumentError: Its features or actions are others; ``what`` names the policy.
    """
    env = acting_as(env, policy)
    if isinstance(policy, TreePolicy):
        wanted = describe(env).with_history(policy.history, policy.past_actions)
        wanted.check_same(policy.schema, what, of=name_of(env), either=True)
    return env
