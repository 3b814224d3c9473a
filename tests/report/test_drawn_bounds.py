"""Between which values features are drawn."""

import numpy as np
import pytest

from eutree.data import Demonstrations, Episode
from eutree.report.demonstrations_page import drawn_bounds
from eutree.schema import Feature, Schema


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        ([-1.0, 3.0], (-1.0, 3.0)),  # a fifth of the bounds: the values seen
        ([-6.0, 6.0], (-10.0, 10.0)),  # most of them: the bounds
        ([2.0, 2.0], (-10.0, 10.0)),  # never moved
        ([-0.0, 3.0], (0.0, 3.0)),
    ],
)
def test_a_feature_is_drawn_where_something_was_seen(values, ends):
    schema = Schema((Feature("x", low=-10, high=10),), ("a", "b"))
    rows = np.array([[value] for value in [*values, values[-1]]])
    episode = Episode(rows, [0, 1], np.zeros(2), terminated=True, truncated=False)
    low, high = drawn_bounds(Demonstrations((episode,), schema))
    assert (low[0], high[0]) == ends
    assert str(low[0]) == str(ends[0])  # 0 and not -0
