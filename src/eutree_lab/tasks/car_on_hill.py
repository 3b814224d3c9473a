"""Car on the Hill, Moore and Atkeson's puck with the rewards of Munos and Moore."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.validation import check_number
from eutree_lab.tasks._domain import GOAL, ModelledDomain
from eutree_lab.tasks._sketch import GOAL_COLOR, Disc, Line, Patch, Sketch, curve

GRAVITY, MASS, THRUST = 9.81, 1.0, 4.0  # Moore and Atkeson 1995
REACH, FASTEST = 1.0, 4.0  # limits of the state space, Munos and Moore 2002
DISCOUNT_PER_SECOND = 0.6  # Munos and Moore 2002


class CarOnHillEnv(ModelledDomain):
    """Drive up a hill that is too steep for the engine, and arrive slowly.

    ## Description
    A car of mass 1 in a valley: height H(y) = y^2 + y for y < 0, y / sqrt(1 + 5 y^2) for y >= 0,
    acceleration u / (M sqrt(1 + H'^2)) - g H' / (1 + H'^2), |u| <= 4, g = 9.81 (A. W. Moore and
    C. G. Atkeson, *The Parti-game Algorithm*, Machine Learning 21, 1995). State space and rewards
    are those of R. Munos and A. Moore, *Variable Resolution Discretization in Optimal Control*
    (Machine Learning 49, 2002), who discount a second by 0.6.

    ## Action Space
    ``Discrete(2)``, the engine for one time step: `back` (u = -4), `forth` (u = 4).

    ## Observation Space
    | Index | Name | Unit | Min | Max | Meaning |
    |---|---|---|---|---|---|
    | 0 | `y` | m | -1 | 1 | where the car is |
    | 1 | `velocity` | m/s | -4 | 4 | how fast it moves to the right |

    ## Rewards
    0, and at the end 1 - velocity / 2 on leaving to the right, -1 on any other crash.

    ## Starting State
    Uniform over the state space.

    ## Episode End
    - Terminated: the car leaves to the right no faster than 2 m/s, with a reward of at least 0
      (``info["ending"] == "goal"``), or anywhere else (``"crash"``).
    - Truncated: the trial limit is over (``"time limit"``).

    ## Arguments
    | Name | Default | Meaning |
    |---|---|---|
    | `time_step` | 0.02 | seconds of a step |
    | `trial_limit` | 500 | steps after which the episode is cut short |
    | `render_mode` | None | `"human"` or `"rgb_array"` |

    ## Version History
    * v0: first version.
    """

    feature_names, feature_units = ("y", "velocity"), ("m", "m/s")
    action_names = ("back", "forth")
    endings = ("", GOAL, "crash")

    def __init__(
        self, *, time_step: float = 0.02, trial_limit: int = 500, render_mode: str | None = None
    ) -> None:
        self.time_step = check_number("time_step", time_step, low=0.0, high=1.0, low_open=True)
        super().__init__([-REACH, -FASTEST], [REACH, FASTEST], trial_limit, render_mode)

    @property
    def discount(self) -> float:
        """The discount of a step."""
        return float(DISCOUNT_PER_SECOND**self.time_step)

    def _start(self) -> Floats:
        return self.np_random.uniform([-REACH, -FASTEST], [REACH, FASTEST])

    def _advance(self, states: Floats, actions: Integers) -> tuple[Floats, Floats, Integers]:
        y, v = states[:, 0], states[:, 1]
        slope = np.where(y < 0.0, 2.0 * y + 1.0, (1.0 + 5.0 * y**2) ** -1.5)  # H'
        engine = np.where(actions == 1, THRUST, -THRUST) / (MASS * np.sqrt(1.0 + slope**2))
        faster = v + self.time_step * (engine - GRAVITY * slope / (1.0 + slope**2))
        after = np.stack([y + self.time_step * faster, faster], axis=1)
        right = after[:, 0] > REACH
        beyond = right | (after[:, 0] < -REACH) | (np.abs(faster) > FASTEST)
        earned = np.where(right, np.maximum(1.0 - np.abs(faster) / 2.0, -1.0), -1.0)
        endings = np.where(beyond, np.where(right & (earned >= 0.0), 1, 2), 0)
        inside = np.clip(after, [-REACH, -FASTEST], [REACH, FASTEST])
        return inside, np.where(beyond, earned, 0.0), endings

    def _sketch(self) -> Sketch:
        def at(y: Floats, above: float) -> tuple[tuple[float, float], ...]:
            height = np.where(y < 0.0, y**2 + y, y / np.sqrt(1.0 + 5.0 * y**2))
            return curve(0.5 + 0.5 * y, 0.4 + 0.6 * height + above)

        road = Line(at(np.linspace(-REACH, REACH, 120), 0.0), width=0.012)
        return (Patch((0.97, 0.0), (1.0, 1.0), GOAL_COLOR), road, Disc(at(self.state[:1], 0.03)[0]))
