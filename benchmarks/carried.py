"""The boxes of pieces of the starts at each step, for what real states are laid beside."""

from collections.abc import Iterator

import numpy as np

from eutree.arrays import Floats
from eutree.proof import Plant
from eutree.proof.reach import Acting, _Boxes, first_action


def boxes_along(
    acting: Acting, plant: Plant, pieces: tuple[Floats, Floats], steps: int
) -> Iterator[tuple[Floats, Floats]]:
    """Yield the boxes of pieces after each step, as a proof carries them: bounds [N, d] each.

    Where several actions are possible in a box, nothing is said of it from there on: its bounds are
    infinite.

    Args:
        acting: The policy on boxes.
        plant: Moves the boxes.
        pieces: Lower and upper bounds of the starts, shapes [N, d].
        steps: How many steps.
    """
    start = np.array(plant.start, dtype=np.float64)
    boxes = _Boxes.beginning(pieces[0].T, pieces[1].T, start[:, 1] > start[:, 0])
    known = np.ones(len(boxes), dtype=bool)
    for _ in range(steps):
        possible = acting(boxes.state())
        known &= (possible & (possible - 1)) == 0
        boxes = boxes.at(plant.step(boxes.state(), first_action(possible)))
        state = boxes.state()
        low, high = (np.stack([getattr(x, end) for x in state], 1) for end in ("low", "high"))
        yield np.where(known[:, None], low, -np.inf), np.where(known[:, None], high, np.inf)
