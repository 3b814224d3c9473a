import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.errors import FormatError
from eutree.evaluation import CurvePoint, curve_from_csv, curve_to_csv

POINTS = st.lists(
    st.builds(
        CurvePoint,
        episode=st.integers(0, 10**6),
        steps=st.integers(0, 10**9),
        success_rate=st.none() | st.floats(0.0, 1.0),
        mean_return=st.floats(allow_nan=False, allow_infinity=False),
        n_leaves=st.integers(1, 10**4),
    )
)


@given(POINTS)
def test_a_curve_reads_back_to_the_same_bits(points):
    text = curve_to_csv(points)
    assert list(curve_from_csv(text)) == points
    assert curve_to_csv(curve_from_csv(text)) == text


def test_the_text_is_plain():
    points = [CurvePoint(0, 0, None, -1.5, 1), CurvePoint(20, 640, 0.75, 82.0, 9)]
    assert curve_to_csv(points) == (
        "episode,steps,success_rate,mean_return,n_leaves\n0,0,,-1.5,1\n20,640,0.75,82.0,9\n"
    )
    assert points[1].describe() == "success 75%, return 82.0, 9 leaves"
    assert points[0].describe() == "return -1.5, 1 leaf"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: must name the columns"),
        ("episode,steps\n1,2\n", "must name the columns success_rate, mean_return, n_leaves"),
        ("episode,steps,success_rate,mean_return,n_leaves\n0,0,,x,1\n", "line 2: Expected `float`"),
        ("episode,steps,success_rate,mean_return,n_leaves\n0,0,,nan,1\n", "line 2: must hold"),
        ("episode,steps,success_rate,mean_return,n_leaves\n0,0,2,1,1\n", "line 2: must hold"),
        ("episode,steps,success_rate,mean_return,n_leaves\n0,0\n", "line 2"),
    ],
)
def test_a_text_that_is_no_curve_is_refused(text, message):
    with pytest.raises(FormatError, match=f"runs/a/curve.csv: .*{message}"):
        curve_from_csv(text, path="runs/a/curve.csv")


def curve(successes, *, start=0):
    return [
        CurvePoint(start + 20 * i, 500 * i, success, 100.0 * (success or 0.0), i + 1)
        for i, success in enumerate(successes)
    ]
