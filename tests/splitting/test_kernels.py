"""The compiled search against integer oracles; blocks and strips are forced to be small too."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from eutree import compiled
from eutree.splitting import _kernels, _kernels_sorting
from tests import naive_splitting as naive
from tests.splitting.samples import adversarial_returns, tied_sample

N_CASES = 10_000 if compiled.ENABLED else 100
SCORES = ("scaled", "distance")


def kernel(x, q, *, min_leaf=1, score="scaled", floor=0.0, block=0, brute=_kernels.BRUTE):
    rows = np.arange(q.size)
    return _kernels.best_of_sample(x, q, rows, min_leaf, score == "distance", floor, block, brute)


def agrees(found, expected):
    """Whether score, attribute, cut, |W| and both values at the cut are identical."""
    feature, cut, weight, score, left, right = found
    if expected is None:
        return (feature, cut) == (-1, 0)
    return expected == (score, feature, left, right, weight, cut)


@pytest.mark.promise(15)
def test_identical_to_the_integer_oracle_on_many_tied_cases():
    generator = np.random.default_rng(20060626)
    for case in range(N_CASES):
        x, q = tied_sample(generator, case, largest=60)
        min_leaf, score = int(generator.integers(1, 6)), SCORES[case % 2]
        expected = naive.integer_best_cut(x, q, min_leaf=min_leaf, score=score)
        options = {"min_leaf": min_leaf, "score": score}
        brute = kernel(x, q, **options)
        strips = kernel(x, q, **options, brute=0, block=case % 4)
        assert agrees(brute, expected), f"case {case}: {brute} is not {expected}"
        assert agrees(strips, expected), f"case {case}: {strips} is not {expected}"


@pytest.mark.parametrize("score", SCORES)
@pytest.mark.parametrize("block", [0, 3, 40])
def test_identical_on_adversarial_cases(score, block):
    n = 1500 if compiled.ENABLED else 60
    x = np.arange(n, dtype=float)[:, None]
    for name, q in adversarial_returns(n):
        expected = naive.integer_best_cut(x, q, min_leaf=2, score=score)
        found = kernel(x, q, min_leaf=2, score=score, block=block, brute=0)
        assert agrees(found, expected), name


def test_equals_the_definition_in_exact_rationals():
    generator = np.random.default_rng(3)
    for case in range(300 if compiled.ENABLED else 30):
        x, q = tied_sample(generator, case, largest=14)
        for score in SCORES:
            expected = naive.best_cut(x, q, min_leaf=1, score=score)
            found = kernel(x, q, score=score, brute=0, block=2)
            assert agrees(found, expected and (float(expected[0]), *expected[1:]))


@pytest.mark.skipif(not compiled.ENABLED, reason="too slow without compilation")
@pytest.mark.parametrize("n", [46_340, 46_341, 92_682])
@pytest.mark.promise(15)
def test_both_sides_of_the_limits_of_32_bits(n):
    """n^2 passes 2^31 at 46,341 and the largest |W|, n^2 / 4, at 92,682."""
    generator = np.random.default_rng(n)
    x = generator.permutation(n).astype(float)[:, None]
    for q in (
        (x[:, 0] >= n // 2).astype(float),  # |W| = n^2 / 4
        generator.integers(0, 3, size=n) + 1.0 * (x[:, 0] > n // 3),
    ):
        expected = naive.integer_best_cut(x, q, min_leaf=10, score="scaled")
        assert agrees(kernel(x, q, min_leaf=10), expected)


@pytest.mark.skipif(not compiled.ENABLED, reason="too slow without compilation")
def test_brute_force_is_exact_up_to_its_largest_sample():
    n = 1 << 15
    x = np.arange(n, dtype=float)[:, None]
    q = (x[:, 0] >= n // 2).astype(float)
    assert kernel(x, q, brute=n)[:3] == (0, n // 2, n * n / 4)


@pytest.mark.parametrize("score", SCORES)
@pytest.mark.parametrize("brute", [0, 10_000])
def test_a_floor_hides_what_is_not_above_it(score, brute):
    generator = np.random.default_rng(8)
    x, q = np.round(generator.normal(size=(150, 2)), 1), np.round(generator.normal(size=150), 1)
    best = kernel(x, q, score=score, brute=brute)
    options = {"score": score, "brute": brute, "block": 3}
    assert kernel(x, q, floor=np.nextafter(best[3], 0.0), **options) == best
    assert kernel(x, q, floor=best[3], **options)[0] == -1
    assert kernel(x, q, floor=np.nextafter(best[3], np.inf), **options)[0] == -1


def test_monotone_maps_change_nothing_and_reversal_keeps_the_score():
    generator = np.random.default_rng(9)
    for case in range(60):
        x, q = tied_sample(generator, case % 6)
        found = kernel(x, q, brute=0, block=2)
        assert kernel(np.arctan(x), np.exp(q), brute=0, block=2)[:4] == found[:4]
        assert kernel(-x, -q, brute=0, block=2)[3] == found[3]


@pytest.mark.parametrize("n", [2, 50, 3000])
def test_sorting_is_exact_where_the_coarse_image_is_not(n):
    generator = np.random.default_rng(n)
    columns = {
        "noise": generator.normal(size=n),
        "outliers": generator.standard_cauchy(size=n) ** 9,
        "neighbours": 1.0 + np.spacing(1.0) * generator.integers(0, n, size=n),
        "zeros": generator.choice([0.0, -0.0, 5e-324, -5e-324], size=n),
        "huge": generator.choice([-1.7e308, 1.7e308, 1.0], size=n),
        "one far": np.append(generator.normal(size=n - 1), 1e200),
        "constant": np.full(n, 3.25),
    }
    for name, column in columns.items():
        label = generator.permutation(n)
        entry = np.argsort(label)
        differs = np.empty(n, dtype=np.bool_)
        keys, spare = np.empty((2, n), dtype=np.int64)
        order = _kernels_sorting.sorted_labels(column, label, entry, keys, spare, differs)
        assert sorted(order) == list(range(n)), name
        values = column[entry[order]]
        assert np.array_equal(values, np.sort(column)), name
        assert not differs[0], name
        assert np.array_equal(differs[1:], values[:-1] < values[1:]), name


@pytest.mark.skipif(not compiled.ENABLED, reason="there is nothing to compare with")
@pytest.mark.promise(15)
def test_the_plain_code_gives_the_same_results():
    """The same cases in a process without compilation: every field is equal, bit for bit."""
    environment = os.environ | {"EUTREE_JIT": "0", "PYTHONPATH": os.pathsep.join(sys.path)}
    program = "from tests.splitting.test_kernels import results; print(results())"
    plain = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env=environment,
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    assert plain.stdout.strip() == str(results())


def results():
    """Return what the search finds in some cases, as numbers of Python."""
    generator = np.random.default_rng(12)
    found = []
    for case in range(90):
        x, q = tied_sample(generator, case, largest=250)
        score = SCORES[case % 2]
        for brute in (0, 10_000):
            fields = kernel(x, q, min_leaf=2, score=score, brute=brute, block=case % 7)
            found.append(tuple(float(field).hex() for field in fields))
    return found
