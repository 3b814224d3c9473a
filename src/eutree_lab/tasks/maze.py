"""The four mazes of Al-Ansari's thesis, in which parti-game's variants were compared."""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.validation import check_choice, check_number
from eutree_lab.tasks._domain import ModelledDomain
from eutree_lab.tasks._sketch import GOAL_COLOR, Disc, Line, Patch, Sketch
from eutree_lab.tasks._walls import BORDER, PLANS, SIDE, walk

STEP = 0.1  # length of a step
TURNS = np.arange(8) * np.pi / 4.0  # clockwise from north
MOVES = STEP * np.stack([np.sin(TURNS), np.cos(TURNS)], axis=1).round(15)  # [8, 2]


class MazeEnv(ModelledDomain):
    """Find a small goal in a square with walls, without a map.

    ## Description
    A point moves in steps of 0.1 in a square of side 10 and is halted at walls. The mazes a to d
    are those of M. A. Al-Ansari, *Efficient Reinforcement Learning in Continuous Environments*
    (PhD thesis, Northeastern University, 2001), read off its figures; the goal's size is not
    stated there.

    ## Action Space
    ``Discrete(8)``: `north`, `northeast`, `east`, ... `northwest`, clockwise.

    ## Observation Space
    | Index | Name | Unit | Min | Max | Meaning |
    |---|---|---|---|---|---|
    | 0 | `x` | | 0 | 10 | how far east |
    | 1 | `y` | | 0 | 10 | how far north |

    ## Rewards
    -1 for each step.

    ## Starting State
    A fixed point: (1, 1) in mazes a, b and c, (1, 9) in maze d.

    ## Episode End
    - Terminated: the point is in the goal box (``info["ending"] == "goal"``).
    - Truncated: the trial limit is over (``"time limit"``).

    ## Arguments
    | Name | Default | Meaning |
    |---|---|---|
    | `maze` | "a" | which maze: "a", "b", "c" or "d" |
    | `noise` | 0.0 | standard deviation of a step's end, as a share of its length |
    | `trial_limit` | 2000 | steps after which the episode is cut short |
    | `render_mode` | None | `"human"` or `"rgb_array"` |

    ## Version History
    * v0: first version.
    """

    feature_names, feature_units = ("x", "y"), ("", "")
    action_names = (
        "north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest",
    )  # fmt: skip

    def __init__(
        self, *, maze: str = "a", noise: float = 0.0, trial_limit: int = 2000,
        render_mode: str | None = None,
    ) -> None:  # fmt: skip
        plan = PLANS[check_choice("maze", maze, PLANS)]
        self.maze, self.noise = maze, check_number("noise", noise, low=0.0)
        self.goal = np.array(plan.goal, dtype=np.float64).reshape(2, 2)  # lower, upper corner
        self._first = np.array(plan.start, dtype=np.float64)
        self._walls = np.array(plan.walls + BORDER, dtype=np.float64)  # [W, 4]
        super().__init__([0.0, 0.0], [SIDE, SIDE], trial_limit, render_mode)

    def _start(self) -> Floats:
        return self._first.copy()

    def _move(self, state: Floats, action: int) -> tuple[Floats, float, str]:
        move = MOVES[[action]]
        if self.noise:
            move = move + self.noise * STEP * self.np_random.standard_normal((1, 2))
        after, rewards, endings = self._judged(walk(self._walls, state[np.newaxis], move))
        return after[0], float(rewards[0]), self.endings[int(endings[0])]

    def _advance(self, states: Floats, actions: Integers) -> tuple[Floats, Floats, Integers]:
        return self._judged(walk(self._walls, states, MOVES[actions]))

    def _judged(self, after: Floats) -> tuple[Floats, Floats, Integers]:
        there = ((self.goal[0] <= after) & (after <= self.goal[1])).all(axis=1)
        return after, np.full(len(after), -1.0), there.astype(np.int64)

    def _sketch(self) -> Sketch:
        def at(x: float, y: float) -> tuple[float, float]:
            return x / SIDE, y / SIDE

        goal = Patch(at(*self.goal[0].tolist()), at(*self.goal[1].tolist()), GOAL_COLOR)
        walls = [Line((at(*wall[:2]), at(*wall[2:]))) for wall in self._walls.tolist()]
        return (goal, *walls, Disc(at(*self.state.tolist())))
