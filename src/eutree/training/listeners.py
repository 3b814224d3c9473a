"""Who follows a run and may end it: a progress display, TensorBoard, callbacks, a stop, a signal.

``eutree.learn(env, listeners=[TensorBoard("logs/a"), StopWhen(asked), callback])`` tells each of
them in this order; whatever is no ``Listener`` is taken for a callback of Stable-Baselines3. One of
your own derives from ``Listener``. Listeners change nothing that is learned, unless they end the
run.

Ctrl-C and SIGTERM are a polite request: finish nothing more, save, and exit. Who does not answer
within half a second, because a long evaluation or expansion is under way, is interrupted. All that
this leaves half done is thrown away.
"""

import inspect
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from math import isfinite
from pathlib import Path
from types import FrameType
from typing import Any

import gymnasium

from eutree.errors import InvalidArgumentError, needed, shown
from eutree.files import make_folder
from eutree.learners import Step
from eutree.policies import TreePolicy
from eutree.training.phases import Follower
from eutree.training.progress import values_of
from eutree.training.run import Run
from eutree.validation import check_function

__all__ = ["Listener", "Progress", "StopWhen", "TensorBoard"]

GRACE = 0.5  # seconds


class Listener(Follower):
    """Follows a run, and may end it; a subclass has those of the methods that concern it."""

    def attached(self, run: Run, env: gymnasium.Env[Any, Any] | None) -> None:
        """Take note of a run at its start, and of where it acts; None for recorded episodes."""

    def begins(self, run: Run) -> None:
        """Take note that the run begins, or goes on from its checkpoint."""

    def advanced(self, run: Run) -> None:
        """Take note of an episode, an update or an evaluation."""

    def ends(self) -> None:
        """Take note that the run is over."""

    def closes(self) -> None:
        """Let go of everything: the run is over, or has failed."""


class Progress(Listener):
    """Calls a function after each episode and each evaluation, or each expansion offline."""

    def __init__(self, function: Callable[[Run], None]) -> None:
        self._function = check_function("on_progress", function)

    def advanced(self, run: Run) -> None:
        """Call it with the run."""
        self._function(run)


class StopWhen(Listener):
    """Ends the run at its last finished episode when a function, asked before a step, says so."""

    def __init__(self, asked: Callable[[], bool]) -> None:
        self._asked = check_function("stop", asked)

    def wants_stop(self) -> bool:
        """Ask it."""
        return self._asked()


class TensorBoard(Listener):
    """Writes the figures of a run to a folder that TensorBoard shows; needs its extra.

    A resumed run hides all that the interrupted one wrote after its last checkpoint, and writes it
    again.

    Args:
        path: The folder; one for each run, so that TensorBoard tells them apart.
    """

    def __init__(self, path: str | Path) -> None:
        if not isinstance(path, str | Path):
            raise InvalidArgumentError(f"tensorboard must be a folder, got {shown(path)}")
        self._path = path
        self._writer: Any = None

    def begins(self, run: Run) -> None:
        """Begin the log, or go on with it.

        Raises:
            InvalidArgumentError: The folder holds the log of another run.
            MissingExtraError: tensorboardX is not installed.
        """
        with needed("tensorboardX", "tensorboard"):
            from tensorboardX import SummaryWriter
        folder = make_folder(self._path)
        earlier = len(list(folder.glob("events.out.tfevents.*")))
        if not run.state.events and earlier:
            raise InvalidArgumentError(
                f"tensorboard must be a folder without the log of another run, got {folder}"
            )
        self._start = time.monotonic()
        self._steps_before = run.state.num_timesteps
        # What the folder holds of this step and later ones does not count any more.
        self._first_step = run.state.num_timesteps if run.plan.gathers else run.at.updates
        self._n_events = self._iterations = 0
        self._writer = SummaryWriter(
            str(folder),
            purge_step=self._first_step,
            filename_suffix=f".{earlier}",  # its names have whole seconds
        )
        self.advanced(run)

    def advanced(self, run: Run) -> None:
        """Write the events since the last call."""
        for event in run.state.events[self._n_events :]:
            self._iterations += event["event"] == "expansion"
            step = event["steps"] if run.plan.gathers else self._iterations
            if step >= self._first_step:
                values = values_of(event, run.gathered)
                if event["event"] == "expansion":
                    values |= self._times(run)
                for name, value in values.items():
                    if value is not None:
                        self._writer.add_scalar(name, value, step)
        self._n_events = len(run.state.events)

    def closes(self) -> None:
        """Write the rest, and end the log."""
        if self._writer is not None:
            self._writer.close()

    def _times(self, run: Run) -> dict[str, float | int | None]:
        elapsed = max(time.monotonic() - self._start, 1e-9)
        return {
            "time/episodes": run.episode,
            "time/fps": (run.state.num_timesteps - self._steps_before) / elapsed,
            "time/time_elapsed": elapsed,
        }


