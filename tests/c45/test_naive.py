"""The compiled learner against its slow twin, on random data with ties and unknown values."""

import math
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.c45 import C45Settings, C45Tree, grow
from eutree.compiled import ENABLED
from tests.c45.random_sets import random_set
from tests.naive_c45 import Naive, Node, predict

VARIANTS = {
    "release 8": C45Settings(),
    "unpruned": C45Settings.unpruned(),
    "j48": C45Settings(z="normal", gap=1e-5),
    "strict": C45Settings(confidence=0.05, min_objects=5),
    "lenient": C45Settings(confidence=0.6, subtree_raising=False, collapse=False, min_objects=1),
    "lossless": C45Settings.lossless(),
}


def compare(naive: Node, tree: C45Tree, node: int = 0) -> None:
    """Fail unless both subtrees have the same tests and (to rounding) the same classes."""
    assert tree.distribution[node] == pytest.approx(naive.classes, abs=1e-8)
    assert tree.feature[node] == naive.feature
    assert tree.n_children[node] == len(naive.children)
    if naive.feature >= 0:
        assert tree.threshold[node] == naive.threshold or math.isnan(naive.threshold)
        assert tree.n_values[naive.feature] == naive.n_values
        for below, child in zip(naive.children, tree.children(node), strict=True):
            compare(below, tree, child)


def check(
    rows: np.ndarray[Any, Any],
    labels: np.ndarray[Any, Any],
    n_classes: int,
    n_values: list[int],
    weights: np.ndarray[Any, Any],
    variant: C45Settings,
) -> None:
    cases = [
        (tuple(row), int(label), float(weight))
        for row, label, weight in zip(rows.tolist(), labels, weights, strict=True)
    ]
    naive = Naive(cases, n_values, n_classes, variant).tree()
    tree = grow(
        rows, labels, n_classes=n_classes, n_values=n_values, weights=weights, settings=variant
    )
    compare(naive, tree)
    expected = np.array([predict(naive, row) for row, _, _ in cases])
    assert np.allclose(tree.predict_proba(rows), expected, atol=1e-9, rtol=0)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("seed", range(12))
def test_random_sets(variant: str, seed: int) -> None:
    data = random_set(1000 + seed, largest=80)
    weights = np.ones(len(data.actions))
    if seed % 3 == 0:
        weights = np.random.default_rng(seed).choice([0.5, 1.0, 2.0, 3.0], size=len(weights))
    check(
        data.observations,
        data.actions,
        data.n_classes,
        list(data.n_values),
        weights,
        VARIANTS[variant],
    )


CELL = st.one_of(st.integers(0, 3).map(float), st.just(math.nan))


@settings(max_examples=200)
@given(data=st.data())
def test_small_sets(data: st.DataObject) -> None:
    n_values = data.draw(st.lists(st.sampled_from([0, 0, 4]), min_size=1, max_size=3))
    row = st.tuples(*[CELL] * len(n_values), st.integers(0, 2))
    table = np.array(data.draw(st.lists(row, min_size=1, max_size=25)))
    variant = VARIANTS[data.draw(st.sampled_from(sorted(VARIANTS)))]
    check(table[:, :-1], table[:, -1].astype(int), 3, n_values, np.ones(len(table)), variant)


def fingerprint() -> str:
    """Return the bytes of some trees, as text."""
    trees = []
    for seed in range(8):
        data = random_set(2000 + seed, largest=60)
        tree = grow(
            data.observations, data.actions, n_classes=data.n_classes, n_values=data.n_values
        )
        arrays = (tree.feature, tree.threshold, tree.first_child, tree.distribution)
        arrays += (tree.predict_proba(data.observations),)
        trees.append("".join(array.tobytes().hex() for array in arrays))
    return "\n".join(trees)


@pytest.mark.promise(15)
@pytest.mark.skipif(not ENABLED, reason="this process runs the plain code already")
def test_plain_python_gives_the_same_bytes() -> None:
    code = "from tests.c45.test_naive import fingerprint; print(fingerprint())"
    environment = os.environ | {"EUTREE_JIT": "0", "PYTHONPATH": "src:."}
    result = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == fingerprint()
