"""The border between an environment and everything that learns or records.

All answers are checked: observations are finite vectors of the right length and are copied
(so an environment may reuse its buffer), rewards are finite numbers, ``step`` returns five values,
episodes end. Anything else raises ``EnvironmentFault`` with environment, episode, step and value.
"""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Booleans, Floats
from eutree.errors import (
    EnvironmentFault,
    EutreeError,
    InvalidArgumentError,
    described,
    interrupt_again,
    shown,
    warn,
)
from eutree.features import FeatureMap
from eutree.interaction.action_grid import (
    ActionMasks,
    counts_from_zero,
    grid_around,
    name_of,
    numbered,
)
from eutree.interaction.making import OwnFolder
from eutree.interaction.spaces import decoder, derived_around, describe, encoder, spec_of
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.validation import check_integer, check_kind

MAX_EPISODE_STEPS = 100_000
_OLD = "that of the old gym; shimmy.GymV21CompatibilityV0(env=env) makes the new one of it"
_OLD_RESET = f". A reset without seed and info is {_OLD}"
_OLD_STEP = f". A step of four values is {_OLD}"
_VECTOR = (
    ". Of several rewards one is made by mo_gymnasium.wrappers.LinearReward(env, weight=...), or "
    "by gymnasium.wrappers.TransformReward"
)
LARGEST = 1e100  # of an observation or a reward; sums and squares of such numbers are finite


