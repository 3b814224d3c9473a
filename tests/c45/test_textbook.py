"""Known answers: Quinlan's golf tree and error estimates, and cases small enough for paper."""

import math

import numpy as np
import pytest

from eutree.c45 import C45Settings, grow
from eutree.c45._kernels_pruning import add_errors
from eutree.c45.tree import C45Names, to_text

# Quinlan (1993), C4.5: Programs for Machine Learning, the golf example of chapter 2:
# outlook (0 sunny, 1 overcast, 2 rain), temperature, humidity, windy, and whether to play.
GOLF = np.array(
    [
        [0, 85, 85, 0, 0],
        [0, 80, 90, 1, 0],
        [1, 83, 78, 0, 1],
        [2, 70, 96, 0, 1],
        [2, 68, 80, 0, 1],
        [2, 65, 70, 1, 0],
        [1, 64, 65, 1, 1],
        [0, 72, 95, 0, 0],
        [0, 69, 70, 0, 1],
        [2, 75, 80, 0, 1],
        [0, 75, 70, 1, 1],
        [1, 72, 90, 1, 1],
        [1, 81, 75, 0, 1],
        [2, 71, 80, 1, 0],
    ],
    dtype=float,
)
NAMES = C45Names(
    features=("outlook", "temperature", "humidity", "windy"),
    classes=("don't play", "play"),
    values=(("sunny", "overcast", "rain"), (), (), ("false", "true")),
)
GOLF_TREE = """\
outlook = sunny:
|   humidity <= 75: play (2)
|   humidity > 75: don't play (3)
outlook = overcast: play (4)
outlook = rain:
|   windy = false: play (3)
|   windy = true: don't play (2)"""


@pytest.mark.parametrize("z", ["table", "normal"])
@pytest.mark.parametrize("prune", [True, False])
def test_golf(z: str, prune: bool) -> None:
    settings = C45Settings(z=z, prune=prune)  # type: ignore[arg-type]
    rows, classes = GOLF[:, :4], GOLF[:, 4].astype(int)
    tree = grow(rows, classes, n_classes=2, n_values=[3, 0, 0, 2], settings=settings)
    assert to_text(tree, NAMES) == GOLF_TREE
    assert tree.predict(rows).tolist() == classes.tolist()


def test_golf_with_an_unknown_outlook() -> None:
    """Chapter 3 of the book: one overcast day becomes unknown and is shared out over 13 days."""
    rows, classes = GOLF[:, :4].copy(), GOLF[:, 4].astype(int)
    rows[11, 0] = np.nan  # overcast, 72, 90, true
    tree = grow(rows, classes, n_classes=2, n_values=[3, 0, 0, 2])
    sunny, overcast, rain = tree.children(0)
    assert tree.distribution[sunny].tolist() == pytest.approx([3, 2 + 5 / 13])
    assert tree.distribution[overcast].tolist() == pytest.approx([0, 3 + 3 / 13])
    assert tree.distribution[rain].tolist() == pytest.approx([2, 3 + 5 / 13])
    # The book's figures: humidity <= 75 holds 2.0 cases, > 75 3.4 of which 0.4 are wrong.
    low, high = tree.children(sunny)
    assert tree.distribution[low].tolist() == pytest.approx([0, 2])
    assert tree.distribution[high].tolist() == pytest.approx([3, 5 / 13])
    assert to_text(tree, NAMES).splitlines()[2] == "|   humidity > 75: don't play (3.38/0.38)"
    # And its classification of a sunny day of unknown humidity: 2.0 / 5.4 of it goes left.
    shares = tree.predict_proba([[0, 70, np.nan, 0]])[0]
    left = 2 / (5 + 5 / 13)
    assert shares[1] == pytest.approx(left + (1 - left) * (5 / 13) / (3 + 5 / 13))


@pytest.mark.parametrize(
    ("cases", "errors", "rate"),
    [(6, 0, 0.206), (9, 0, 0.143), (1, 0, 0.750), (16, 1, 0.157)],
)
def test_upper_limits_of_the_book(cases: float, errors: float, rate: float) -> None:
    """Chapter 4 prints U25% (E, N) for the leaves of its example."""
    extra = add_errors(float(cases), float(errors), 0.25, C45Settings().deviate, False)
    assert (errors + extra) / cases == pytest.approx(rate, abs=5e-4)


def test_error_estimates_by_hand() -> None:
    z = C45Settings().deviate
    assert z == pytest.approx(0.84 + (0.25 - 0.84) * 0.05 / 0.2)
    assert add_errors(2.0, 0.0, 0.25, z, False) == pytest.approx(1.0)  # 2 (1 - 0.25 ** 0.5)
    assert add_errors(5.0, 4.8, 0.25, z, False) == pytest.approx(0.67 * 0.2)
    assert add_errors(5.0, 4.8, 0.25, z, True) == pytest.approx(0.2)
    base, one = (add_errors(8.0, e, 0.25, z, False) for e in (0.0, 1.0))
    assert add_errors(8.0, 0.25, 0.25, z, False) == pytest.approx(base + 0.25 * (one - base))
    assert add_errors(8.0, 3.0, 0.6, z, True) == 0.0  # J48: no addition for CF > 1/2
    normal = C45Settings(z="normal").deviate
    assert normal == pytest.approx(0.6744897501960817)


