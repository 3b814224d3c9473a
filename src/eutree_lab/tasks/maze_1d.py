"""The 1d maze: four cells in a row and nothing to be seen."""

import numpy as np

from eutree.arrays import Floats
from eutree_lab.tasks._domain import Domain
from eutree_lab.tasks._sketch import GOAL_COLOR, Disc, Patch, Sketch

N_CELLS, GOAL_CELL = 4, 2


class Maze1DEnv(Domain):
    """Find the third of four cells without seeing anything.

    ## Description
    Four cells in a row; nothing is observed, so only one's own actions tell where one is. Who
    reaches the third cell earns 1 and is put at once into one of the others at random (J. Veness
    et al., JAIR 40, 2011, who report 0.50 a step as nearly optimal). Exact is 0.5: right, right
    and left find it after 1, 2 or 3 steps with equal chances.

    ## Action Space
    ``Discrete(2)``: `left`, `right`; at an end the agent stays where it is.

    ## Observation Space
    | Index | Name | Unit | Min | Max | Meaning |
    |---|---|---|---|---|---|
    | 0 | `found` | | 0 | 1 | 1 after a step that reached the third cell |

    The reward is a percept in the source; `found` shows it.

    ## Rewards
    +1 for reaching the third cell, else 0.

    ## Starting State
    The first, second or fourth cell, with equal chances.

    ## Episode End
    - Terminated: never.
    - Truncated: the trial limit is over (``info["ending"] == "time limit"``).

    ## Arguments
    | Name | Default | Meaning |
    |---|---|---|
    | `trial_limit` | 100 | steps after which the episode is cut short |
    | `render_mode` | None | `"human"` or `"rgb_array"` |

    ## Version History
    * v0: first version.
    """

    feature_names, feature_units = ("found",), ("",)
    action_names = ("left", "right")

    def __init__(self, *, trial_limit: int = 100, render_mode: str | None = None) -> None:
        super().__init__([0.0], [1.0], trial_limit, render_mode)

    def _start(self) -> Floats:
        """Return a cell, and that nothing was found."""
        return np.array([float(self.np_random.choice([0, 1, 3])), 0.0])

    def _observe(self) -> Floats:
        return self.state[1:].copy()

    def _move(self, state: Floats, action: int) -> tuple[Floats, float, str]:
        cell = min(max(int(state[0]) + (1 if action == 1 else -1), 0), N_CELLS - 1)
        if cell == GOAL_CELL:
            return np.array([self._start()[0], 1.0]), 1.0, ""
        return np.array([float(cell), 0.0]), 0.0, ""

    def _sketch(self) -> Sketch:
        lefts = [i / N_CELLS for i in range(N_CELLS)]
        floor = [Patch((x, 0.4), (x + 0.24, 0.64)) for x in lefts]
        goal = Disc((lefts[GOAL_CELL] + 0.12, 0.52), 0.06, GOAL_COLOR)
        return (*floor, goal, Disc((lefts[int(self.state[0])] + 0.12, 0.52), 0.04))
