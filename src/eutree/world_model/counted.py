"""A world model that counts: for observations that are one of a few codes.

Squares of a board, cards in a hand: neighbouring codes need not have anything in common, and where
a step leads is a lottery among a few places whose mean is none of them. So a tree of the *outcome*
takes the place of trees of means: displacement, reward and kind of end together are one class, and
a leaf draws one of the outcomes that were stored in it, whole. The tree is the shortest description
of the classes that is found: cells whose outcomes are alike are counted together, others apart.

An observation has two more numbers behind it that no policy sees, the reward of the step and how it
ended: so the same kernels run this world. Both are forgotten at the next step.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.features import threshold_between
from eutree.world_model._kernels_regression import ModelTree
from eutree.world_model.dynamics import SURE, WorldModel, unrolled, without_residuals
from eutree.world_model.transitions import MOST_CELLS, Transitions

PRICE = 2.0  # of a class of a leaf, and of a test: Akaike's of a number
MOST_NODES = 8 * MOST_CELLS
N_HIDDEN = 2  # reward and end, behind the observation
MOST_REWARDS = 16  # that are told apart as classes
MOST_COUNTS = 2**19  # numbers of the table of cells and classes


class CountedSteps(NamedTuple):
    """Transitions, and after them a row for each action that some observation forbids."""

    observations: Floats  # [N, d]
    actions: Integers  # [N]
    rewards: Floats  # [N]
    next_observations: Floats  # [N, d]
    terminated: Booleans  # [N]
    outcome: Floats  # [N] that of ``Transitions``

    @classmethod
    def of(cls, data: Transitions) -> "CountedSteps":
        """Return the steps of transitions; what is forbidden does nothing, at the least reward.

        It was never tried, and must look neither like what it does elsewhere nor worth a trial.
        """
        known = cls(
            data.observations, data.actions, data.rewards, data.next_observations, data.terminated,
            data.outcome,
        )  # fmt: skip
        if data.allowed is None or data.allowed.all():
            return known
        at, action = np.nonzero(~data.allowed)
        pairs = np.unique(np.column_stack([data.observations[at], action]), axis=0)
        places, n = np.ascontiguousarray(pairs[:, :-1]), len(pairs)
        least, none = np.full(n, data.rewards.min()), np.zeros(n)
        idle = cls(places, pairs[:, -1].astype(np.int64), least, places, none.astype(bool), none)
        return cls._make(map(np.concatenate, zip(known, idle, strict=True)))


def fit_counted_world(data: Transitions) -> WorldModel:
    """Fit a world model that counts; there is nothing between its cells to be pessimistic about."""
    n_actions, d = data.n_actions, data.observations.shape[1]
    width = d + N_HIDDEN
    reward = np.zeros(2 * width + n_actions + 1)
    reward[d] = 1.0
    paid = _tree(np.array([[-1.0, 0.0, 0.0, 0.0]]), reward[np.newaxis])
    ends = [_end(width, n_actions, sign) for sign in (1.0, -1.0)]
    trees = (*_outcomes(CountedSteps.of(data), n_actions), paid, paid, paid, *ends)
    world = unrolled(trees, data.derivation, n_actions)._replace(apart=0)
    starts = data.observations[data.first]
    return WorldModel(trees, world, starts, data.horizon(), n_actions, N_HIDDEN).begun_at(starts)


def _tree(tests: Floats, coefficients: Floats) -> ModelTree:
    """Return a tree without noise of tests (feature, threshold, left, right), [M, 4]."""
    feature, left, right = (tests[:, i].astype(np.int64) for i in (0, 2, 3))
    return without_residuals(feature, tests[:, 1].copy(), left, right, coefficients)


def _end(width: int, n_actions: int, sign: float) -> ModelTree:
    """Return the log-odds of a bad end (``sign`` 1) or a good one (-1): whether it was drawn."""
    lines = np.zeros((3, 2 * width + n_actions + 1))
    lines[1:, -1] = -sign * SURE, sign * SURE
    return _tree(np.array([[width - 1, 0.5 * sign, 1, 2], [-1, 0, 0, 0], [-1, 0, 0, 0]]), lines)


def _outcomes(steps: CountedSteps, n_actions: int) -> list[ModelTree]:
    """Return a tree for each number of an outcome: the same tests, and residuals row by row."""
    drawn = np.column_stack([
        steps.next_observations - steps.observations, steps.rewards, steps.outcome,
    ])  # fmt: skip
    d, width = steps.observations.shape[1], drawn.shape[1]
    keys = np.column_stack([steps.observations, np.eye(n_actions)[steps.actions]])
    cells, owner = np.unique(keys, axis=0, return_inverse=True)
    kind = _kinds(drawn, MOST_COUNTS // len(cells))
    counts = np.zeros((len(cells), kind.max() + 1))
    np.add.at(counts, (owner.ravel(), kind), 1.0)
    tests, leaf = shortest_tree(cells, counts)
    # Behind an observation stand the numbers hidden, then the displacement, then the actions.
    tests[tests[:, 0] >= d, 0] += 2 * width - d
    by_leaf = leaf[owner.ravel()]  # [N]
    order = np.argsort(by_leaf, kind="stable")
    nodes = np.arange(len(tests))
    first = np.searchsorted(by_leaf[order], nodes)
    n_rows = np.searchsorted(by_leaf[order], nodes, side="right") - first
    trees = []
    for i in range(width):
        lines = np.zeros((len(tests), 2 * width + n_actions + 1))
        if i >= d:
            lines[:, i] = -1.0  # what was hidden before is forgotten
        residuals = np.ascontiguousarray(drawn[order, i])
        trees.append(_tree(tests, lines)._replace(first=first, n_rows=n_rows, residuals=residuals))
    return trees


def _kinds(drawn: Floats, most: int) -> Integers:
    """Return the class of each outcome [N, d + 2], at most so many: beyond, the rarest are one.

    Many different rewards are classes by their quantiles; what is drawn is each as it was.
    """
    alike = drawn.copy()
    rewards = alike[:, -N_HIDDEN]
    if len(np.unique(rewards)) > MOST_REWARDS:
        edges = np.quantile(rewards, np.arange(1, MOST_REWARDS) / MOST_REWARDS)
        alike[:, -N_HIDDEN] = np.searchsorted(edges, rewards)
    _, kind, n = np.unique(alike, axis=0, return_inverse=True, return_counts=True)
    kind = kind.ravel()
    if n.size <= most:
        return kind
    rank = np.empty(n.size, dtype=np.int64)
    rank[np.argsort(-n, kind="stable")] = np.arange(n.size)
    return np.minimum(rank[kind], most - 1)


class _Node:
    """Some cells, what they cost together, and the test that parts them if that costs less."""

    def __init__(self, cells: Integers, counts: Floats) -> None:
        self.cells = cells
        self.test: tuple[int, float, int, int] | None = None
        total = counts[cells].sum(axis=0)
        self.n_kinds = int(np.count_nonzero(total))
        self.cost = float(deviance(total)) + PRICE * self.n_kinds


def shortest_tree(cells: Floats, counts: Floats) -> tuple[Floats, Integers]:
    """Return the tree of the shortest description found of the classes of cells.

    A leaf costs its deviance and a price for each class in it, a test a price.

    Args:
        cells: What tests look at, shape [C, p]; no two cells are alike.
        counts: How often each class was seen in each cell, shape [C, K].

    Returns:
        Feature, threshold, left and right node of each node, shape [M, 4], -1 at a leaf; and the
        leaf of each cell, shape [C].
    """
    nodes = [_Node(np.arange(len(cells)), counts)]
    for node in nodes:  # which grow
        if node.n_kinds == 1 or len(nodes) >= MOST_NODES:
            continue
        if (cut := _purest_cut(cells[node.cells], counts[node.cells])) is not None:
            below = cells[node.cells, cut[0]] <= cut[1]
            node.test = *cut, len(nodes), len(nodes) + 1
            nodes += [_Node(node.cells[side], counts) for side in (below, ~below)]
    for node in reversed(nodes):  # a test stays where its sides are shorter than the node itself
        if node.test is not None:
            apart = sum(nodes[side].cost for side in node.test[2:]) + PRICE
            if apart >= node.cost:
                node.test = None
            node.cost = min(apart, node.cost)
    return _numbered(nodes, len(cells))


def _numbered(nodes: Sequence[_Node], n_cells: int) -> tuple[Floats, Integers]:
    """Return the tests of the nodes that are left, parents first, and the leaf of each cell."""
    kept, leaf = [nodes[0]], np.zeros(n_cells, dtype=np.int64)
    tests = []
    for number, node in enumerate(kept):  # which grow
        if node.test is None:
            tests.append((-1.0, 0.0, 0.0, 0.0))
            leaf[node.cells] = number
            continue
        tests.append((*node.test[:2], len(kept), len(kept) + 1))
        kept += [nodes[side] for side in node.test[2:]]
    return np.array(tests, dtype=np.float64), leaf


def _purest_cut(cells: Floats, counts: Floats) -> tuple[int, float] | None:
    """Return the test (feature, threshold) by which the deviance falls most; None if by none."""
    total = counts.sum(axis=0)
    least, found = float(deviance(total)) * (1.0 - 1e-9), None
    for feature in range(cells.shape[1]):
        order = np.argsort(cells[:, feature], kind="stable")
        values = cells[order, feature]
        ends = np.flatnonzero(values[1:] > values[:-1])
        if not ends.size:
            continue
        below = np.cumsum(counts[order], axis=0)[ends]
        apart = deviance(below) + deviance(total - below)
        at = int(apart.argmin())
        if apart[at] < least:
            least = float(apart[at])
            found = feature, threshold_between(*values[ends[at] : ends[at] + 2].tolist())
    return found


def deviance(counts: Floats) -> Floats:
    """Return -2 log of the likelihood of counts under their own shares, of [..., K]."""
    logs = [part * np.log(np.maximum(part, 1.0)) for part in (counts.sum(axis=-1), counts)]
    result: Floats = 2.0 * (logs[0] - logs[1].sum(axis=-1))
    return result
