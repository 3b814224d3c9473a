"""What the figures of opponent speeds show where there is nothing to see."""

import pytest
from matplotlib.figure import Figure

from eutree_lab.paper.experiment import FULL
from eutree_lab.paper.figure_4_5 import draw_4b
from eutree_lab.paper.runs import Performance, Point, RunRecord


def record(speed, run, success):
    return RunRecord(
        spec=FULL.spec("eutree/Evasion2-v0", "eu-tree", "paper", run, speed),
        expert=Performance(success[0], 80.0, 9),
        curve=[Point(20 * i, s, 100 * s, 9) for i, s in enumerate(success)],
        final=Performance(success[-1], 80.0, 9),
        compressed=None,
        agreement=None,
    )


@pytest.mark.parametrize(("success", "said"), [((1.0, 1.0, 1.0), 1), ((0.1, 0.95, 1.0), 0)])
def test_learning_times_of_nothing_are_said_in_words(success, said):
    records = [record(speed, run, success) for speed in (2.2, 3.2) for run in range(3)]
    axes = Figure().subplots()
    draw_4b(axes, records)
    assert len(axes.texts) == said
    assert max(bar.get_height() for bar in axes.patches) == (0.0 if said else 20.0)
    assert axes.get_ylim()[0] >= -1e-9  # episodes are never negative
