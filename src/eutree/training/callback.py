"""Callbacks of Stable-Baselines3, and functions, follow a run and may end it.

``eutree.learn(env, callback=...)`` takes a function of ``(locals, globals)``, an object with some
of the methods that SB3's callbacks have, or a list of them. What SB3 calls a rollout is a gathering
phase here, and ``model`` is the run as a ``TrainingModel``: a callback that derives from SB3's
``BaseCallback`` works where it asks the model for nothing else.

What a callback does changes nothing that is learned; only ending the run does. Its memory is no
part of a checkpoint.
"""

from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import gymnasium
from numpy.typing import ArrayLike

from eutree.errors import InvalidArgumentError, shown
from eutree.learners import Step
from eutree.policies import TreePolicy
from eutree.training.listeners import Listener
from eutree.training.run import Run


class Logger:
    """What callbacks record: it stands in the next row of ``progress.csv`` and in TensorBoard."""

    def __init__(self, values: dict[str, float | int | None]) -> None:
        self.name_to_value = values

    def record(self, key: str, value: float, exclude: Any = None) -> None:
        """Record a number under a name; the last one before the end of an episode counts."""
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise InvalidArgumentError(
                f"value of {key!r} must be a number, got {shown(value)}"
            ) from None
        self.name_to_value[str(key)] = number if isfinite(number) else None

    def dump(self, step: int = 0) -> None:
        """Do nothing: rows are written by the run."""


class TrainingModel:
    """A run as callbacks see it, with the names of an SB3 model.

    Attributes:
        run: The run itself.
        env: The environment that it gathers in.
        logger: Takes what callbacks record.
    """

    reads_features = True

    def __init__(self, run: Run, env: gymnasium.Env[Any, Any]) -> None:
        self.run = run
        self.env = env
        self.logger = Logger(run.state.recorded)

    @property
    def num_timesteps(self) -> int:
        """Environment steps of experience so far."""
        return self.run.state.num_timesteps

    @property
    def policy(self) -> TreePolicy:
        """The present policy, frozen."""
        return self.run.policy()

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Decide as the present policy does."""
        return self.policy.predict(observation, state, episode_start, deterministic)

    def save(self, path: str | Path) -> None:
        """Write the present policy to a file."""
        self.policy.save(path)

    def get_env(self) -> gymnasium.Env[Any, Any]:
        """Return the environment that the run gathers in."""
        return self.env

    def get_vec_normalize_env(self) -> None:
        """Return None: observations are never normalized."""


Function = Callable[[dict[str, Any], dict[str, Any]], bool | None]
CallbackLike = Function | object | Sequence[Function | object]

_NAMES = (
    "init_callback",  # with the model
    "on_training_start",  # with two dictionaries; when the run begins or goes on
    "on_rollout_start",  # before the first episode of a gathering phase
    "update_locals",  # with what is known of the present step
    "on_step",  # after it; False ends the run
    "on_rollout_end",  # before an expansion
    "on_training_end",
)


class Callbacks(Listener):
    """Tells callbacks what happens in a run; what one has no method for is not told to it.

    Not for offline learning, which takes no steps.

    Args:
        callback: A function that is called after each step, an object with some of the methods of
            SB3's callbacks, or a list of them.

    Raises:
        InvalidArgumentError: The callback is neither.
    """

    def __init__(self, callback: CallbackLike) -> None:
        given = callback if isinstance(callback, list | tuple) else [callback]
        self._callbacks = [_checked(one) for one in given]

    def attached(self, run: Run, env: gymnasium.Env[Any, Any] | None) -> None:
        """Take note of a run at its start."""
        if env is None:
            raise InvalidArgumentError(
                "callback must be None for offline learning, which takes no steps"
            )
        self._tell("init_callback", TrainingModel(run, env))

    def begins(self, run: Run) -> None:
        """Take note that the run begins or goes on."""
        self._tell("on_training_start", {}, {})

    def gathering_begins(self) -> None:
        """Take note that the first episode of a gathering phase begins."""
        self._tell("on_rollout_start")

    def step_taken(self, step: Step) -> bool:
        """Take note of a step; return False to end the run."""
        known = {
            "actions": [step.action],
            "rewards": [step.reward],
            "new_obs": [step.observation],
            "dones": [step.terminated or step.truncated],
            "infos": [step.info],
        }
        self._tell("update_locals", known)
        wishes = self._tell("on_step")
        functions = (one for one in self._callbacks if not _has_methods(one))
        wishes += [one(known, {}) for one in functions]
        return all(wish is None or wish for wish in wishes)

    def gathering_ends(self) -> None:
        """Take note that an expansion follows."""
        self._tell("on_rollout_end")

    def ends(self) -> None:
        """Take note that the run is over."""
        self._tell("on_training_end")

    def _tell(self, name: str, *facts: Any) -> list[Any]:
        methods = (getattr(one, name, None) for one in self._callbacks)
        return [method(*facts) for method in methods if method is not None]


def _has_methods(given: object) -> bool:
    return any(hasattr(given, name) for name in _NAMES)


def _checked(given: Any) -> Any:
    if _has_methods(given) or callable(given):
        return given
    raise InvalidArgumentError(
        "callback must be a function, an object with methods of SB3's callbacks such as on_step, "
        f"or a list of them, got {shown(given)}"
    )
