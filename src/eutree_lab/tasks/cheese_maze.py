"""McCallum's cheese maze: cells that look alike, and only the way tells them apart."""

import numpy as np

from eutree.arrays import Floats
from eutree_lab.tasks._domain import Domain
from eutree_lab.tasks._sketch import GOAL_COLOR, Disc, Patch, Sketch

ROWS = ("#####", "# # #", "# # #")  # '#' is a cell, top row first
CELLS = [(x, y) for y, row in enumerate(ROWS) for x, cell in enumerate(row) if cell == "#"]
CHEESE = CELLS.index((2, 2))
DIRECTIONS = ((0, -1), (1, 0), (0, 1), (-1, 0))


def _way(cell: int, x: int, y: int) -> int:
    """Return where a move leads from a cell: the next cell, or the same one at a wall."""
    to = (CELLS[cell][0] + x, CELLS[cell][1] + y)
    return CELLS.index(to) if to in CELLS else cell


WAYS = np.array(
    [[_way(cell, x, y) for x, y in DIRECTIONS] for cell in range(len(CELLS))]
)  # [11, 4]
OWN = np.arange(len(CELLS))[:, np.newaxis]
VIEWS = np.append(OWN == WAYS, OWN == CHEESE, axis=1).astype(np.float64)  # [11, 5]


class CheeseMazeEnv(Domain):
    """Find the cheese where only the walls around one's own cell are seen.

    ## Description
    Eleven cells in the shape of an M. A mouse sees which of its four neighbours are walls, and the
    cheese once it has it: seven views of eleven cells, so it has to remember (R. A. McCallum, PhD
    thesis, 1996).
    Once at the cheese, the next action, whichever it is, takes it to another cell drawn at
    random. Rewards are those of J. Veness et al. (JAIR 40, 2011), who report 1.28 a step as nearly
    optimal; with the step that takes the mouse away, 6.7 / 5.3 = 1.264 is optimal.

    ## Action Space
    ``Discrete(4)``: `north`, `east`, `south`, `west`.

    ## Observation Space
    | Index | Name | Unit | Min | Max | Meaning |
    |---|---|---|---|---|---|
    | 0 | `wall_north` | | 0 | 1 | 1 if there is a wall |
    | 1 | `wall_east` | | 0 | 1 | 1 if there is a wall |
    | 2 | `wall_south` | | 0 | 1 | 1 if there is a wall |
    | 3 | `wall_west` | | 0 | 1 | 1 if there is a wall |
    | 4 | `cheese` | | 0 | 1 | 1 at the cheese |

    ## Rewards
    +10 for the cheese, -10 for running into a wall, -1 for any other move, 0 for being taken away.

    ## Starting State
    Any cell but that of the cheese, with equal chances.

    ## Episode End
    - Terminated: never.
    - Truncated: the trial limit is over (``info["ending"] == "time limit"``).

    ## Arguments
    | Name | Default | Meaning |
    |---|---|---|
    | `trial_limit` | 200 | steps after which the episode is cut short |
    | `render_mode` | None | `"human"` or `"rgb_array"` |

    ## Version History
    * v0: first version.
    """

    feature_names = ("wall_north", "wall_east", "wall_south", "wall_west", "cheese")
    feature_units = ("",) * 5
    action_names = ("north", "east", "south", "west")

    def __init__(self, *, trial_limit: int = 200, render_mode: str | None = None) -> None:
        super().__init__([0.0] * 5, [1.0] * 5, trial_limit, render_mode)

    def _start(self) -> Floats:
        others = np.delete(np.arange(len(CELLS)), CHEESE)
        return np.array([float(self.np_random.choice(others))])

    def _observe(self) -> Floats:
        view: Floats = VIEWS[int(self.state[0])].copy()
        return view

    def _move(self, state: Floats, action: int) -> tuple[Floats, float, str]:
        cell = int(state[0])
        if cell == CHEESE:
            return self._start(), 0.0, ""
        to = int(WAYS[cell, action])
        reward = 10.0 if to == CHEESE else -10.0 if to == cell else -1.0
        return np.array([float(to)]), reward, ""

    def _sketch(self) -> Sketch:
        corners = [(x / 5.0, 0.7 - y / 5.0) for x, y in CELLS]
        floor = [Patch((x, y), (x + 0.19, y + 0.19)) for x, y in corners]
        middles = [(x + 0.095, y + 0.095) for x, y in corners]
        cheese = Disc(middles[CHEESE], 0.05, GOAL_COLOR)
        return (*floor, cheese, Disc(middles[int(self.state[0])], 0.035))
