"""A world model from stored transitions: where a step leads, its reward, whether it ends.

Where: for each feature a model tree (axis-parallel tests, linear leaves; Quinlan's M5) of the
displacement o' - o, given o, the displacement before it and the action. A displacement tells of a
state that one observation hides, such as a direction of movement. A leaf's residuals are its noise.
Whether: for bad and for good ends a logistic model tree over o' (``termination``). Rewards: trees
over o', o' - o and the action, one each for the reward of steps that go on, end badly, end well.
Where a step is taken may tell its reward, or whether it ends, much better than where it leads: then
that tree is over o, the displacement before it and the action, and its word is a number *hidden*
behind o', which the tree over o' repeats: the loops that run a world know of no other kind.

The region between the safe and the fatal transitions seen so far is unknown. ``gap`` is the share
of that gap that counts as fatal: 0.5 is the usual middle, more is pessimistic, less optimistic.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.features import Derivation, threshold_between
from eutree.world_model import _kernels_chances
from eutree.world_model import _kernels_regression as kernels
from eutree.world_model._kernels import NodeTests, World
from eutree.world_model._kernels_formulas import formulas_of
from eutree.world_model._kernels_regression import ModelTree as ModelTree
from eutree.world_model.transitions import Transitions

# An end is seldom seen, and where it lies is usually a simple set: beyond a threshold, within a
# distance. Each leaf's log-odds of an end are a constant, linear, or linear in o' and its squares
# (a ball, an ellipse, a slab), whichever is the shortest description: deviance plus a price for
# each parameter and each test. A dozen ends describe a ball that axis-parallel tests would have
# to pave.


PRICE = 4.0  # of a parameter or a test, in units of deviance
SURE = 14.0  # log-odds of a leaf all of whose rows agree
FEW = 3  # rows of either kind below which no boundary is fitted
MANY_ENDS = 10  # of a leaf without a boundary, that tell how likely one is
SLACK = 1e-6  # more than rounding does to a sum of costs
MOST_TESTS = 40
MOST_ROWS = 8000
CLEARLY = 10 * PRICE  # shorter is a description by where a step is taken, if it is preferred


@dataclass(eq=False)
class _Leaf:
    """The best single description of some rows, or two of a test's sides if they are shorter."""

    rows: Integers  # [n] of the data
    cost: float
    line: Floats  # [2 d + 1]
    test: tuple[int, float, int, int] | None = None  # feature, threshold, and the sides' numbers


@dataclass(frozen=True, eq=False)
class TerminationTree:
    """A logistic model tree; feature -1 marks a leaf, node 0 is the root, parents come first."""

    feature: Integers  # [M]
    threshold: Floats  # [M]
    left: Integers  # [M]
    right: Integers  # [M]
    lines: Floats  # [M, 2 d + 1]
    rows: tuple[Integers, ...]  # of the data, for each node
    cost: float  # of the description

    def seen(self, X: Floats, outcome: Floats, gap: float, sign: float) -> "TerminationTree":
        """Return the tree in which the share ``gap`` of the unknown counts as the worse.

        Thresholds move inside their gaps, and the log-odds by those of ``gap``: a place counts as
        an end where the fitted chance exceeds 1 - gap (``sign`` -1, for good ends: where it
        exceeds gap). Those of a share that many rows tell stay: they come by chance, and nothing
        is unknown. ``X`` [N, d] are o' of the rows, ``outcome`` [N] their kinds of end.
        """
        threshold, lines = self.threshold.copy(), self.lines.copy()
        for node, rows in enumerate(self.rows):
            if self.feature[node] >= 0:
                x, kinds = X[rows, self.feature[node]], outcome[rows]
                threshold[node] = moved_to_better(x, kinds, float(threshold[node]), gap)
            n_ends = np.count_nonzero(sign * outcome[rows] > 0)
            if lines[node, :-1].any() or min(n_ends, rows.size - n_ends) < MANY_ENDS:
                lines[node, -1] += sign * np.log(gap / (1.0 - gap))
        return replace(self, threshold=threshold, lines=lines)


