"""Compiled formulas of derived features: imagined steps compute them, as steps of a task do."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled, inlined
from eutree.features import Derivation
from eutree.formulas import LARGEST_RATIO, Formula

# Kinds of formulas; the place of each is its number.
KINDS = (
    "number", "feature", "last", "negative", "abs", "+", "-", "*", "/", "min", "max",
    "<", "<=", ">", ">=", "and", "or", "if",
)  # fmt: skip
(
    NUMBER, FEATURE, LAST, NEGATIVE, ABS, PLUS, MINUS, TIMES, RATIO, MIN, MAX,
    BELOW, AT_MOST, ABOVE, AT_LEAST, AND, OR, IF,
) = range(len(KINDS))  # fmt: skip

BEYOND = 2**31  # more than there are features


class Formulas(NamedTuple):
    """Formulas and their parts, one *row* each, parts before what they are parts of."""

    kinds: Integers  # [n] place in ``KINDS``
    parts: Integers  # [n, 3] rows; of a feature or a last value, which feature
    values: Floats  # [n] numbers; of all other rows, room for their values
    features: Integers  # [n] the feature that a row is the whole formula of; -1 for parts
    first: int  # the first derived feature; beyond all features where there is none


def formulas_of(derivation: Derivation) -> Formulas:
    """Return the formulas of a derivation."""
    rows = list[tuple[int, list[int], float, int]]()

    def add(formula: Formula, feature: int) -> int:
        parts = [add(part, -1) for part in formula.parts] or [formula.index]
        parts += [0] * (3 - len(parts))
        rows.append((KINDS.index(formula.kind), parts, formula.value, feature))
        return len(rows) - 1

    for feature, formula in enumerate(derivation.formulas, derivation.n_measured):
        add(formula, feature)
    kinds, parts, values, features = zip(*rows, strict=True) if rows else ((), (), (), ())
    return Formulas(
        np.array(kinds, dtype=np.int64),
        np.array(parts, dtype=np.int64).reshape(-1, 3),
        np.array(values, dtype=np.float64),
        np.array(features, dtype=np.int64),
        derivation.n_measured if rows else BEYOND,
    )


@inlined
def derive(formulas: Formulas, state: Floats) -> None:
    """Write the derived features of a state [2 d], which has the one before behind it."""
    values, d = formulas.values, state.size // 2
    for k in range(formulas.kinds.size):
        kind, part = formulas.kinds[k], formulas.parts[k]
        if kind == FEATURE:
            values[k] = state[part[0]]
        elif kind == LAST:
            values[k] = state[d + part[0]]
        elif kind != NUMBER:
            values[k] = operation(kind, values[part[0]], values[part[1]], values[part[2]])
        if formulas.features[k] >= 0:
            state[formulas.features[k]] = values[k]


@compiled
def operation(kind: int, a: float, b: float, c: float) -> float:
    """Return what ``Formula.compute`` returns for an operation; true is 1, false is 0."""
    if kind == PLUS:
        return a + b
    if kind == MINUS:
        return a - b
    if kind == TIMES:
        return a * b
    if kind == RATIO:
        if b == 0.0:
            return LARGEST_RATIO if a > 0.0 else (-LARGEST_RATIO if a < 0.0 else a)
        return min(max(a / b, -LARGEST_RATIO), LARGEST_RATIO)
    if kind == NEGATIVE:
        return -a
    if kind == ABS:
        return -a if a < 0.0 else a
    if kind == MIN:
        return b if b < a else a
    if kind == MAX:
        return b if b > a else a
    if kind == IF:
        return b if a > 0.0 else c
    if kind == AND:
        return min(a, b)
    if kind == OR:
        return max(a, b)
    if kind == BELOW:
        return 1.0 if a < b else 0.0
    if kind == AT_MOST:
        return 1.0 if a <= b else 0.0
    if kind == ABOVE:
        return 1.0 if a > b else 0.0
    return 1.0 if a >= b else 0.0