class GuardedEnv:
    """An environment whose every answer has been checked.

    Args:
        env: Any Gymnasium environment with a flat observation and finitely many actions: Discrete,
            MultiDiscrete, MultiBinary, or a Box behind a ``GriddedAction``.
        strict: Refuse observations outside the observation space instead of warning once.
        max_episode_steps: An episode longer than this is a fault (it would never end).
        history: Number of previous observations to append to each observation.
        past_actions: Number of previous actions to append to these (see ``FeatureMap``).

    Attributes:
        env: The environment itself.
        schema: Names, units and bounds of its observations, history included; names of its
            actions.
        features: The map from observations and the past to the features of ``reset`` and ``step``.
        own_size: Numbers that the environment itself observes: derived features are left out.
        spec: How to make it again, if known.
        episode: Number of the present episode; -1 before the first.
        step_number: Number of steps taken in the present episode.
        allowed: Which actions are allowed now, shape [A], where the environment says so by
            ``info["action_mask"]`` or a method ``action_masks``; None where all are.
        masks: Reads that, and says it as the environment does.

    Raises:
        UnsupportedSpaceError: A tree cannot act in its spaces.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        *,
        strict: bool = False,
        max_episode_steps: int = MAX_EPISODE_STEPS,
        history: int = 0,
        past_actions: int = 0,
    ) -> None:
        if not isinstance(env, gymnasium.Env):
            raise InvalidArgumentError(f"env must be a gymnasium.Env, got {env!r}")
        self.env = env
        own = describe(env)
        self.schema: Schema = own.with_history(history, past_actions)
        self.features = FeatureMap(
            n_observed=own.n_features,
            n_actions=own.n_actions,
            observations=history,
            actions=past_actions,
        )
        self.spec: EnvironmentSpec | None = spec_of(env)
        self.name = name_of(env)
        self.episode = -1
        self.step_number = 0
        self._seed: int | None = None
        self._numbered = numbered(env)
        self._folder = OwnFolder(env)
        self._grid = grid_around(self._numbered)
        self._counts_itself = not counts_from_zero(env.action_space)
        self._encode = encoder(env.observation_space)
        derived = derived_around(env)
        self.own_size = own.measured.n_features
        self._decode = decoder((env if derived is None else derived.env).observation_space)
        self._strict = check_kind("strict", strict, bool)
        self._warned = False
        self._limit = check_integer("max_episode_steps", max_episode_steps, low=1)
        self._own_features = own.features
        self.allowed: Booleans | None = None
        self.masks = ActionMasks(env)

    def reset(self, seed: int | None = None) -> Floats:
        """Begin an episode and return its first observation, shape [d]."""
        self.episode += 1
        self.step_number, self._seed = -1, seed
        answer = self._answer(
            lambda: self.env.reset(seed=seed), f"reset(seed={seed})", "'seed'", _OLD_RESET
        )
        if not (isinstance(answer, tuple) and len(answer) == 2):
            raise self._fault(
                f"reset must return (observation, info), got {_brief(answer)}{_OLD_RESET}"
            )
        self._check_info(answer[1])
        observation = self._observation(answer[0])
        self.allowed = self._allowed(answer[1])
        self.step_number = 0
        if self.features.is_identity:
            return observation
        self._seen = self.features.first(observation)
        return self._seen

    def step(self, action: int) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Take one step; return observation, reward, terminated, truncated and info."""
        if not 0 <= action < self.schema.n_actions:
            raise InvalidArgumentError(
                f"action must be in 0..{self.schema.n_actions - 1}, got {action!r}"
            )
        if self.allowed is not None and not self.allowed[action]:
            raise InvalidArgumentError(
                f"action must be one that the environment allows, "
                f"{', '.join(np.array(self.schema.actions)[self.allowed])}, got "
                f"{self.schema.actions[action]}"
            )
        answer = self._answer(
            lambda: self._numbered.step(action), "step", "(expected 5, got 4)", _OLD_STEP
        )
        if not (isinstance(answer, tuple) and len(answer) == 5):
            old = isinstance(answer, tuple) and len(answer) == 4
            raise self._fault(
                "step must return (observation, reward, terminated, truncated, info), "
                f"got {_brief(answer)}{_OLD_STEP if old else ''}"
            )
        observation = self._observation(answer[0])
        reward = self._reward(answer[1])
        terminated = self._flag("terminated", answer[2])
        truncated = self._flag("truncated", answer[3])
        self._check_info(answer[4])
        self.allowed = None if terminated or truncated else self._allowed(answer[4])
        self.step_number += 1
        if self.step_number >= self._limit and not (terminated or truncated):
            raise self._fault(
                f"the episode has not ended after {self._limit} steps; "
                "make the environment with a time limit: --env-arg max_episode_steps=N, or "
                "gymnasium.make(..., max_episode_steps=N)"
            )
        if not self.features.is_identity:
            self._seen = observation = self.features.next(self._seen, action, observation)
        return observation, reward, terminated, truncated, answer[4]

    def _answer(self, ask: Callable[[], Any], asked: str, sign: str, hint: str) -> Any:
        """Return an environment's answer; a hint follows errors that have its sign."""
        try:
            with self._folder:
                answer = ask()
            interrupt_again()
            return answer
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # no environment may end the process
            said = described(error)
            raise self._fault(f"{asked} raised {said}{hint * (sign in said)}") from error

    def picture(self, render: Callable[[], Any] | None = None) -> NDArray[np.uint8]:
        """Return a picture, shape [height, width, 3].

        Args:
            render: Draws it; by default the environment's own ``render``.

        Raises:
            EnvironmentFault: The environment draws no picture.
        """
        try:
            pixels = np.asarray((render or self.env.render)())
        except (EutreeError, KeyboardInterrupt):
            raise
        except BaseException as error:  # no environment may end the process
            raise self._fault(f"render raised {described(error)}") from error
        if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype != np.uint8:
            raise self._fault(
                "render must return an image [height, width, 3] of uint8, got "
                f"shape {pixels.shape} of {pixels.dtype}"
            )
        return pixels

    def number_of(self, answer: Any, name: str, *, own: bool) -> int:
        """Return the number of the action that an answer means; see ``GriddedAction.number_of``.

        Args:
            answer: One number, or one for each quantity that the actions set.
            name: The place where it came from, for the messages.
            own: Whether it was made for the environment's own action space.

        Raises:
            InvalidArgumentError: It means no action.
        """
        if self._grid is not None:
            return self._grid.number_of(answer, name, own=own and self._counts_itself)
        array = np.asarray(answer)
        number = array.reshape(-1)[0] if array.size == 1 and array.dtype.kind in "iubf" else None
        if number is None or number != np.floor(number):
            raise InvalidArgumentError(
                f"{name} must be one action, a whole number, for one observation, "
                f"got {shown(answer)}"
            )
        return int(number)

    def take_names(self, schema: Schema) -> None:
        """Call features and actions that have no names of their own as ``schema`` does."""
        self.schema = self.schema.with_names_of(schema)

    def own_observation(self, features: Floats) -> Any:
        """Return the environment's own observation, an element of its space.

        Args:
            features: The features of ``reset`` or ``step``, shape [d]; those of the past and the
                derived ones are left out.
        """
        return self._decode(features[: self.own_size])

    @property
    def history(self) -> int:
        """Number of previous observations in each observation."""
        return self.features.observations

    def _observation(self, value: Any) -> Floats:
        try:
            vector = self._encode(value)
        except (TypeError, ValueError, KeyError, IndexError, OverflowError) as error:
            raise self._fault(
                f"observation must be of {self.env.observation_space}, "
                f"got {_brief(value)} ({error})"
            ) from None
        size = len(self._own_features)
        if vector.shape != (size,):
            raise self._fault(f"observation must have shape ({size},), got {vector.shape}")
        numbers: list[float] = vector.tolist()
        for number in numbers:
            if not -LARGEST <= number <= LARGEST:  # of NaN neither is true
                raise self._fault(_finite("observation", numbers))
        for feature, number in zip(self._own_features, numbers, strict=True):
            if not feature.low <= number <= feature.high:
                self._outside(feature, number)
        return vector

    def _outside(self, feature: Feature, number: float) -> None:
        """Warn once of a number outside the space, or fault."""
        message = (
            f"observation {feature.name!r} must be in [{feature.low:g}, {feature.high:g}], "
            f"the environment's own bounds, got {number!r}"
        )
        if self._strict:
            raise self._fault(message)
        if not self._warned:
            self._warned = True
            warn(f"{self.name}: {message} (said once)")

    def _reward(self, value: Any) -> float:
        if isinstance(value, str | bytes | bool | np.bool_ | complex) or np.ndim(value):
            hint = _VECTOR if np.ndim(value) == 1 else ""
            raise self._fault(f"reward must be a finite number, got {_brief(value)}{hint}")
        try:
            reward = float(value)
        except (TypeError, ValueError, OverflowError):
            raise self._fault(f"reward must be a finite number, got {_brief(value)}") from None
        if not -LARGEST <= reward <= LARGEST:
            raise self._fault(_finite("reward", reward))
        return reward

    def _flag(self, name: str, value: Any) -> bool:
        if not isinstance(value, bool | np.bool_):
            raise self._fault(f"{name} must be a bool, got {_brief(value)}")
        return bool(value)

    def _check_info(self, info: Any) -> None:
        """Fault unless ``info`` is a dict; its entries must be of the types assumed here."""
        if not isinstance(info, dict):
            raise self._fault(f"info must be a dict, got {_brief(info)}")
        success = info.get("is_success")
        if success is None or isinstance(success, bool | np.bool_):
            return
        is_number = isinstance(success, int | float | np.number | np.ndarray)
        if np.ndim(success) or not is_number or success not in (0, 1):
            raise self._fault(
                f"info['is_success'] must be True or False (or 1 or 0), got {_brief(success)}"
            )

    def _allowed(self, info: dict[str, Any]) -> Booleans | None:
        """Return which actions are allowed, shape [A]; None where nothing is said of it."""
        try:
            return self.masks.now(info)
        except InvalidArgumentError as error:
            raise self._fault(str(error)) from None

    def _fault(self, reason: str) -> EnvironmentFault:
        return EnvironmentFault(self.name, self.episode, self.step_number, reason, self._seed)


def _finite(name: str, value: object) -> str:
    kind = "a finite number" if name == "reward" else "finite"
    return f"{name} must be {kind} of at most {LARGEST:g} in size, got {value}"


def _brief(value: object) -> str:
    """Return a description of ``value``, in at most about 100 characters."""
    if isinstance(value, tuple):
        return f"a tuple of {len(value)} values"
    return " ".join(shown(value).split())
