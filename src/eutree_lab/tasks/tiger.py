"""Tiger: listen until it is clear enough behind which door it is."""

import numpy as np

from eutree.arrays import Floats
from eutree.validation import check_number
from eutree_lab.tasks._domain import Domain
from eutree_lab.tasks._sketch import AGENT, GOAL_COLOR, OPPONENT, Disc, Patch, Sketch

LISTEN, OPEN_LEFT, OPEN_RIGHT = range(3)


class TigerEnv(Domain):
    """Open the door that hides the gold, not the tiger; listening helps, and costs.

    ## Description
    Behind one of two doors is a tiger, behind the other gold. Listening tells the tiger's side
    with a chance of 85 %. After a door was opened, tiger and gold are put behind the doors again
    and nothing is heard (L. P. Kaelbling, M. L. Littman and A. R. Cassandra, Artificial
    Intelligence 101, 1998; rewards of J. Veness et al., JAIR 40, 2011). Listening until one side
    was heard two times more than the other earns 1.084 a step, which is optimal; Veness et al.
    report 1.12 as measured.

    ## Action Space
    ``Discrete(3)``: `listen`, `open left`, `open right`.

    ## Observation Space
    | Index | Name | Unit | Min | Max | Meaning |
    |---|---|---|---|---|---|
    | 0 | `heard` | | -1 | 1 | the tiger: left (-1), right (1), not listened (0) |

    ## Rewards
    -1 for listening, +10 for the gold, -100 for the tiger.

    ## Starting State
    The tiger is left or right with equal chances.

    ## Episode End
    - Terminated: never.
    - Truncated: the trial limit is over (``info["ending"] == "time limit"``).

    ## Arguments
    | Name | Default | Unit | Meaning |
    |---|---|---|---|
    | `accuracy` | 0.85 | | chance that listening tells the right side |
    | `trial_limit` | 100 | | steps after which the episode is cut short |
    | `render_mode` | None | | `"human"` or `"rgb_array"` |

    ## Version History
    * v0: first version.
    """

    feature_names, feature_units = ("heard",), ("",)
    action_names = ("listen", "open left", "open right")

    def __init__(
        self, *, accuracy: float = 0.85, trial_limit: int = 100, render_mode: str | None = None
    ) -> None:
        self.accuracy = check_number("accuracy", accuracy, low=0.5, high=1.0)
        super().__init__([-1.0], [1.0], trial_limit, render_mode)

    def _start(self) -> Floats:
        """Return the tiger's side, and that nothing was heard."""
        return np.array([float(self.np_random.choice([-1, 1])), 0.0])

    def _observe(self) -> Floats:
        return self.state[1:].copy()

    def _move(self, state: Floats, action: int) -> tuple[Floats, float, str]:
        tiger = float(state[0])
        if action == LISTEN:
            right = self.np_random.random() < self.accuracy
            return np.array([tiger, tiger if right else -tiger]), -1.0, ""
        opened = -1.0 if action == OPEN_LEFT else 1.0
        return self._start(), -100.0 if opened == tiger else 10.0, ""

    def _sketch(self) -> Sketch:
        tiger, heard = self.state.tolist()
        doors = [Patch((x, 0.3), (x + 0.25, 0.8)) for x in (0.15, 0.6)]
        behind = [
            Disc((0.5 + side * 0.225, 0.55), 0.06, color)
            for side, color in ((tiger, OPPONENT), (-tiger, GOAL_COLOR))
        ]
        return (*doors, *behind, Disc((0.5 + 0.225 * heard, 0.15), 0.04, AGENT))
