"""Many copies of N-Evasion moved by one compiled loop."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.envs import _dynamics as dynamics
from eutree.envs import _kernels as kernels
from eutree.envs._dynamics import ENDINGS, GOAL, RUNNING, TIME_LIMIT, EvasionParameters
from eutree.envs.evasion import features, observation_space
from eutree.errors import InvalidArgumentError, shown
from eutree.validation import check_integer, check_seed

_ENDING_NAMES = np.array([None, *ENDINGS[1:]], dtype=object)


class _FirstDraws:
    """The draws of a seed's generator for its first episode, in place of the generator."""

    def __init__(self, uniforms: Floats, noise: Floats) -> None:
        self._uniforms, self._noise = uniforms, noise

    def random(self, out: Floats) -> None:
        out[:] = self._uniforms

    def standard_normal(self, out: Floats) -> None:
        out[:] = self._noise


@lru_cache(maxsize=8192)  # common episodes of many trees begin with the same seeds again and again
def _first_draws(seed: int, uniforms: tuple[int, ...], noise: tuple[int, ...]) -> _FirstDraws:
    generator, _ = seeding.np_random(seed)
    return _FirstDraws(generator.random(uniforms), generator.standard_normal(noise))


class EvasionVectorEnv(VectorEnv[Floats, Integers, Any]):
    """``num_envs`` copies of ``EvasionEnv``, with its episodes bit for bit.

    With the same seed per copy, each copy goes through the episodes of a single environment that
    was reset with that seed once and afterwards without one. A copy whose episode has ended
    begins the next at the following step, which ignores its action, gives reward 0 and returns
    the reset observation (Gymnasium's ``AutoresetMode.NEXT_STEP``).

    Args:
        num_envs: Number of copies E.
        render_mode: None; a vector environment draws no pictures.
        goes_on: False where nobody looks at a copy after its episode: it then goes through the same
            one again, for which nothing has to be drawn.
        arguments: As of ``EvasionEnv``.
    """

    metadata = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "same_episodes_as_single": True,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        render_mode: str | None = None,
        goes_on: bool = True,
        **arguments: Any,
    ) -> None:
        if render_mode is not None:
            raise InvalidArgumentError(
                f"render_mode must be None for a vector environment, got {render_mode!r}"
            )
        self.parameters = EvasionParameters.from_arguments(arguments)
        self.num_envs = check_integer("num_envs", num_envs, low=1)
        self.render_mode = None
        self._goes_on = goes_on
        self.single_observation_space = observation_space(self.parameters)
        self.single_action_space = spaces.Discrete(2)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.feature_names, self.feature_units = features(self.parameters)
        self.action_names = ("stop", "go")
        copies, count = self.num_envs, self.parameters.n_opponents
        constants = [getattr(self.parameters, name) for name in kernels.CONSTANTS]
        self._copies = kernels.Copies(
            constants=np.array(constants, dtype=np.float64),
            crossing=self.parameters.crossing,
            uniforms=np.zeros((copies, 2 * count)),
            noise=np.zeros((copies, self.parameters.max_steps, count + 1)),
            positions=np.zeros(copies),
            opponents=np.zeros((copies, count)),
            directions=np.zeros((copies, count)),
            steps=np.zeros(copies, dtype=np.int64),
        )
        self._waiting = np.ones(copies, dtype=np.bool_)  # [E] to begin an episode at the next step
        # Methods and slices looked up once: that costs as much as the shorter of the draws.
        self._draws: list[Any] = [None] * copies

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode in every copy.

        Args:
            seed: One seed per copy (None keeps its generator), or an int s for s, s + 1, ...
            options: None are known; copies cannot be reset apart.
        """
        if options and "reset_mask" in options:
            raise InvalidArgumentError(f"options must have no reset_mask, got {shown(options)}")
        self._seed(seed)
        every = np.ones(self.num_envs, dtype=np.bool_)
        self._draw(every)
        observations, *_ = self._advance(np.zeros(self.num_envs, dtype=np.int64), every)
        return observations, {}

    def step(self, actions: Integers) -> tuple[Floats, Floats, Booleans, Booleans, dict[str, Any]]:
        """Take one step in every copy; return observations [E, d], rewards, flags [E] and info."""
        if self._draws[0] is None:
            raise ResetNeeded("call reset for every copy before anything else")
        actions = dynamics.as_actions(actions, self.num_envs)
        began = self._waiting
        if self._goes_on:
            self._draw(began)
        observations, rewards, endings = self._advance(actions, began)
        info: dict[str, Any] = {"is_success": endings == GOAL, "_is_success": ~began}
        if self._waiting.any():
            info["ending"] = _ENDING_NAMES[endings]
            info["_ending"] = self._waiting.copy()
        truncated = endings == TIME_LIMIT
        return observations, rewards, self._waiting & ~truncated, truncated, info

    def _draw(self, chosen: Booleans) -> None:
        """Draw the next episode of the chosen copies, as ``_dynamics.draw`` does for one."""
        for e in np.flatnonzero(chosen).tolist():
            draw_uniforms, uniforms, draw_normals, noise = self._draws[e]
            draw_uniforms(out=uniforms)
            draw_normals(out=noise)

    def _seed(self, seed: int | Sequence[int | None] | None) -> None:
        """Give each copy a new generator; None keeps the one it has."""
        if seed is None or isinstance(seed, int | np.integer):
            first = None if seed is None else check_seed(seed)
            seeds = [None if first is None else first + e for e in range(self.num_envs)]
        else:
            seeds = [None if one is None else check_seed(one) for one in seed]
        if len(seeds) != self.num_envs:
            raise InvalidArgumentError(
                f"seed must hold one seed for each of the {self.num_envs} copies, got {len(seeds)}"
            )
        for e in range(self.num_envs):
            if seeds[e] is not None or self._draws[e] is None:
                uniforms, noise = self._copies.uniforms[e], self._copies.noise[e]
                generator: Any = None
                if self._goes_on or seeds[e] is None:
                    generator, _ = seeding.np_random(seeds[e])
                else:
                    generator = _first_draws(seeds[e], uniforms.shape, noise.shape)
                self._draws[e] = (generator.random, uniforms, generator.standard_normal, noise)

    def _advance(self, actions: Integers, begins: Booleans) -> tuple[Floats, Floats, Int32s]:
        """Move each copy or begin its episode; return observations, rewards and endings."""
        observations = np.empty((self.num_envs, self.parameters.n_features))
        rewards, endings = np.empty(self.num_envs), np.empty(self.num_envs, dtype=np.int32)
        steps = self.parameters.max_steps
        kernels.advance_all(actions, begins, steps, self._copies, observations, rewards, endings)
        self._waiting = endings != RUNNING
        return observations, rewards, endings
