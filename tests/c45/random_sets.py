"""Random training sets for comparisons: ties, duplicates, constants, nominal and unknown values."""

import numpy as np

from tests.c45.weka import DataSet


def random_set(seed: int, *, largest: int = 300) -> DataSet:
    """Return a data set of 12 to ``largest`` rows, 1 to 6 attributes and 2 to 5 classes.

    Seeds take turns: continuous only, with unknown values, with nominal attributes, with both.
    Continuous values have at most four decimals, so no two are closer than J48's gap.
    """
    rng = np.random.default_rng(seed)
    n_rows, n_features = int(rng.integers(12, largest)), int(rng.integers(1, 7))
    n_classes = int(rng.integers(2, 6))
    nominal, unknown = seed % 4 >= 2, seed % 2 == 1
    columns, n_values = zip(
        *[_column(rng, n_rows, nominal and rng.random() < 0.4) for _ in range(n_features)],
        strict=True,
    )
    observations = np.column_stack(columns)
    noise = rng.normal(size=n_rows) * rng.choice([0.1, 0.5, 2.0])
    score = observations @ rng.normal(size=n_features) + noise
    actions = np.searchsorted(np.quantile(score, np.sort(rng.random(n_classes - 1))), score)
    if rng.random() < 0.3:  # duplicated rows, half of the time with contradicting classes
        again = rng.integers(0, n_rows, n_rows // 3)
        other = rng.integers(0, n_classes, len(again))
        repeated = other if rng.random() < 0.5 else actions[again]
        observations = np.vstack([observations, observations[again]])
        actions = np.concatenate([actions, repeated])
    if unknown:
        share = rng.choice([0.02, 0.1, 0.3])
        observations[rng.random(observations.shape) < share] = np.nan
    return DataSet(observations, actions.astype(np.int64), n_classes, n_values)


def _column(
    rng: np.random.Generator, n_rows: int, nominal: bool
) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], int]:
    if nominal:
        n_values = int(rng.integers(2, 7))
        return rng.integers(0, n_values, n_rows).astype(float), n_values
    values = rng.normal(size=n_rows)
    kinds = [np.round(values, 4), np.round(values, 1), np.round(values), np.full(n_rows, 3.0)]
    return kinds[rng.choice(4, p=[0.4, 0.3, 0.2, 0.1])], 0
