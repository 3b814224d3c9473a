"""The discrete process over corners: where each action leads, solved by the MDP's own solver.

From corner x an action is held until the trajectory leaves the box it first entered; it takes
tau(x, u) steps to eta(x, u), where the value is interpolated:

    V(x) = max_u [ R(x, u) + discount^tau(x, u) * sum_i p(x_i | x, u) V(x_i) ]

(Munos and Moore 2002, in discrete time). Held for a single step, the trajectory would stay beside
the corner and interpolation would smear the value over the box at every step. Ends are expected,
not drawn: their chance takes weight from the steps after.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.mdp import Model, Solution, solve
from eutree.world_model import WorldModel
from eutree_lab.vrd import _kernels_holding as kernels
from eutree_lab.vrd.kuhn import Grid

Dynamics: TypeAlias = Callable[[Floats, Integers], tuple[Floats, Floats, Floats]]
"""From states [N, d] and actions [N] to next states, rewards [N] and chances to go on [N]."""

SMALLEST_WEIGHT = 1e-12


class CornerWorld(Protocol):
    """The world that a process is made of.

    Attributes:
        n_actions: Number of actions A.
        discount: Weight of the next step's value.
        n_steps_taken: Steps taken in it so far.
    """

    @property
    def n_actions(self) -> int:
        """Number of actions A."""
        ...

    @property
    def n_steps_taken(self) -> int:
        """Steps taken in it so far."""
        ...

    @property
    def discount(self) -> float:
        """Weight of the next step's value."""
        ...

    def hold(
        self, grid: Grid, places: Floats, actions: Integers
    ) -> tuple[Floats, Floats, Floats, Integers]:
        """Hold actions [N] at places [N, d] until the boxes that were first entered are left.

        Returns where that ended [N, d], discounted rewards [N], discount^tau times the chance to
        go on [N], and the box it ended in [N].
        """
        ...


@dataclass(frozen=True)
class KnownWorld:
    """A world with known dynamics.

    Attributes:
        dynamics: Where actions lead, without noise.
        n_actions: Number of actions A.
        discount: Weight of the next step's value.
        longest: Steps that an action is held at most.
    """

    dynamics: Dynamics
    n_actions: int
    discount: float
    longest: int = 50
    _taken: list[int] = field(default_factory=lambda: [0], init=False, repr=False, compare=False)

    @property
    def n_steps_taken(self) -> int:
        """Steps taken in it so far."""
        return self._taken[0]

    def hold(
        self, grid: Grid, places: Floats, actions: Integers
    ) -> tuple[Floats, Floats, Floats, Integers]:
        """Hold actions step by step, all of them together."""
        n, (low, high) = len(places), grid.box
        state, discount, reward = places.copy(), np.ones(n), np.zeros(n)
        entered, leaf = np.full(n, -1, dtype=np.int64), np.zeros(n, dtype=np.int64)
        going = np.arange(n)  # those that are still in the box they first entered
        for _ in range(self.longest):
            self._taken[0] += going.size
            after, earned, goes_on = self.dynamics(state[going], actions[going])
            reward[going] += discount[going] * earned
            discount[going] *= self.discount * goes_on
            state[going] = np.clip(after, low, high)
            leaf[going] = grid.tree.leaf_index(state[going])
            fresh = entered[going] < 0
            entered[going[fresh]] = leaf[going[fresh]]
            going = going[(leaf[going] == entered[going]) & (discount[going] > SMALLEST_WEIGHT)]
            if not going.size:
                break
        return state, reward, discount, leaf


@dataclass(frozen=True, eq=False)
class ModelledWorld:
    """A world as a learned model expects it to be.

    Attributes:
        model: The world model, fitted without memory.
        n_actions: Number of actions A.
        discount: Weight of the next step's value.
        longest: Steps that an action is held at most.
    """

    model: WorldModel
    n_actions: int
    discount: float
    longest: int = 50

    @property
    def n_steps_taken(self) -> int:
        """Steps taken in it so far."""
        return self.model.n_steps_taken

    def hold(
        self, grid: Grid, places: Floats, actions: Integers
    ) -> tuple[Floats, Floats, Floats, Integers]:
        """Hold actions as the model expects."""
        ends, n = np.array(places, order="C"), len(places)
        held = kernels.Held(actions, ends, np.empty(n), np.empty(n), np.empty(n, dtype=np.int64))
        world, nodes = self.model.world, grid.tree.nodes
        kernels.hold(world, nodes, *grid.box, self.discount, self.longest, held)
        return ends, held.rewards, held.weights, held.entered


