"""What a callback is: the protocol of Stable-Baselines3, and what its parts do here."""

from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Protocol, cast

import gymnasium
from numpy.typing import ArrayLike

from eutree.errors import InvalidArgumentError
from eutree.learners import Step
from eutree.policies import TreePolicy
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
                f"value of {key!r} must be a number, got {value!r}"
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


class Callback(Protocol):
    """What ``learn`` calls, in this order; all callbacks of SB3 have these methods."""

    def init_callback(self, model: Any) -> None:
        """Take the model."""
        ...

    def on_training_start(self, locals_: dict[str, Any], globals_: dict[str, Any]) -> None:
        """Begin, or go on after an interruption."""
        ...

    def on_rollout_start(self) -> None:
        """Before the first episode of a gathering phase."""
        ...

    def update_locals(self, locals_: dict[str, Any]) -> None:
        """Take what is known of the present step."""
        ...

    def on_step(self) -> bool:
        """After each step; return False to end the run."""
        ...

    def on_rollout_end(self) -> None:
        """Before an expansion."""
        ...

    def on_training_end(self) -> None:
        """After the last episode, or when the run was ended early."""
        ...


Function = Callable[[dict[str, Any], dict[str, Any]], bool | None]
CallbackLike = Callback | Function | list[Callback | Function] | tuple[Callback | Function, ...]


class BaseCallback:
    """A callback that does nothing; derive from it and override the methods with an underscore.

    Args:
        verbose: Kept for SB3's signature; callbacks here say nothing.

    Attributes:
        model: The run; see ``TrainingModel``.
        n_calls: How often ``on_step`` was called.
        num_timesteps: Environment steps of experience so far.
        locals: What is known of the present step: ``actions``, ``rewards``, ``new_obs``,
            ``dones`` and ``infos`` as lists of one entry, as in SB3.
        globals: Always empty.
        parent: The callback that calls this one, if any.
    """

    model: Any

    def __init__(self, verbose: int = 0) -> None:
        self.verbose = verbose
        self.n_calls = 0
        self.num_timesteps = 0
        self.locals: dict[str, Any] = {}
        self.globals: dict[str, Any] = {}
        self.parent: BaseCallback | None = None

    @property
    def training_env(self) -> Any:
        """The environment that the run gathers in."""
        return self.model.get_env()

    @property
    def logger(self) -> Any:
        """Takes what the callback records: ``self.logger.record(name, number)``."""
        return self.model.logger

    def init_callback(self, model: Any) -> None:
        """Take the model."""
        self.model = model
        self._init_callback()

    def on_training_start(self, locals_: dict[str, Any], globals_: dict[str, Any]) -> None:
        """Begin, or go on after an interruption."""
        self.locals, self.globals = locals_, globals_
        self.num_timesteps = self.model.num_timesteps
        self._on_training_start()

    def on_rollout_start(self) -> None:
        """Before the first episode of a gathering phase."""
        self._on_rollout_start()

    def update_locals(self, locals_: dict[str, Any]) -> None:
        """Take what is known of the present step."""
        self.locals.update(locals_)
        self.update_child_locals(locals_)

    def update_child_locals(self, locals_: dict[str, Any]) -> None:
        """Pass it on."""

    def on_step(self) -> bool:
        """After each step; return False to end the run."""
        self.n_calls += 1
        self.num_timesteps = self.model.num_timesteps
        return self._on_step()

    def on_rollout_end(self) -> None:
        """Before an expansion."""
        self._on_rollout_end()

    def on_training_end(self) -> None:
        """After the last episode, or when the run was ended early."""
        self._on_training_end()

    def _init_callback(self) -> None:
        """Override: the model is known now."""

    def _on_training_start(self) -> None:
        """Override."""

    def _on_rollout_start(self) -> None:
        """Override."""

    def _on_step(self) -> bool:
        """Override; return False to end the run."""
        return True

    def _on_rollout_end(self) -> None:
        """Override."""

    def _on_training_end(self) -> None:
        """Override."""


class FunctionCallback(BaseCallback):
    """Calls a function of ``(locals, globals)`` after each step; False ends the run."""

    def __init__(self, function: Function) -> None:
        super().__init__()
        self._function = function

    def _on_step(self) -> bool:
        return self._function(self.locals, self.globals) is not False


class CallbackList(BaseCallback):
    """Calls several callbacks in turn; the run ends as soon as one of them wants it to."""

    def __init__(self, callbacks: Sequence[Callback | Function]) -> None:
        super().__init__()
        self.callbacks = [as_callback(each) for each in callbacks]

    def _init_callback(self) -> None:
        for callback in self.callbacks:
            callback.init_callback(self.model)
            callback.parent = self.parent  # type: ignore[attr-defined]  # SB3's have it too

    def _on_training_start(self) -> None:
        for callback in self.callbacks:
            callback.on_training_start(self.locals, self.globals)

    def _on_rollout_start(self) -> None:
        for callback in self.callbacks:
            callback.on_rollout_start()

    def _on_step(self) -> bool:
        wishes = [callback.on_step() for callback in self.callbacks]
        return all(wishes)

    def _on_rollout_end(self) -> None:
        for callback in self.callbacks:
            callback.on_rollout_end()

    def _on_training_end(self) -> None:
        for callback in self.callbacks:
            callback.on_training_end()

    def update_child_locals(self, locals_: dict[str, Any]) -> None:
        """Pass it on."""
        for callback in self.callbacks:
            callback.update_locals(locals_)


class CallbackListener:
    """Tells a callback what happens in a run.

    Args:
        callback: The callback, a function, or a list of them.
        run: The run.
        env: The environment that it gathers in.
    """

    def __init__(self, callback: CallbackLike, run: Run, env: gymnasium.Env[Any, Any]) -> None:
        self._callback = as_callback(callback)
        self._callback.init_callback(TrainingModel(run, env))

    def training_begins(self) -> None:
        """Take note that the run begins or goes on."""
        self._callback.on_training_start({}, {})

    def gathering_begins(self) -> None:
        """Take note that the first episode of a gathering phase begins."""
        self._callback.on_rollout_start()

    def step_taken(self, step: Step) -> bool:
        """Take note of a step; return False to end the run."""
        self._callback.update_locals(
            {
                "actions": [step.action],
                "rewards": [step.reward],
                "new_obs": [step.observation],
                "dones": [step.terminated or step.truncated],
                "infos": [step.info],
            }
        )
        return self._callback.on_step()

    def gathering_ends(self) -> None:
        """Take note that an expansion follows."""
        self._callback.on_rollout_end()

    def training_ends(self) -> None:
        """Take note that the run is over."""
        self._callback.on_training_end()


def as_callback(given: CallbackLike) -> Callback:
    """Return one callback for a function, a callback or a list of them."""
    if isinstance(given, list | tuple):
        return CallbackList(given)
    if hasattr(given, "on_step"):
        return cast("Callback", given)
    if callable(given):
        return FunctionCallback(given)
    raise InvalidArgumentError(
        f"callback must be a function, a callback with on_step, or a list of them, got {given!r}"
    )
