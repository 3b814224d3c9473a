"""The same trees as Weka's J48, an implementation that shares no line with ours."""

from pathlib import Path

import numpy as np
import pytest

from eutree.c45 import C45Settings, grow
from tests.c45 import weka
from tests.c45.random_sets import random_set

N_RANDOM = 200

# What may differ: J48 sums distributions in another order, so that two tests whose gains differ by
# about its tolerance of 1e-6 may change places. At most 2 % of the data sets may show it.
MOST_DEVIATIONS = 0.02

OPTIONS = {
    "-U -M 2": C45Settings(z="normal", gap=1e-5, prune=False),
    "-C 0.25 -M 2 -S": C45Settings(z="normal", gap=1e-5, subtree_raising=False),
    "-C 0.25 -M 2": C45Settings(z="normal", gap=1e-5),
    "-C 0.1 -M 5": C45Settings(z="normal", gap=1e-5, confidence=0.1, min_objects=5),
}


def real_sets() -> dict[str, weka.DataSet]:
    """Return the data sets that ship inside scikit-learn."""
    datasets = pytest.importorskip("sklearn.datasets")
    found = {}
    for name in ("iris", "wine", "breast_cancer", "digits"):
        observations, actions = getattr(datasets, f"load_{name}")(return_X_y=True)
        n_classes, n_features = int(actions.max()) + 1, observations.shape[1]
        found[name] = weka.DataSet(
            observations, actions.astype(np.int64), n_classes, (0,) * n_features
        )
    return found


def deviations(
    sets: list[weka.DataSet], options: str, settings: C45Settings, folder: Path
) -> list[str]:
    """Return how our trees differ from J48's, one line for each that does."""
    found = []
    for number, (data, (nodes, shares)) in enumerate(
        zip(sets, weka.trees(sets, options, folder), strict=True)
    ):
        tree = grow(
            data.observations,
            data.actions,
            n_classes=data.n_classes,
            n_values=data.n_values,
            settings=settings,
        )
        ours = weka.preorder(tree)
        if not weka.same_structure(ours, nodes):
            found.append(f"{number}: {ours} is not {nodes}")
        elif not np.allclose(tree.predict_proba(data.observations), shares, atol=1e-6, rtol=0):
            found.append(f"{number}: probabilities differ")
    return found


# The plain runs of J48, raw and pruned, are quick enough for every run of the tests.
CHOICES = [
    pytest.param(options, marks=[pytest.mark.slow] if number % 2 else [])
    for number, options in enumerate(OPTIONS)
]


@pytest.mark.parametrize("options", CHOICES)
def test_random_sets(options: str, tmp_path: Path) -> None:
    sets = [random_set(seed) for seed in range(N_RANDOM)]
    found = deviations(sets, options, OPTIONS[options], tmp_path)
    assert len(found) <= MOST_DEVIATIONS * N_RANDOM, "\n".join(found)


@pytest.mark.parametrize("options", CHOICES)
def test_real_sets(options: str, tmp_path: Path) -> None:
    assert deviations([*real_sets().values()], options, OPTIONS[options], tmp_path) == []


def test_the_comparison_notices_release_8(tmp_path: Path) -> None:
    """A control: with the tabulated deviate some pruned trees must differ from J48's."""
    sets = [random_set(seed) for seed in range(40)]
    assert deviations(sets, "-C 0.25 -M 2", C45Settings(gap=1e-5), tmp_path)
