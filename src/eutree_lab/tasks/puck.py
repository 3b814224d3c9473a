"""The puck of Al-Ansari's thesis: a hill too steep to drive up at once."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree_lab.tasks._domain import GOAL, ModelledDomain
from eutree_lab.tasks._sketch import GOAL_COLOR, Disc, Line, Patch, Sketch, curve

REACH, FASTEST = 20.0, 10.0  # limits of the track and of the velocity
TIME_STEP = 0.1
GRAVITY = 9.8
THRUSTS = np.array([-1.0, 0.0, 1.0])
GOAL_PLACE, GOAL_HALF = np.array([16.0, 0.0]), np.array([1.0, 0.5])


class PuckEnv(ModelledDomain):
    """Bring a puck to rest on a slope that is steeper than its thrust is strong.

    ## Description
    A puck of mass 1 slides on a track that is flat on its left half and rises to a hill at x = 20
    on its right half. Its thrust does not hold it on the steep part, so it has to come with speed,
    and without speed when it arrives. The equations are those of M. A. Al-Ansari, *Efficient
    Reinforcement Learning in Continuous Environments* (PhD thesis, Northeastern University, 2001):
    x += 0.1 v, v += 0.1 (thrust - 9.8 m / (1 + m^2)), slope m = (pi / 20) sin(pi x / 20) for
    x > 0. The goal's size is not stated there.

    ## Action Space
    ``Discrete(3)``, a thrust for 0.1 s: `left` (-1 N), `none` (0 N), `right` (1 N).

    ## Observation Space
    | Index | Name | Unit | Min | Max | Meaning |
    |---|---|---|---|---|---|
    | 0 | `x` | m | -20 | 20 | where the puck is |
    | 1 | `velocity` | m/s | -10 | 10 | how fast it moves to the right |

    ## Rewards
    -1 for each step, another -1000 for a crash.

    ## Starting State
    At rest at x = 0.

    ## Episode End
    - Terminated: x within 16 +- 1 and velocity within +- 0.5 (``info["ending"] == "goal"``), or
      beyond the track or the limits of velocity (``"crash"``; the thesis puts the puck back to
      the start).
    - Truncated: the trial limit is over (``"time limit"``).

    ## Arguments
    | Name | Default | Meaning |
    |---|---|---|
    | `trial_limit` | 2000 | steps after which the episode is cut short |
    | `render_mode` | None | `"human"` or `"rgb_array"` |

    ## Version History
    * v0: first version.
    """

    feature_names, feature_units = ("x", "velocity"), ("m", "m/s")
    action_names = ("left", "none", "right")
    endings = ("", GOAL, "crash")
    goal = np.array([GOAL_PLACE - GOAL_HALF, GOAL_PLACE + GOAL_HALF])  # lower, upper corner

    def __init__(self, *, trial_limit: int = 2000, render_mode: str | None = None) -> None:
        super().__init__([-REACH, -FASTEST], [REACH, FASTEST], trial_limit, render_mode)

    def _start(self) -> Floats:
        return np.zeros(2)

    def _advance(self, states: Floats, actions: Integers) -> tuple[Floats, Floats, Integers]:
        x, v = states[:, 0], states[:, 1]
        slope = np.where(x > 0.0, np.pi / REACH * np.sin(np.pi * x / REACH), 0.0)
        push = THRUSTS[actions] - GRAVITY * slope / (1.0 + slope**2)
        after = np.stack([x + TIME_STEP * v, v + TIME_STEP * push], axis=1)
        beyond = (np.abs(after) > [REACH, FASTEST]).any(axis=1)
        there = (np.abs(after - GOAL_PLACE) <= GOAL_HALF).all(axis=1)
        endings = np.where(beyond, 2, there.astype(np.int64))
        rewards = np.where(beyond, -1001.0, -1.0)
        return np.clip(after, [-REACH, -FASTEST], [REACH, FASTEST]), rewards, endings

    def _sketch(self) -> Sketch:
        def height(x: Floats) -> Floats:
            return 0.3 + 0.2 * np.where(x > 0.0, 1.0 - np.cos(np.pi * x / REACH), 0.0)

        track = np.linspace(-REACH, REACH, 120)
        across = 0.5 + 0.5 * track / REACH
        low, high = (0.5 + 0.5 * (16.0 + side) / REACH for side in (-1.0, 1.0))
        place = self.state[:1]
        puck = curve(0.5 + 0.5 * place / REACH, height(place) + 0.03)[0]
        return (
            Patch((low, 0.0), (high, 1.0), (205, 232, 214)),
            Line(curve(across, height(track)), width=0.012),
            Disc(puck, 0.025),
            Disc((0.9, 0.05), 0.02, GOAL_COLOR),
        )