def moved_to_better(x: Floats, outcome: Floats, threshold: float, share: float) -> float:
    """Return the threshold moved inside its gap: ``share`` of the gap goes to the worse side."""
    left = x <= threshold
    if left.all() or not left.any():
        return threshold
    # The values next to the threshold: any cut between them parts the rows alike.
    low, high = float(x[left].max()), float(np.fmin.reduce(x[~left], initial=np.inf))
    below, above = outcome[left].mean(), outcome[~left].mean()
    part = share if below > above else (1.0 - share if below < above else 0.5)
    moved = low + part * (high - low)
    # Rounding must not put the threshold on the value above it.
    return moved if moved < high else low


def fit_termination(X: Floats, y: Booleans, *, boundaries: bool = True) -> TerminationTree:
    """Grow the tree of the shortest description found of which o' [N, d] are ends.

    Without ``boundaries`` all its leaves are constants.
    """
    kept = _thinned(y)
    correction = np.log((~y[kept]).sum() / (~y).sum()) if (~y).any() else 0.0
    limit = () if boundaries else (0.0,)  # no boundary costs less
    nodes = [_described(X, y, kept, *limit)]
    for node in nodes:  # which grow
        if node.cost <= 3 * PRICE or len(nodes) >= 2 * MOST_TESTS:
            continue
        if (found := _best_test(X, y, node, *limit)) is not None:
            node.test = *found[:2], len(nodes), len(nodes) + 1
            nodes += found[2:]
    for node in reversed(nodes):  # a test stays where its sides are shorter than the node itself
        if node.test is not None:
            below = sum(nodes[side].cost for side in node.test[2:]) + PRICE
            if below < node.cost:
                node.cost = below
            else:
                node.test = None
    columns = zip(*(node.test or (-1, 0.0, 0, 0) for node in nodes), strict=True)
    feature, threshold, left, right = (np.array(column) for column in columns)
    lines = np.array([node.line for node in nodes])
    lines[:, -1] += float(correction)
    rows = tuple(node.rows for node in nodes)
    return TerminationTree(feature, threshold, left, right, lines, rows, nodes[0].cost)


