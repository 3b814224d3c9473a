"""The base of the small domains: episodes, time limits, actions, pictures.

A domain gives the start of an episode, the step of an action and the observation; ``Domain`` makes
a Gymnasium environment of it.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded

from eutree.arrays import Booleans, Floats, Integers
from eutree.envs.painting import import_pygame
from eutree.errors import InvalidArgumentError
from eutree.validation import check_choice, check_integer, check_vector
from eutree_lab.tasks import _sketch

RENDER_MODES = ("human", "rgb_array")
GOAL, TIME_LIMIT = "goal", "time limit"


class Domain(gymnasium.Env[Floats, Any]):
    """A small environment; the state is a vector, an ending is a word.

    Attributes:
        feature_names: Name of each number of an observation.
        feature_units: Its unit.
        action_names: Name of each action.
        trial_limit: Steps after which an episode is cut short.
    """

    metadata = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": list(RENDER_MODES),
        "render_fps": 30,
    }
    feature_names: tuple[str, ...]
    feature_units: tuple[str, ...]
    action_names: tuple[str, ...]

    def __init__(
        self, low: Sequence[float], high: Sequence[float], trial_limit: int, render_mode: str | None
    ) -> None:
        if render_mode is not None:
            check_choice("render_mode", render_mode, RENDER_MODES)
            import_pygame()  # a missing extra is better said now than at the first picture
        self.render_mode = render_mode
        self.trial_limit = check_integer("trial_limit", trial_limit, low=1)
        self.observation_space = spaces.Box(np.array(low), np.array(high), dtype=np.float64)
        self.action_space = spaces.Discrete(len(self.action_names))
        self._state: Floats | None = None
        self._step, self._ended = 0, False

    @property
    def max_steps(self) -> int:
        """Steps after which an episode is cut short, by the name that others give it."""
        return self.trial_limit

    @property
    def state(self) -> Floats:
        """The full state, of which an observation may show a part."""
        if self._state is None:
            raise ResetNeeded("call reset before anything else")
        return self._state

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode, in ``options["state"]`` if it is given; return observation and info."""
        super().reset(seed=seed)
        start = self._start()
        if options is not None and "state" in options:
            start = check_vector("options['state']", options["state"], size=start.size)
        self._state, self._step, self._ended = start, 0, False
        self._show()
        return self._observe(), {}

    def step(self, action: int) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Take one step; return observation, reward, terminated, truncated and info."""
        state = self.state
        if self._ended:
            raise ResetNeeded("the episode has ended; call reset before the next step")
        self._state, reward, ending = self._move(state, self._checked(action))
        self._step += 1
        truncated = not ending and self._step >= self.trial_limit
        self._ended = bool(ending) or truncated
        info: dict[str, Any] = {"is_success": ending == GOAL}
        if self._ended:
            info["ending"] = ending or TIME_LIMIT
        self._show()
        return self._observe(), float(reward), bool(ending), truncated, info

    def render(self) -> Any:
        """Return the picture that the render mode asks for; a window shows itself at each step."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render was called without a render mode; choose one when the environment is "
                f"made: gymnasium.make(..., render_mode={RENDER_MODES[1]!r})"
            )
        return _sketch.picture(self._sketch()) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.render_mode == "human":
            _sketch.close()

    def _start(self) -> Floats:
        """Return a first state."""
        raise NotImplementedError

    def _move(self, state: Floats, action: int) -> tuple[Floats, float, str]:
        """Return the next state, the reward and how the episode ended, if it did."""
        raise NotImplementedError

    def _observe(self) -> Floats:
        """Return the observation of the state: all of it, if not overridden."""
        return self.state.copy()

    def _sketch(self) -> _sketch.Sketch:
        """Return the picture of the state."""
        raise NotImplementedError

    def _show(self) -> None:
        if self.render_mode == "human":
            rate = float(self.metadata["render_fps"])
            _sketch.show(self._sketch(), type(self).__name__, rate)

    def _checked(self, value: Any) -> int:
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        known = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if not known or not 0 <= value < len(self.action_names):
            names = ", ".join(f"{i} ({name})" for i, name in enumerate(self.action_names))
            raise InvalidArgumentError(f"action must be one of {names}, got {value!r}")
        return int(value)


class ModelledDomain(Domain):
    """A domain with a known model: without noise, its state is the observation."""

    endings: tuple[str, ...] = ("", GOAL)

    def model(
        self, states: Floats, actions: Integers
    ) -> tuple[Floats, Floats, Booleans]:  # [N, d], [N], [N]
        """Return the steps of actions without noise: next states, rewards, and ends.

        Args:
            states: Where to start, shape [N, d]; any states, not only those of an episode.
            actions: Action in each, shape [N].
        """
        after, rewards, endings = self._advance(states, actions)
        return after, rewards, endings > 0

    def _advance(self, states: Floats, actions: Integers) -> tuple[Floats, Floats, Integers]:
        """Return next states [N, d], rewards [N] and numbers of their endings [N], 0 for none."""
        raise NotImplementedError

    def _move(self, state: Floats, action: int) -> tuple[Floats, float, str]:
        after, rewards, endings = self._advance(state[np.newaxis], np.array([action]))
        return after[0], float(rewards[0]), self.endings[int(endings[0])]
