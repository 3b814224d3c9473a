"""The N-Evasion domain of the paper as a Gymnasium environment."""

import inspect
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from eutree.arrays import Floats
from eutree.envs import _dynamics as dynamics
from eutree.envs._dynamics import GO, RUNNING, EvasionState
from eutree.envs._dynamics import EvasionParameters as EvasionParameters  # for proofs about it
from eutree.envs.painting import Window, import_pygame, picture
from eutree.validation import check_choice

RENDER_MODES = ("human", "rgb_array")

# Key codes as pygame and gymnasium.utils.play count them; pygame itself may not be installed.
SPACE, RIGHT_ARROW = 32, 1073741903


class EvasionEnv(gymnasium.Env[Any, Any]):
    """Cross the paths of N opponents, who move back and forth, without being run into.

    ## Description
    The N-Evasion domain of Chernova and Veloso (2006). An agent moves along a straight main path
    from start to goal and can only stop or go. N opponents move back and forth on paths of their
    own that cross the main path at right angles and are bisected by it; they take no notice of
    the agent. Everybody's forward step is noisy: it is multiplied by 1 + ``noise`` times a
    standard normal number (and is never negative). Opponents are reflected at the ends of their
    paths, or stand there until the next step (``bounce="turn"``). Collisions are looked for at
    the end of each step.

    ## Action Space
    ``Discrete(2)``, a behaviour for one time step.

    | Action | Name | Meaning |
    |---|---|---|
    | 0 | `stop` | stay where you are |
    | 1 | `go` | move towards the goal at the agent's speed |

    ## Observation Space
    ``Box`` of N + 1 float64 numbers (2 N + 1 with ``observe_direction``). The sensors do not
    show where an opponent is heading, unless asked to.

    | Index | Name | Unit | Min | Max | Meaning |
    |---|---|---|---|---|---|
    | 0 | `position` | m | 0 | 30 | the agent's distance from the start |
    | 1 ... N | `opponent_i` | m | -11 | 11 | opponent i's signed distance from the main path |
    | N + 1 ... 2 N | `direction_i` | | -1 | 1 | its direction, -1 or 1 (``observe_direction``) |

    ## Rewards
    | Event | Reward | Argument |
    |---|---|---|
    | the goal is reached | +100 | `goal_reward` |
    | collision | -50 | `collision_reward` |
    | each `stop` | -2 | `stop_reward` |

    A `stop` in the step of a collision costs both.

    ## Starting State
    The agent is at 0 m. Each opponent is uniform on its path, its direction a fair coin; or it is
    at either end (``start="either end"``), or all are at the upper one (``"same end"``). All
    noise of an episode is drawn at ``reset`` from the environment's own generator.

    ## Episode End
    - Terminated: a collision (``info["ending"] == "collision"``), or the goal is reached
      (``"goal"``, and ``info["is_success"]`` is true). The collision counts if both happen.
    - Truncated: the trial limit is over (``"time limit"``). Time is not in the observation, so
      this is never a terminal state.

    ``info["is_success"]`` is there at every step, ``info["ending"]`` at the last.

    ## Arguments
    | Name | Default | Unit | Meaning |
    |---|---|---|---|
    | `n_opponents` | 2 | | number of opponents N, at least 1 |
    | `opponent_speed` | 3.2 | m/s | speed of every opponent |
    | `agent_speed` | 2.0 | m/s | speed of the agent when it goes |
    | `path_length` | 22 | m | length of an opponent's path |
    | `main_path_length` | 30 | m | distance from start to goal |
    | `crossings` | None | m | where the paths cross; None: equally spaced |
    | `noise` | 0.02 | | standard deviation of a forward step, as a share of it |
    | `time_step` | 1.0 | s | time between two decisions |
    | `collision_distance` | 2.0 | m | an opponent this near is a collision |
    | `trial_limit` | 60 | s | time after which the episode is cut short |
    | `observe_direction` | False | | whether the observation shows directions |
    | `start` | anywhere | | where opponents begin: `anywhere`, `either end`, `same end` |
    | `bounce` | reflect | | at an end an opponent is reflected, or has to `turn` |
    | `goal_reward` | 100 | | reward for reaching the goal |
    | `collision_reward` | -50 | | reward for a collision |
    | `stop_reward` | -2 | | reward for each `stop` |
    | `render_mode` | None | | `"human"` or `"rgb_array"` |

    ```python
    import gymnasium as gym
    import eutree
    env = gym.make("eutree/Evasion2-v0", opponent_speed=4.2)
    ```

    Ids: ``eutree/Evasion2-v0``, ``eutree/Evasion3-v0`` and ``eutree/Evasion4-v0`` have 2, 3 and 4
    opponents, ``eutree/Evasion-v0`` takes ``n_opponents``. ``eutree/PaperEvasion2-v0`` and
    ``eutree/PaperEvasion3-v0`` have the constants under which most claims of the paper hold.
    ``gymnasium.make_vec`` makes a native vector environment with the same episodes, bit for bit.

    ## Version History
    * v0: first version.
    """

    metadata = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": list(RENDER_MODES),
        "render_fps": 1.0,
    }

    # The parameters by name, for help() and for code that asks which arguments there are.
    __signature__ = inspect.Signature(
        [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default)
            for name, default in {"render_mode": None, **dynamics.DEFAULTS}.items()
        ]
    )

    def __init__(self, *, render_mode: str | None = None, **arguments: Any) -> None:
        self.parameters = EvasionParameters.from_arguments(arguments)
        if render_mode is not None:
            check_choice("render_mode", render_mode, RENDER_MODES)
            import_pygame()  # a missing extra is better said now than at the first picture
        self.render_mode = render_mode
        # The pace of a person's demonstration: a second of the domain is a second of the clock.
        self.metadata = self.metadata | {"render_fps": 1.0 / self.parameters.time_step}
        self.observation_space = observation_space(self.parameters)
        self.action_space = spaces.Discrete(2)
        self.feature_names, self.feature_units = features(self.parameters)
        self.action_names = ("stop", "go")
        self.task_description = describe_task(self.parameters)
        self._state: EvasionState | None = None
        self._before: EvasionState | None = None  # None at the start of an episode
        self._action = dynamics.STOP
        self._window: Window | None = None
        self._noise: Floats = np.empty((0, 0))  # [T, N + 1]
        self._step = 0
        self._ending = RUNNING

    @property
    def max_steps(self) -> int:
        """Steps after which an episode ends by itself."""
        return self.parameters.max_steps

    @property
    def return_range(self) -> tuple[float, float]:
        """Lowest and highest return of an episode: ``stop`` at every step, and the worst ending."""
        p = self.parameters
        stops = sorted((0.0, p.max_steps * p.stop_reward))
        endings = sorted((0.0, p.goal_reward, p.collision_reward))
        return stops[0] + endings[0], stops[1] + endings[-1]

    @property
    def state(self) -> EvasionState:
        """The full state, with the directions that the sensors do not show."""
        if self._state is None:
            raise ResetNeeded("call reset before anything else")
        return self._state

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; return its first observation and an empty info."""
        super().reset(seed=seed)
        uniforms, self._noise = dynamics.draw(self.parameters, self.np_random)
        self._state = dynamics.start(self.parameters, uniforms)
        self._before, self._step, self._ending = None, 0, RUNNING
        if self.render_mode == "human":
            self._animate()
        return dynamics.observe(self.parameters, self._state), {}

    def step(self, action: int) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Take one step; return observation, reward, terminated, truncated and info."""
        action = dynamics.as_action(action)
        state = self.state
        if self._ending != RUNNING:
            raise ResetNeeded("the episode has ended; call reset before the next step")
        self._before, self._action = state, action
        self._state = dynamics.advance(self.parameters, state, action, self._noise[self._step])
        self._step += 1
        ended = self._ending = dynamics.ending(self.parameters, self._state, self._step)
        info: dict[str, Any] = {"is_success": ended == dynamics.GOAL}
        if ended != RUNNING:
            info["ending"] = dynamics.ENDINGS[ended]
        if self.render_mode == "human":
            self._animate()
        return (
            dynamics.observe(self.parameters, self._state),
            dynamics.reward(self.parameters, action, ended),
            ended in (dynamics.GOAL, dynamics.COLLISION),
            ended == dynamics.TIME_LIMIT,
            info,
        )

    def render(self) -> Any:
        """Return the picture that the render mode asks for; a window shows itself at each step."""
        if self.render_mode == "rgb_array":
            return picture(self.parameters, self.state)
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render was called without a render mode; choose one when the environment is "
                f"made: gymnasium.make(..., render_mode={RENDER_MODES[1]!r})"
            )
        return None

    def render_between(self, share: float) -> NDArray[np.uint8]:
        """Return a picture of the last step when ``share`` of it, from 0 to 1, was over.

        So a game can run at 30 pictures a second although there are fewer decisions.
        """
        return picture(self.parameters, self._between(share))

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _between(self, share: float) -> EvasionState:
        if self._before is None:
            return self.state
        noise = self._noise[self._step - 1]
        return dynamics.advance(self.parameters, self._before, self._action, noise, part=share)

    def _animate(self) -> None:
        if self._window is None:
            self._window = Window()
        self._window.animate(self.parameters, self._between, 1.0 / self.metadata["render_fps"])

    def get_keys_to_action(self) -> dict[tuple[int, ...], int]:
        """Return which keys mean which action: Space or Right is ``go``, none is ``stop``."""
        return {(SPACE,): GO, (RIGHT_ARROW,): GO, (SPACE, RIGHT_ARROW): GO}


def describe_task(parameters: EvasionParameters) -> str:
    """Return the task for a person who sees the picture."""
    count = parameters.n_opponents
    discs = "The red disc" if count == 1 else f"None of the {count} red discs"
    verb = "may not touch" if count == 1 else "may touch"
    return (
        f"Bring the blue disc to the green goal. {discs} {verb} its ring: wait before an orange "
        "line, and go when the crossing behind it stays free. Each decision holds for "
        f"{parameters.time_step:g} s; after {parameters.trial_limit:g} s the time is over."
    )


def observation_space(parameters: EvasionParameters) -> spaces.Box:
    """Return the finite box that holds every observation."""
    low, high = dynamics.bounds(parameters)
    return spaces.Box(low, high, dtype=np.float64)


def features(parameters: EvasionParameters) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units of the observation's attributes."""
    numbers = range(1, parameters.n_opponents + 1)
    names = ["position", *(f"opponent_{i}" for i in numbers)]
    units = ["m"] * len(names)
    if parameters.observe_direction:
        names += [f"direction_{i}" for i in numbers]
        units += [""] * parameters.n_opponents
    return tuple(names), tuple(units)