def _thinned(y: Booleans) -> Integers:
    """Return all rows, or if they are too many all ends and some others, evenly spaced."""
    if y.size <= MOST_ROWS:
        return np.arange(y.size)
    others = np.flatnonzero(~y)
    n = max(MOST_ROWS - int(y.sum()), MOST_ROWS // 2)
    some = others[np.linspace(0, others.size - 1, min(n, others.size)).astype(np.int64)]
    return np.sort(np.concatenate([np.flatnonzero(y)[-MOST_ROWS:], some]))


def _described(X: Floats, y: Booleans, rows: Integers, limit: float = np.inf) -> _Leaf:
    """Return the best description of some rows without a test.

    Above ``limit`` it need not be the best: a boundary whose price alone is above it is not fitted.
    """
    d = X.shape[1]
    mine = y[rows]
    n, n_ends = rows.size, int(mine.sum())
    line = np.zeros(2 * d + 1)
    if n_ends in (0, n):
        line[-1] = SURE if n_ends else -SURE
        return _Leaf(rows, PRICE, line)
    share = n_ends / n
    line[-1] = np.log(share / (1 - share))
    cost = PRICE - 2.0 * (n_ends * np.log(share) + (n - n_ends) * np.log(1 - share))
    if min(n_ends, n - n_ends) >= FEW:
        places = np.ascontiguousarray(X[rows])
        for squares in (False, True):
            price = PRICE * (2 * d + 1 if squares else d + 1)
            if price >= cost or price > limit:
                break
            fit = np.empty(2 * d + 1)
            deviance = _kernels_chances.fit_log_odds(places, mine, squares, fit)
            if deviance + price < cost:
                cost, line = deviance + price, fit
    return _Leaf(rows, float(cost), line)


def _best_test(
    X: Floats, y: Booleans, leaf: _Leaf, limit: float = np.inf
) -> tuple[int, float, _Leaf, _Leaf] | None:
    """Return the test whose two sides have the shortest descriptions, with them."""
    found = None
    least = np.inf
    for feature, threshold in _tests(X, y, leaf.rows):
        below = X[leaf.rows, feature] <= threshold
        if below.all() or not below.any():
            continue
        sides = leaf.rows[below], leaf.rows[~below]
        first = int(sides[1].size < sides[0].size)  # the smaller one is described at less cost
        near = _described(X, y, sides[first], min(limit, least - PRICE + SLACK))
        if near.cost + PRICE >= least:  # no description is shorter than a constant's price
            continue
        far = _described(X, y, sides[1 - first], min(limit, least - near.cost + SLACK))
        if near.cost + far.cost < least:
            least = near.cost + far.cost
            found = (feature, threshold, *((far, near) if first else (near, far)))
    return found


def _tests(X: Floats, y: Booleans, rows: Integers) -> list[tuple[int, float]]:
    """Return tests worth a look: the purest, and for each feature the widest gap among ends."""
    mine = y[rows]
    if mine.all() or not mine.any():
        return []
    tests = []
    most, purest = 0.0, None
    for feature in range(X.shape[1]):
        x = X[rows, feature]
        order = np.argsort(x, kind="stable")
        values, n = x[order], np.arange(1, rows.size)
        surplus = np.cumsum(mine[order] - mine.mean())[:-1]
        gain = np.where(values[1:] > values[:-1], surplus**2 / (n * (rows.size - n)), 0.0)
        at = int(gain.argmax())
        if gain[at] > most * (1.0 + 1e-9):
            most = float(gain[at])
            purest = feature, threshold_between(*values[at : at + 2].tolist())
        ends = values[mine[order]]
        inner = np.diff(ends)[1:-1]
        if inner.size and inner.max() > 0:
            at = int(inner.argmax()) + 1
            tests.append((feature, threshold_between(*ends[at : at + 2].tolist())))
    return tests if purest is None else [purest, *tests]


MAX_LEAVES = 64
SHORT, MANY = 8, 2000  # leaves; rewards, of fewer of which none is told early
MIN_LEAF = 8
GOOD_ENOUGH = 1e-4  # share of the variation that need not be explained
EXACT = 1e-6  # the same of rewards
ROUNDING = 1e-9  # share of the mean square of rewards that is no variation


@dataclass(frozen=True, eq=False)
class WorldModel:
    """A fitted model: its trees, and the observations episodes start from."""

    # Those of each feature's displacement, of the reward of a step that goes on, of one that ends
    # badly, of one that ends well, and of the log-odds of a bad and a good end
    trees: tuple[ModelTree, ...]  # [d + 5]
    world: World  # the same, laid out to be run
    starts: Floats  # [E, d]; first observations of the stored episodes
    horizon: int  # steps after which a rollout is cut
    n_actions: int
    n_hidden: int = 0  # numbers behind each observation that no policy sees

    @property
    def n_features(self) -> int:
        """Number of features d of an observation."""
        return int(self.starts.shape[1]) - self.n_hidden

    @property
    def n_steps_taken(self) -> int:
        """Steps taken so far in it and in its copies ``without_noise``."""
        return int(self.world.tally[0])

    def begun_at(self, observations: Floats) -> "WorldModel":
        """Return the model with episodes that start at observations, shape [E, d]."""
        return replace(self, starts=np.pad(observations, ((0, 0), (0, self.n_hidden))))

    def without_noise(self) -> "WorldModel":
        """Return the model without residuals: displacements and rewards are the expected ones."""
        return replace(self, world=self.world._replace(residuals=0.0 * self.world.residuals))


def fit_world_models(
    data: Transitions, pessimism_levels: Sequence[float], *, max_leaves: int = MAX_LEAVES
) -> tuple[WorldModel, ...]:
    """Fit one world model for each ``gap``; they share all but how they look at ends.

    Args:
        data: Transitions to fit.
        pessimism_levels: Share of the gap between safe and fatal transitions that counts as fatal.
        max_leaves: Most leaves of a tree of displacements.
    """
    rows, actions = _with_forbidden(data)
    outcome, places = data.outcome[rows], data.next_observations[rows]
    displacements, chosen = data.displacements[rows], np.eye(data.n_actions)[actions]  # [N, A]
    before = _design(data.observations[rows], data.previous_displacements[rows], chosen)
    after = _design(places, displacements, chosen)
    everything, d = np.arange(rows.size), data.observations.shape[1]
    moves = [
        _grow(before, displacements[:, i], everything, max_leaves=max_leaves) for i in range(d)
    ]
    bad, good = outcome > 0, outcome < 0
    kinds = ~data.terminated[rows], bad, good
    rewards = [_paid(before, after, data.rewards[rows], _rows(kind)) for kind in kinds]
    ends = [(_ended(before.X, places, kind), sign) for kind, sign in ((bad, 1.0), (good, -1.0))]
    starts = np.ascontiguousarray(data.observations[data.first])
    models = []
    for gap in pessimism_levels:
        chances = []
        for (tree, early), sign in ends:
            # The leaves of an early tree are shares that were counted: nothing is unknown.
            X, shift = (before.X, 0.0) if early else (places, sign)
            chances.append((_as_tree(tree.seen(X, outcome, gap, shift), before.X.shape[1]), early))
        trees = _told(moves, [*rewards, *chances])
        n_hidden = len(trees) - 5 - d
        world = unrolled(trees, data.derivation, data.n_actions)
        model = WorldModel(trees, world, starts, data.horizon(), data.n_actions, n_hidden)
        models.append(model.begun_at(starts))
    return tuple(models)


def _with_forbidden(data: Transitions) -> tuple[Integers, Integers]:
    """Return the transitions, and what did each: its action, or one that was forbidden there.

    What a mask forbids gives way to another action. On the mean it is what was done in its place.
    An action is forbidden in the share of its rows in which it is forbidden in all, or in less,
    where these rows were more than the transitions.
    """
    n = data.actions.size
    if data.allowed is None:
        return np.arange(n), data.actions
    n_forbidden = np.count_nonzero(~data.allowed, axis=0)
    tried = np.bincount(data.actions, minlength=data.n_actions)
    wanted = tried * n_forbidden / np.maximum(n - n_forbidden, 1)
    wanted = np.ceil(wanted * min(1.0, n / max(wanted.sum(), 1.0))).astype(np.int64)
    rows, actions = [np.arange(n)], [data.actions]
    for action in np.flatnonzero(wanted):
        at = np.flatnonzero(~data.allowed[:, action])
        places = np.linspace(0, at.size - 1, min(wanted[action], at.size))
        rows.append(at[places.astype(np.int64)])
        actions.append(np.full(places.size, action))
    return np.concatenate(rows), np.concatenate(actions)


# What a step earns, and whether it ends, is told by the tree over where it leads, or *early*, by
# the one over where it is taken: a wager, a tool that breaks. Where both tell it, the first stays.


def _paid(
    before: kernels.Design, after: kernels.Design, y: Floats, rows: Integers
) -> tuple[ModelTree, bool]:
    """Return the tree of a reward that describes some rows best, and whether it tells it early."""
    late = _grow(after, y, rows, min_leaf=1, floor=EXACT)
    enough = EXACT * rows.size * float(y[rows].var() + ROUNDING * np.square(y[rows]).mean())
    if rows.size < MANY or _is_told(late, enough):
        return late, False
    # Short trees, which cannot learn the rows by heart, are compared.
    short = [_error(_grow(one, y, rows, max_leaves=SHORT, floor=EXACT)) for one in (before, after)]
    there, then = (rows.size * np.log(max(one, enough)) for one in short)
    if there + CLEARLY >= then:
        return late, False
    exact = _grow(before, y, rows, min_leaf=1, floor=EXACT)
    return exact if _is_told(exact, enough) else _grow(before, y, rows, floor=EXACT), True


def _is_told(tree: ModelTree, enough: float) -> bool:
    """Return whether a tree of a few leaves leaves nothing unexplained."""
    return _error(tree) <= enough and len(tree.feature) < 2 * SHORT


def _error(tree: ModelTree) -> float:
    return float(np.square(tree.residuals).sum())


def _ended(X: Floats, places: Floats, y: Booleans) -> tuple[TerminationTree, bool]:
    """Return the tree of ends that is the shorter description, and whether it tells them early."""
    late = fit_termination(places, y)
    if late.cost > CLEARLY:
        early = fit_termination(X, y, boundaries=False)
        if early.cost + CLEARLY < late.cost:
            return early, True
    return late, False


def _told(
    moves: Sequence[ModelTree], outcomes: Sequence[tuple[ModelTree, bool]]
) -> tuple[ModelTree, ...]:
    """Return the trees of a world: what is told early moves a number that is hidden."""
    d, n_hidden = len(moves), sum(early for _, early in outcomes)
    hidden, told = list[ModelTree](), list[ModelTree]()
    for tree, early in outcomes:
        tree = _widened(tree, d, n_hidden)
        if early:
            coefficients = np.zeros((1, tree.coefficients.shape[1]))
            coefficients[0, d + len(hidden)] = 1.0
            hidden.append(_forgetful(tree, d + len(hidden)))
            at = tree.feature < 0
            none = np.zeros(1, dtype=np.int64)
            tree = without_residuals(none - 1, np.zeros(1), none, none, coefficients)._replace(
                low=tree.low[at].min(keepdims=True), high=tree.high[at].max(keepdims=True)
            )
        told.append(tree)
    return (*(_widened(tree, d, n_hidden) for tree in moves), *hidden, *told)


def _widened(tree: ModelTree, d: int, n_hidden: int) -> ModelTree:
    """Return a tree over d features that looks past numbers hidden behind them."""
    if not n_hidden:
        return tree
    columns = np.arange(tree.coefficients.shape[1])
    columns += n_hidden * ((columns >= d).astype(np.int64) + (columns >= 2 * d))
    coefficients = np.zeros((len(tree.feature), columns[-1] + 1))
    coefficients[:, columns] = tree.coefficients
    feature = np.where(tree.feature < 0, -1, columns[tree.feature])
    return tree._replace(feature=feature, coefficients=coefficients)


def _forgetful(tree: ModelTree, column: int) -> ModelTree:
    """Return the tree of the displacement from a hidden number's last value to what a tree says."""
    m = tree.feature.size
    coefficients = tree.coefficients.copy()
    coefficients[:, column] = -1.0
    unbound = without_residuals(*tree[:4], coefficients)
    return unbound._replace(n_rows=np.ones(m, dtype=np.int64), residuals=np.zeros(1))


def fit_model_tree(X: Floats, y: Floats, *, max_leaves: int, min_leaf: int) -> ModelTree:
    """Fit one tree with a line at each leaf to inputs [N, p] and targets [N]."""
    return _grow(_design(X), y, np.arange(y.size), max_leaves=max_leaves, min_leaf=min_leaf)


def _as_tree(ends: TerminationTree, p: int) -> ModelTree:
    """Return a tree of ends in the form of the others, of p inputs; the rest count nothing."""
    m, width = ends.lines.shape
    coefficients = np.zeros((m, p + 1))
    if width <= p:  # no early one has lines
        coefficients[:, : width - 1] = ends.lines[:, :-1]
    coefficients[:, -1] = ends.lines[:, -1]
    return without_residuals(ends.feature, ends.threshold, ends.left, ends.right, coefficients)


def without_residuals(
    feature: Integers, threshold: Floats, left: Integers, right: Integers, coefficients: Floats
) -> ModelTree:
    """Return a tree [M] that is as its lines [M, p + 1] say, without noise and bounds."""
    m = feature.size
    nothing = np.zeros(m, dtype=np.int64)
    return ModelTree(
        feature=feature,
        threshold=threshold,
        left=left,
        right=right,
        coefficients=coefficients,
        low=np.full(m, -np.inf),
        high=np.full(m, np.inf),
        first=nothing,
        n_rows=nothing,
        residuals=np.zeros(0),
    )


def _rows(mask: Booleans) -> Integers:
    """Return the rows of a mask, or the first row if there is none."""
    return np.flatnonzero(mask) if mask.any() else np.zeros(1, dtype=np.int64)


def _design(*columns: Floats) -> kernels.Design:
    """Return the inputs of regression trees, cut into bins."""
    X = np.ascontiguousarray(np.concatenate(columns, axis=1))
    p = X.shape[1]
    edges, n_edges = np.full((p, kernels.N_BINS), np.inf), np.zeros(p, dtype=np.int64)
    bins = np.zeros((p, X.shape[0]), dtype=np.int16)
    by_input = np.ascontiguousarray(X.T)
    kernels.bin_columns(by_input, np.sort(by_input), edges, n_edges, bins)
    return kernels.Design(X, edges, n_edges, bins)


def _grow(
    design: kernels.Design,
    y: Floats,  # [N]
    rows: Integers,  # [n]
    *,
    max_leaves: int = MAX_LEAVES,
    min_leaf: int = MIN_LEAF,
    floor: float = GOOD_ENOUGH,
) -> ModelTree:
    y = np.ascontiguousarray(y)
    rows = rows.copy()
    m, p = 2 * max_leaves - 1, design.X.shape[1]
    feature, left, right, first, n_rows = np.zeros((5, m), dtype=np.int64)
    threshold, low, high = np.zeros((3, m))
    nodes = feature, threshold, left, right, np.zeros((m, p + 1))
    out = ModelTree(*nodes, low, high, first, n_rows, residuals=np.zeros(0))
    n_nodes = kernels.grow(design, y, rows, min_leaf, floor, out)
    tree = ModelTree._make(array[:n_nodes] for array in out)
    residuals, covered = np.zeros(rows.size), np.zeros(rows.size, dtype=np.bool_)
    kernels.write_residuals(design.X, y, rows, tree, covered, residuals)
    return tree._replace(residuals=residuals)


def unrolled(trees: Sequence[ModelTree], derivation: Derivation, n_actions: int) -> World:
    """Return the trees of each action in common arrays: tests of the action are decided."""
    room = n_actions * sum(tree.feature.size for tree in trees)
    p = trees[0].coefficients.shape[1] - 1 - n_actions
    roots = np.zeros((n_actions, len(trees)), dtype=np.uint32)
    levels = np.zeros(len(trees), dtype=np.int64)
    out = kernels.Unrolled(
        tests=NodeTests(np.zeros(room, np.uint32), np.zeros(room), np.zeros(room, np.uint32)),
        rows=np.zeros(room, dtype=np.uint32),
        lines=np.zeros((room, p + 4)),
        noise=np.zeros((room, 3), dtype=np.int64),
    )
    n_nodes, n_lines, n_residuals = 0, 0, 0
    for i, tree in enumerate(trees):
        for action in range(n_actions):
            roots[action, i] = n_nodes
            n_nodes, n_lines, depth = kernels.unroll(
                p, action, n_residuals, n_nodes, n_lines, tree, out
            )
            levels[i] = max(levels[i], depth)
        n_residuals += tree.residuals.size
    residuals = np.concatenate([tree.residuals for tree in trees])
    tests = NodeTests._make(array[:n_nodes] for array in out.tests)
    lines, noise = out.lines[:n_lines], out.noise[:n_lines]
    rest = residuals, formulas_of(derivation), 1, np.zeros(1, dtype=np.int64)
    return World(roots, levels, tests, out.rows[:n_nodes], lines, noise, *rest)
