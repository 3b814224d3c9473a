"""The colours of actions: one each, readable, and in order where the actions are."""

import numpy as np
import pytest

from eutree.export.drawing import FILLS, fills
from eutree.schema import Control, Schema, combined_actions


def of_levels(*levels):
    controls = (Control("torque", "N m", levels),)
    return fills(Schema(Schema.anonymous(1, 2).features, combined_actions(controls), controls))


def luminance(colour):
    parts = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255
    parts = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(parts @ [0.2126, 0.7152, 0.0722])


TORQUES = tuple(np.linspace(-2, 2, 12).tolist())


@pytest.mark.parametrize("colours", [fills(Schema.anonymous(1, 24)), of_levels(*TORQUES)])
def test_every_action_has_a_readable_colour_of_its_own(colours):
    """Twelve actions had eight colours."""
    assert len(set(colours)) == len(colours)
    for colour in colours:
        assert (luminance(colour) + 0.05) / (luminance("#10161d") + 0.05) >= 7.0


def test_few_actions_keep_their_colours():
    assert fills(Schema.anonymous(1, 3)) == FILLS[:3]


def test_levels_are_in_order():
    def warmth(colour):
        return int(colour[1:3], 16) - int(colour[5:7], 16)

    for levels in (TORQUES, (0.0, 25.0, 50.0, 75.0, 100.0)):
        found = [warmth(colour) for colour in of_levels(*levels)]
        assert found == sorted(found)
    assert of_levels(-1.0, 0.0, 1.0)[1] == of_levels(0.0, 1.0)[0]  # 0 is grey