@dataclass(frozen=True, eq=False)
class CornerRows:
    """Outcomes of each action at N points, held until its box is left.

    Attributes:
        successor: Corners that the value behind it is interpolated from.
        weight: Kuhn weight of each of these corners.
        discount: discount^tau times the chance to go on all the way.
        reward: Discounted sum of the rewards on the way.
        leaf: The box that the trajectory ended in.
    """

    successor: Integers  # [N, A, d + 1]
    weight: Floats  # [N, A, d + 1]
    discount: Floats  # [N, A]
    reward: Floats  # [N, A]
    leaf: Integers  # [N, A]

    def action_values(self, values: Floats) -> Floats:
        """Return Q at each point, [N, A], from the values at the corners [C]."""
        behind = (self.weight * values[self.successor]).sum(axis=2)
        q: Floats = self.reward + self.discount * behind
        return q

    def chosen(self, policy: Integers) -> tuple[Integers, Floats, Floats, Floats]:
        """Return successor, weight [N, d + 1], discount and reward [N] of one action each."""
        at = np.arange(len(policy)), policy
        return self.successor[at], self.weight[at], self.discount[at], self.reward[at]


def rows(grid: Grid, world: CornerWorld, points: Floats) -> CornerRows:
    """Return the outcomes of every action at points, shape [N, d]."""
    n, n_actions = points.shape[0], world.n_actions
    places = np.repeat(points, n_actions, axis=0)  # [N A, d]
    actions = np.tile(np.arange(n_actions), n)
    state, reward, discount, leaf = world.hold(grid, places, actions)
    successor, weight = grid.weights(state)
    shape = (n, n_actions)
    return CornerRows(
        successor.reshape(*shape, -1), weight.reshape(*shape, -1), discount.reshape(shape),
        reward.reshape(shape), leaf.reshape(shape),
    )  # fmt: skip


def model(process: CornerRows, discount: float) -> Model:
    """Return a process over its own points, the corners, as the solver takes it.

    The solver has one discount; a pair's own, g <= discount, becomes probabilities p g / discount
    and a termination of 1 - g / discount.
    """
    n, n_actions, width = process.successor.shape
    pair = np.repeat(np.arange(n * n_actions), width)
    share = process.discount / discount  # [C, A]
    flat, weight = process.successor.ravel(), process.weight.ravel()
    kept = np.flatnonzero(weight > SMALLEST_WEIGHT)
    kept = kept[np.lexsort((flat[kept], pair[kept]))]
    pair, flat, weight = pair[kept], flat[kept], weight[kept]
    sums = np.bincount(pair, weights=weight, minlength=n * n_actions)
    probability = weight / sums[pair] * share.ravel()[pair]
    positive = probability > 0.0
    counts = np.bincount(pair[positive], minlength=n * n_actions)
    return Model(
        indptr=np.concatenate([[0], np.cumsum(counts)]),
        successor=flat[positive].astype(np.int32),
        probability=probability[positive],
        termination=np.where(share > 0.0, 1.0 - share, 1.0),
        reward=process.reward,
        visits=np.ones((n, n_actions), dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class Solved:
    """A grid whose process is solved.

    Attributes:
        grid: Boxes and their corners.
        process: Outcomes of each action at the corners.
        values: V of each corner.
        policy: Best action of each corner.
        converged: Whether the solver vouches for the values.
    """

    grid: Grid
    process: CornerRows
    values: Floats  # [C]
    policy: Integers  # [C]
    converged: bool

    @classmethod
    def of(cls, grid: Grid, world: CornerWorld, values: Floats, policy: Integers) -> "Solved":
        """Return a grid with values found before."""
        return cls(grid, rows(grid, world, grid.corners), values, policy, True)

    def actions(self, world: CornerWorld, points: ArrayLike) -> Integers:
        """Return the best action at points by one look ahead, shape [N]; the first on ties."""
        places = np.ascontiguousarray(points, dtype=np.float64)
        best: Integers = rows(self.grid, world, places).action_values(self.values).argmax(axis=1)
        return best


def solved(
    grid: Grid,
    world: CornerWorld,
    *,
    before: Solved | None = None,
    initial_policy: Integers | None = None,
    tolerance: float = 1e-6,
) -> Solved:
    """Return a grid with its process solved.

    Args:
        grid: Boxes and their corners.
        world: Where actions lead.
        before: A coarser grid, solved: where values begin.
        initial_policy: Action of each corner kept on ties, shape [C].
        tolerance: Error that may remain in a value.
    """
    process = rows(grid, world, grid.corners)
    start = None if before is None else before.grid.interpolate(before.values, grid.corners)
    found: Solution = solve(
        model(process, world.discount), world.discount, tolerance=tolerance,
        initial_values=start, initial_policy=initial_policy,
    )  # fmt: skip
    return Solved(grid, process, found.values, found.policy, found.converged)
