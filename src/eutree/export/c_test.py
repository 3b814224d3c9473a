"""A C program that proves on the target that the compiled tree decides like the policy."""

import math

import numpy as np

from eutree.arrays import Floats
from eutree.export._c_numbers import (
    Number,
    Numbers,
    Scale,
    hexadecimal,
    in_integers,
    integer,
    numbers,
)
from eutree.export._code import C_WORDS, check_identifier, filled
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.boxes import node_boxes

EXTREMES = (math.nan, math.inf, -math.inf, -0.0, 0.0, 5e-324, -5e-324, 1.8e308 / 2, -1.8e308 / 2)


def probes(tree: DecisionTree, *, n_random: int = 0, seed: int = 0) -> Floats:
    """Return observations, shape [N, d], that exercise every test of ``tree``.

    For each inner node: a point of its box with the tested feature on the threshold, one ulp to
    either side, and on each extreme (NaN, infinities, signed zeros, subnormals, huge numbers).
    """
    rng = np.random.default_rng(seed)
    low, high = node_boxes(tree)
    rows = [np.full(tree.n_features, value) for value in EXTREMES]
    for node in np.flatnonzero(tree.feature != tree.NO_FEATURE):
        threshold = float(tree.threshold[node])
        inside = _inside(low[node], high[node])
        beside = [math.nextafter(threshold, side) for side in (-math.inf, math.inf)]
        for value in (threshold, *beside, *EXTREMES):
            rows.append(inside.copy())
            rows[-1][tree.feature[node]] = value
    finite = tree.threshold[np.isfinite(tree.threshold)]
    spread = (finite.min() - 1.0, finite.max() + 1.0) if finite.size else (-1.0, 1.0)
    middle, half = spread[0] / 2 + spread[1] / 2, spread[1] / 2 - spread[0] / 2
    random = middle + half * rng.uniform(-1.0, 1.0, size=(n_random, tree.n_features))
    return np.concatenate([np.array(rows), random])


def _inside(low: Floats, high: Floats) -> Floats:
    """Return a point of a box, which may be unbounded."""
    with np.errstate(over="ignore"):
        below = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0, -1.0))
        above = np.where(np.isfinite(high), high, below + 2.0)
        middle = below / 2 + above / 2
    return np.where((middle > below) & (middle <= above), middle, above)


_INT32 = np.iinfo(np.int32)


def to_c_test(
    policy: TreePolicy,
    *,
    name: str = "decide",
    number: Number = "double",
    scale: Scale = None,
    n_random: int = 100,
    seed: int = 0,
) -> str:
    """Return a ``main`` that runs the exported function on the policy's own decisions.

    It includes ``NAME.h``, so compile it with the source and the header. It prints how many
    decisions agree and returns 0 if all of them do.

    Args:
        policy: The policy.
        name: Name of the entry point, as given to ``to_c``.
        number: Type of the observation's entries, as given to ``to_c``.
        scale: Scale of each feature, as given to ``to_c``.
        n_random: Number of random observations besides those on and around the thresholds.
        seed: Seed of the random observations.
    """
    check_identifier("name", name, reserved=C_WORDS)
    kind = numbers(policy, number, scale)
    stored = stored_probes(policy, kind, n_random=n_random, seed=seed)
    actions = _decided(policy, [meant(kind, row) for row in stored])
    rows = [f"    {{{', '.join(_constant(kind, value) for value in row)}}}" for row in stored]
    size, width = stored.shape
    lines = filled(
        "c_test",
        name=name,
        type=kind.c_type,
        size=size,
        width=width,
        rows=",\n".join(rows),
        actions=_wrapped([str(action) for action in actions]),
    )
    return "\n".join(lines) + "\n"


def _decided(policy: TreePolicy, rows: list[list[float]]) -> list[int]:
    """Return the actions at the steps of one episode."""
    state, actions = None, []
    for row in rows:
        if policy.schema.derived:
            action, state = policy.predict(row, state)
            actions.append(int(action))
        else:
            actions.append(policy.act(row))
    return actions


def stored_probes(policy: TreePolicy, kind: Numbers, *, n_random: int = 0, seed: int = 0) -> Floats:
    """Return observations as the number type stores them, on and around each threshold."""
    exact = probes(policy.tree, n_random=n_random, seed=seed)
    if policy.schema.derived:
        exact = exact[:, : policy.derivation.n_measured]
    if kind.number == "double":
        return exact
    if kind.number == "float":
        with np.errstate(over="ignore"):
            near = exact.astype(np.float32)
        ulps = [np.nextafter(near, np.float32(side)) for side in (-np.inf, np.inf)]
        return np.unique(np.concatenate([near, *ulps]), axis=0).astype(np.float64)
    if policy.schema.derived:
        with np.errstate(over="ignore"):
            exact = exact * np.array(kind.scales)
    else:
        exact = probes(in_integers(policy, kind.scales).tree, n_random=n_random, seed=seed)
    whole = np.nan_to_num(np.rint(exact), nan=0.0, posinf=_INT32.max, neginf=_INT32.min)
    sides = np.concatenate([whole - 1.0, whole, whole + 1.0]).clip(_INT32.min, _INT32.max)
    return np.unique(sides + 0.0, axis=0)


def meant(kind: Numbers, stored: Floats) -> list[float]:
    """Return the observation that stored numbers stand for."""
    return [kind.value(float(value), feature) for feature, value in enumerate(stored)]


def _constant(kind: Numbers, value: float) -> str:
    """Return one entry of an observation as a constant of C."""
    if kind.number == "int32":
        return integer(int(value))
    if math.isnan(value):
        return f"({kind.c_type})NAN"
    if math.isinf(value):
        return f"({kind.c_type}){'-' if value < 0 else ''}INFINITY"
    return hexadecimal(value) + ("F" if kind.number == "float" else "")


def _wrapped(items: list[str], *, per_line: int = 24) -> str:
    """Return the items separated by commas, a fixed number a line."""
    lines = [items[start : start + per_line] for start in range(0, len(items), per_line)]
    return ",\n".join(f"    {', '.join(line)}" for line in lines)