@pytest.mark.parametrize(
    ("confidence", "z"), [(0, 4.0), (0.001, 3.09), (0.05, 1.65), (0.3, 0.545), (1, 0.0)]
)
def test_deviates_come_from_the_table(confidence: float, z: float) -> None:
    assert C45Settings(confidence=confidence).deviate == pytest.approx(z)


def test_a_cut_pays_for_the_number_of_its_rivals() -> None:
    """The best of 5 cuts gains 1 - H(1/4) = 0.19 bits, less than log2(5) / 8 = 0.29."""
    values, classes = np.arange(8.0)[:, np.newaxis], [0, 1, 0, 0, 1, 1, 0, 1]
    free = C45Settings(prune=False, use_penalty=False, collapse=False)
    paid = C45Settings(prune=False, collapse=False)
    assert grow(values, classes, n_classes=2, settings=free).threshold[0] == 3
    assert grow(values, classes, n_classes=2, settings=paid).n_leaves == 1


def test_each_side_of_a_cut_needs_a_tenth_of_the_average_class() -> None:
    values = np.arange(100.0)[:, np.newaxis]
    classes = (values[:, 0] < 3).astype(int)  # three cases; a tenth of 100 / 2 classes is five
    assert grow(values, classes, n_classes=2).threshold[0] == 4
    assert grow(values, classes, n_classes=5).threshold[0] == 2  # 100 / 5 / 10 = m = 2


def test_a_subtree_that_makes_no_fewer_errors_collapses() -> None:
    values = np.arange(40.0)[:, np.newaxis]
    classes = np.zeros(40, dtype=int)
    classes[[1, 3, 5, 7, 9]] = 1  # 5 of 10 in the lower part, where 0 wins the tie
    kept = grow(values, classes, n_classes=2, settings=C45Settings(prune=False, collapse=False))
    assert kept.n_leaves > 1
    assert grow(values, classes, n_classes=2, settings=C45Settings(prune=False)).n_leaves == 1


def test_pruning_by_hand() -> None:
    """The example of chapter 4: leaves of 6, 9 and 1 cases, 3.273 errors, fall to one of 2.512."""
    values = np.repeat([0.0, 1.0, 2.0], [6, 9, 1])[:, np.newaxis]
    classes = [0] * 15 + [1]
    for prune, n_leaves in ((False, 3), (True, 1)):
        settings = C45Settings(min_objects=1, prune=prune)
        tree = grow(values, classes, n_classes=2, n_values=[3], settings=settings)
        assert tree.n_leaves == n_leaves


def test_ties_go_to_the_first_attribute_and_the_smallest_threshold() -> None:
    column = np.array([0.0, 0, 1, 1, 2, 2])
    classes = [0, 0, 1, 1, 0, 0]
    rows = np.column_stack([column, column, -column])
    tree = grow(rows, classes, n_classes=2, settings=C45Settings.lossless())
    assert tree.feature[0] == 0
    assert tree.threshold[0] == 0.0
    order = np.array([5, 3, 0, 2, 4, 1])
    again = grow(
        rows[order], np.array(classes)[order], n_classes=2, settings=C45Settings.lossless()
    )
    assert again.feature.tolist() == tree.feature.tolist()
    assert np.array_equal(again.threshold, tree.threshold, equal_nan=True)


def test_equal_parts_of_cases_are_a_tie_in_any_order() -> None:
    """Value 2 holds one case and three tenths of three of each class: sums differ in the end."""
    unknown = np.nan
    cases = [(unknown, 1)] * 3 + [(2, 1), (2, 0)] + [(unknown, 0)] * 3 + [(0, 0)] * 9 + [(1, 1)] * 9
    for ordered in (cases, cases[::-1]):
        rows, classes = np.array(ordered, dtype=float).T
        for prune in (False, True):
            settings = C45Settings(prune=prune)
            tree = grow(
                rows[:, None], classes.astype(int), n_classes=2, n_values=[3], settings=settings
            )
            assert tree.predict([[0.0], [1.0], [2.0]]).tolist() == [0, 1, 0]
            assert tree.predict([[unknown]]).tolist() == [0]


def test_lossless_settings_keep_every_action() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        rows = rng.integers(0, 5, size=(60, 3)).astype(float)
        actions = (rows.astype(int).sum(axis=1) ** 2) % 4  # a function of the row, but a wild one
        tree = grow(rows, actions, n_classes=4, settings=C45Settings.lossless())
        assert np.array_equal(tree.predict(rows), actions)
    checkers = np.array([[0.0, 0], [0, 1], [1, 0], [1, 1]])  # no first cut gains anything
    tree = grow(checkers, [0, 1, 1, 0], n_classes=2, settings=C45Settings.lossless())
    assert tree.predict(checkers).tolist() == [0, 1, 1, 0]


def test_a_branch_without_cases_predicts_the_class_above() -> None:
    rows = [[0.0], [0.0], [1.0], [1.0], [1.0]]
    tree = grow(rows, [0, 0, 1, 1, 1], n_classes=2, n_values=[3])
    assert tree.n_leaves == 3
    assert tree.predict_proba([[2.0]]).tolist() == [[0.4, 0.6]]


def test_the_tree_is_frozen() -> None:
    tree = grow([[0.0], [1.0]], [0, 1], n_classes=2)
    with pytest.raises(ValueError, match="read-only"):
        tree.threshold[0] = math.pi