@contextmanager
def following(run: Run, listeners: Sequence[Listener]) -> Iterator[None]:
    """Tell of the beginning, and of the end unless the run fails; then let go."""
    try:
        for one in listeners:
            one.begins(run)
        yield
        for one in listeners:
            one.ends()
    finally:
        for one in listeners:
            one.closes()


class StopRequest:
    """Whether a signal asked to stop, and which.

    Attributes:
        signal: Number of the signal; 0 while none came.
    """

    def __init__(self) -> None:
        self.signal = 0

    def __call__(self) -> bool:
        """Return whether a signal came."""
        return self.signal != 0

    def no_more(self) -> None:
        """Interrupt no more: the block is about to end by itself."""
        signal.setitimer(signal.ITIMER_REAL, 0)

    @property
    def exit_code(self) -> int:
        """128 plus the signal's number, as shells expect: 130 for Ctrl-C, 143 for SIGTERM."""
        return 128 + self.signal


@contextmanager
def stop_on_signals() -> Iterator[StopRequest]:
    """Turn the first SIGINT or SIGTERM into a request; the second acts as it always does.

    If the ``with`` block is still running ``GRACE`` later, KeyboardInterrupt is raised in it; one
    that leaves the block becomes an exit with the signal's code.
    Only usable in the main thread, like all handling of signals in Python.
    """
    request = StopRequest()
    asked = (signal.SIGINT, signal.SIGTERM)
    previous = {number: signal.getsignal(number) for number in (*asked, signal.SIGALRM)}

    def note(number: int, frame: FrameType | None) -> None:
        request.signal = number
        signal.signal(number, previous[signal.Signals(number)])
        signal.setitimer(signal.ITIMER_REAL, GRACE)

    def insist(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, insist)
    for number in asked:
        signal.signal(number, note)
    try:
        yield request
    except KeyboardInterrupt:
        if request():
            raise SystemExit(request.exit_code) from None
        raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in previous.items():
            signal.signal(number, handler)


class Logger:
    """Figures that callbacks record, for the next row of ``progress.csv`` and for TensorBoard."""

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
        logger: Takes the figures that callbacks record.
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

    def predict(self, *given: Any, **named: Any) -> tuple[Any, Any]:
        """Decide as the present policy does, of whose ``predict`` these are the arguments."""
        return self.policy.predict(*given, **named)

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
    """Tells callbacks of the events of a run, each of those for which it has a method.

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
    with suppress(TypeError, ValueError):  # of what takes no two dictionaries, or does not say so
        if not isinstance(given, type) and (
            _has_methods(given) or inspect.signature(given).bind({}, {})
        ):
            return given
    raise InvalidArgumentError(
        "a listener or callback must be a Listener, a function of (locals, globals), an object "
        f"with methods of SB3's callbacks such as on_step, or a list of them, got {shown(given)}"
    )
