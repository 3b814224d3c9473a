"""One planning problem: a model with its choices made definite, and the arrays to work on.

Shared by the two iterations, discounted and undiscounted; :mod:`eutree.mdp.solver` has the theory.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Int32s, Integers, frozen
from eutree.errors import InvalidArgumentError
from eutree.mdp import _kernels_planning as _kernels
from eutree.validation import check_number

# With T(s, a) the transitions that left leaf s by action a (Eqs. 3 and 4 of the paper):
#
#     Pr(s, a, s') = |{(o, a, r, o') in T(s, a) : L(o') = s'}| / |T(s, a)|          (Eq. 3)
#     R(s, a)      = (sum of r over T(s, a)) / |T(s, a)|, the mean immediate reward  (Eq. 4)
#
# A terminated transition leads to no leaf: what is missing in a row of Pr to 1 is the probability
# that the episode terminates, after which the value is 0. A truncated one is no such transition:
# it leads to the leaf of its last observation.


TERMINAL = -1
"""The next state of a terminated transition."""

NO_ACTION = -1
"""The action of a state in which nothing was tried."""


@dataclass(frozen=True, eq=False)
class Model:
    """Pr and R of an MDP, sparse, with pair p = s A + a.

    Attributes:
        indptr: Where the successors of each pair begin and end in the next two arrays.
        successor: Successors of each pair, ascending; TERMINAL is not among them.
        probability: Pr(s, a, successor) (Eq. 3); positive.
        termination: Probability that the episode terminates.
        reward: R(s, a) (Eq. 4); 0 where the action was never tried.
        visits: How often the action was tried; 0 means that nothing is known of the pair.
    """

    indptr: Integers  # [S A + 1]
    successor: Int32s  # [K]
    probability: Floats  # [K]
    termination: Floats  # [S, A]
    reward: Floats  # [S, A]
    visits: Integers  # [S, A]

    def __post_init__(self) -> None:
        dtypes = {"indptr": np.int64, "successor": np.int32, "visits": np.int64}
        for name in ("indptr", "successor", "probability", "termination", "reward", "visits"):
            array = np.asarray(getattr(self, name), dtype=dtypes.get(name, np.float64))
            object.__setattr__(self, name, frozen(array))
        if self.visits.ndim != 2 or not self.visits.size:
            raise InvalidArgumentError(
                f"visits must have shape (S, A) with S, A >= 1, got {self.visits.shape}"
            )
        if message := _fault(self):
            raise InvalidArgumentError(message)

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return int(self.visits.shape[0])

    @property
    def n_actions(self) -> int:
        """Number of actions A."""
        return int(self.visits.shape[1])

    @property
    def n_triples(self) -> int:
        """Number of distinct triples (s, a, s') with s' not terminal."""
        return int(self.successor.size)

    def dense(self) -> Floats:
        """Return Pr as an array [S, A, S]; its rows sum to 1 minus the termination."""
        shape = (self.n_states, self.n_actions, self.n_states)
        probabilities = np.zeros((shape[0] * shape[1], shape[2]))
        pair = np.repeat(np.arange(len(probabilities)), np.diff(self.indptr))
        probabilities[pair, self.successor] = self.probability
        return probabilities.reshape(shape)


def _fault(model: Model) -> str:
    """Return what is wrong with the arrays of a model; empty if nothing is."""
    shape = model.visits.shape
    if model.reward.shape != shape or model.termination.shape != shape:
        return (
            f"reward and termination must have the shape {shape} of visits, "
            f"got {model.reward.shape} and {model.termination.shape}"
        )
    if model.indptr.shape != (model.visits.size + 1,) or (np.diff(model.indptr) < 0).any():
        return f"indptr must have {model.visits.size + 1} entries that never fall"
    sizes = {model.successor.shape, model.probability.shape}
    if sizes != {(int(model.indptr[-1]),)} or model.indptr[0] != 0:
        return "successor and probability must have as many entries as indptr says"
    if model.successor.size and not (
        0 <= model.successor.min() <= model.successor.max() < model.n_states
    ):
        return f"successor must be in 0..{model.n_states - 1}"
    if not np.isfinite(model.reward).all():
        return "reward must be finite"
    starts = np.concatenate([[0.0], np.cumsum(model.probability)])[model.indptr]
    mass = np.diff(starts).reshape(shape) + model.termination
    wrong = (model.visits > 0) & ~(np.abs(mass - 1.0) <= 1e-6)
    if wrong.any():
        s, a = np.argwhere(wrong)[0]
        return f"probabilities must sum to 1, got {mass[s, a]:g} for state {s}, action {a}"
    return ""


_TIE = 1e-12


@dataclass(frozen=True, eq=False)
class Solution:
    """Values and a greedy policy, with what is known of their error.

    Attributes:
        values: V(s) (Eq. 6).
        action_values: Q(s, a) (Eq. 5); NaN where the action was never tried and left out.
        policy: The best action of each state; NO_ACTION where nothing was tried.
        n_iterations: Improvements of the policy.
        bound: Largest error that ``values`` may have.
        converged: Whether the bound is within the tolerance that was asked for.
        discount: The discount that was used: below 1 though 1 was asked for, if endless
            behaviour would pay.
        trapped: States from which no tried action can reach an end; empty below discount 1.
    """

    values: Floats  # [S]
    action_values: Floats  # [S, A]
    policy: Integers  # [S]
    n_iterations: int
    bound: float
    converged: bool
    discount: float
    trapped: Integers  # [n]

    def __post_init__(self) -> None:
        for name in ("values", "action_values", "policy", "trapped"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(eq=False)
class Problem:
    """A model with its choices made definite, and the arrays that the iteration works on."""

    model: Model
    pairs: _kernels.Pairs
    ends: Booleans  # [S A] pairs after which the process may stop
    untouched: Booleans  # [S] states in which nothing was tried
    policy: Int32s  # [S]
    action_values: Floats  # [S A]
    system: _kernels.System = field(repr=False)

    @classmethod
    def of(cls, model: Model, values: Floats, untried: float | None) -> "Problem":
        """Return the problem of a model; fixed values become pairs that end with that reward."""
        n_states, n_actions = model.visits.shape
        tried = model.visits > 0
        worth = model.reward.copy()
        ends: Booleans = (model.termination > 0.0) | ~tried
        if untried is not None:
            worth[~tried] = check_number("untried", untried)
        usable = tried | (untried is not None)
        untouched = ~tried.any(axis=1) & (untried is None)
        worth[untouched, 0] = values[untouched]
        usable[untouched, 0] = True
        size = model.n_triples
        return cls(
            model,
            _kernels.Pairs(
                model.indptr, model.successor, model.probability, worth.ravel(), usable.ravel()
            ),
            ends.ravel(),
            np.asarray(untouched),
            policy=np.full(n_states, NO_ACTION, np.int32),
            action_values=np.full(n_states * n_actions, np.nan),
            system=_kernels.System(
                starts=np.zeros(n_states + 1, np.int64),
                middles=np.zeros(n_states, np.int64),
                column=np.empty(size, np.int32),
                entry=np.empty(size),
                diagonal=np.empty(n_states),
                work=np.empty((8, n_states)),
            ),
        )

    @property
    def episodic(self) -> bool:
        """Whether the process can stop anywhere."""
        return bool((self.ends & self.pairs.usable).any())

    def keep(self, policy: ArrayLike | None) -> None:
        """Begin with these actions, where they may be chosen."""
        if policy is None:
            return
        actions = np.asarray(policy)
        n_states, n_actions = self.model.visits.shape
        if actions.shape != (n_states,) or not (-1 <= actions.min() <= actions.max() < n_actions):
            raise InvalidArgumentError(
                f"initial_policy must have {n_states} actions in -1..{n_actions - 1}, got "
                f"shape {actions.shape}"
            )
        chosen = np.clip(actions, 0, None).astype(np.int64)
        fine = self.pairs.usable.reshape(n_states, n_actions)[np.arange(n_states), chosen]
        self.policy[:] = np.where(fine & (actions >= 0), actions, NO_ACTION)

    def improve(self, values: Floats, discounts: Floats, backed_up: Floats) -> int:
        """Back up all states; make the policy greedy and return how many actions changed."""
        out = _kernels.Greedy(self.policy, self.action_values, backed_up)
        return _kernels.improve(self.pairs, discounts, _TIE, values, out)

    def iterate_discounted(
        self, values: Floats, backed_up: Floats, discount: float, tolerance: float
    ) -> tuple[int, float, float]:
        """Improve the policy until the values are certain; return rounds, bound and shift."""
        out = _kernels.Greedy(self.policy, self.action_values, backed_up)
        return _kernels.iterate_discounted(
            self.pairs, self.system, discount, _TIE, self.episodic, tolerance, values, out
        )

    def evaluate(self, values: Floats, discounts: Floats, residual: float) -> float:
        """Set the values to those of the policy, up to a residual; return the one reached."""
        self._fill(discounts)
        pairs = np.arange(len(values)) * self.model.n_actions + self.policy
        return self._solve_system(self.pairs.worth[pairs], values, residual)

    def steps(self, discounts: Floats) -> float:
        """Return the largest expected (discounted) number of steps; infinite where it is lost."""
        self._fill(discounts)
        steps = np.ones(len(discounts))
        left = self._solve_system(np.ones(len(discounts)), steps, 1e-3)
        return float(steps.max()) if left <= 0.1 and steps.min() > 0.5 else np.inf

    def n_endless(self) -> int:
        """Return from how many states the policy never reaches an end."""
        n_states, n_actions = self.model.visits.shape
        chosen = np.zeros(n_states * n_actions, dtype=bool)
        chosen[np.arange(n_states) * n_actions + self.policy] = True
        return int((self.ways_out(chosen) == NO_ACTION).sum())

    def ways_out(self, usable: Booleans) -> Int32s:
        """Return an action of each state that leads towards an end; NO_ACTION where none does."""
        out = np.empty(self.model.n_states, np.int32)
        model = self.model
        _kernels.find_ways_out(model.indptr, model.successor, self.ends, usable, out)
        return out

    def solution(
        self, values: Floats, shift: float, *, rounds: int, bound: float, tolerance: float,
        discount: float, trapped: Integers,
    ) -> Solution:  # fmt: skip
        """Return the answer; ``shift`` is added to every Q but the fixed ones."""
        shape = self.model.visits.shape
        shown = self.action_values.reshape(shape).copy()
        shown[self.model.visits > 0] += shift
        shown[self.untouched] = np.nan
        final = values.copy()
        touched = ~self.untouched
        final[touched] = np.fmax.reduce(shown[touched], axis=1)
        policy = np.where(self.untouched, NO_ACTION, self.policy).astype(np.int64)
        return Solution(final, shown, policy, rounds, bound, bound <= tolerance, discount, trapped)

    def _fill(self, discounts: Floats) -> None:
        _kernels.fill_system(self.pairs, discounts, self.policy, self.system)

    def _solve_system(self, right: Floats, values: Floats, residual: float) -> float:
        scaled = right / self.system.diagonal
        return _kernels.evaluate(self.system, scaled, values, residual, _kernels.KRYLOV_LIMIT)
