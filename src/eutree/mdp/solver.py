"""Exact solution of an MDP over leaves, with a certified bound on the remaining error.

The method is policy iteration. The values of a policy solve a sparse linear system, (I - discount
Pr) V = R, which is treated by BiCGSTAB preconditioned with a symmetric Gauss-Seidel sweep, below
discount 1 only to 3 % of the present Bellman residual, and closer where that proves too loose.
Leaves of a continuous space lead to near leaves: a sweep carries a value one step on, a Krylov
method needs only about the square root of the horizon. The old action stays on ties, so that the
policy cannot turn round for ever.

*Discount below 1.* With W = T V (all states backed up at once) and d = W - V,

    V* lies in W + discount / (1 - discount) * [min d, max d]       (MacQueen 1966)

for rows that sum to 1. Where an episode can end, the absorbing state belongs to the process, with
d = 0, so that 0 is counted among d. The midpoint is added, and half the width is the bound.

*Discount 1.* No such interval exists, and a policy that never ends has no value. Hence:

1. A state from which no tried action can reach an end is *trapped*. Its discount is taken as
   1 - 1 / horizon: a floor (a loop that costs 2 a step is worth -2 * horizon), finite and graded.
2. The other states start from a policy that ends with probability 1 from everywhere. As long as
   endless behaviour costs something, improving such a policy keeps it so.
3. If endless behaviour pays (a positive cycle, as in balancing tasks), the answer is that of
   discount 1 - 1 / horizon in all states, and ``Solution.discount`` says so. Behaviour that takes
   more than 1000 horizons to end counts as endless.

The bound is then residual * (expected steps to the end under the policy, at most): the error of V
as the value of the returned policy, which no single action improves.

An action that was never tried is left out of the maximum, or counts ``untried``. A state in which
nothing was tried keeps its initial value, as if the episode ended there with that reward.

References: M. L. Puterman, *Markov Decision Processes* (1994), sections 6.4 to 6.6 and 7.2; D. P.
Bertsekas, J. N. Tsitsiklis, *An analysis of stochastic shortest path problems* (1991).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Int32s, Integers, freeze
from eutree.errors import InvalidArgumentError
from eutree.mdp import _kernels_planning as _kernels
from eutree.validation import check_number, check_vector

# With T(s, a) the transitions that left leaf s by action a (Eqs. 3 and 4 of the paper):
#
#     Pr(s, a, s') = |{(o, a, r, o') in T(s, a) : L(o') = s'}| / |T(s, a)|          (Eq. 3)
#     R(s, a)      = (sum of r over T(s, a)) / |T(s, a)|, the mean immediate reward  (Eq. 4)
#
# A terminated transition leads to no leaf: the rest of a row of Pr to 1 is the probability that the
# episode terminates, after which the value is 0. A truncated one is no such transition: it leads to
# the leaf of its last observation.


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
        freeze(self, "indptr", "visits", dtype=np.int64)
        freeze(self, "successor", dtype=np.int32)
        freeze(self, "probability", "termination", "reward", dtype=np.float64)
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

    def dense(self) -> Floats:
        """Return Pr as an array [S, A, S]; its rows sum to 1 minus the termination."""
        shape = (self.n_states, self.n_actions, self.n_states)
        probabilities = np.zeros((shape[0] * shape[1], shape[2]))
        pair = np.repeat(np.arange(len(probabilities)), np.diff(self.indptr))
        probabilities[pair, self.successor] = self.probability
        return probabilities.reshape(shape)


def _fault(model: Model) -> str:
    """Return the fault of a model's arrays; empty if there is none."""
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
    """Values and a greedy policy, with a bound on their error.

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
        freeze(self, "values", "action_values", "policy", "trapped")


@dataclass(eq=False)
class PlanningProblem:
    """A model with its choices made definite, and the arrays that the iteration works on."""

    model: Model
    pairs: _kernels.Pairs
    ends: Booleans  # [S A] pairs after which the process may stop
    untouched: Booleans  # [S] states in which nothing was tried
    greedy: _kernels.Greedy
    system: _kernels.System = field(repr=False)

    @classmethod
    def of(cls, model: Model, values: Floats, untried: float | None) -> "PlanningProblem":
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
        sparse = model.indptr, model.successor, model.probability
        size = model.successor.size
        return cls(
            model,
            _kernels.Pairs(*sparse, worth.ravel(), usable.ravel()),
            ends.ravel(),
            np.asarray(untouched),
            _kernels.Greedy(
                policy=np.full(n_states, NO_ACTION, np.int32),
                action_values=np.full(n_states * n_actions, np.nan),
                backed_up=np.empty(n_states),
            ),
            _kernels.System(
                starts=np.zeros(n_states + 1, np.int64),
                middles=np.zeros(n_states, np.int64),
                column=np.empty(size, np.int32),
                entry=np.empty(size),
                diagonal=np.empty(n_states),
                work=np.empty((8, n_states)),
            ),
        )

    @property
    def chosen(self) -> Integers:
        """The pair of each state that the policy chooses, [S]."""
        return np.arange(self.model.n_states) * self.model.n_actions + self.greedy.policy

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
        self.greedy.policy[:] = np.clip(actions, 0, None)
        self.greedy.policy[~(self.pairs.usable[self.chosen] & (actions >= 0))] = NO_ACTION

    def improve(self, values: Floats, discounts: Floats) -> int:
        """Back up all states; make the policy greedy and return how many actions changed."""
        return _kernels.improve(self.pairs, discounts, _TIE, values, self.greedy)

    def evaluate(
        self, values: Floats, discounts: Floats, rewards: Floats, residual: float
    ) -> float:
        """Set the values to those of the policy with these rewards [S], up to a residual.

        Return the residual that is left.
        """
        _kernels.fill_system(self.pairs, discounts, self.greedy.policy, self.system)
        right = rewards / self.system.diagonal
        return _kernels.evaluate(self.system, right, values, residual, _kernels.KRYLOV_LIMIT)

    def steps(self, discounts: Floats) -> float:
        """Return the largest expected (discounted) number of steps; infinite where it is lost."""
        steps = np.ones(len(discounts))
        left = self.evaluate(steps, discounts, np.ones(len(discounts)), 1e-3)
        return float(steps.max()) if left <= 0.1 and steps.min() > 0.5 else np.inf

    def n_endless(self) -> int:
        """Return from how many states the policy never reaches an end."""
        chosen = np.zeros(self.ends.size, dtype=bool)
        chosen[self.chosen] = True
        return int((self.ways_out(chosen) == NO_ACTION).sum())

    def ways_out(self, usable: Booleans) -> Int32s:
        """Return an action of each state that leads towards an end; NO_ACTION where none does."""
        out = np.empty(self.model.n_states, np.int32)
        _kernels.find_ways_out(*self.pairs[:2], self.ends, usable, out)
        return out

    def solve_discounted(self, values: Floats, discount: float, tolerance: float) -> Solution:
        """Return the solution from these values, with every step discounted."""
        can_stop = bool((self.ends & self.pairs.usable).any())
        rounds, bound, shift = _kernels.iterate_discounted(
            self.pairs, self.system, discount, _TIE, can_stop, tolerance, values.copy(), self.greedy
        )
        return self.solution(rounds, bound, tolerance, shift=shift, discount=discount)

    def solution(
        self, rounds: int, bound: float, tolerance: float, *, shift: float = 0.0,
        discount: float = 1.0, trapped: tuple[int, ...] | Integers = (),
    ) -> Solution:  # fmt: skip
        """Return the answer; ``shift`` is added to every Q but the fixed ones."""
        shown = self.greedy.action_values.reshape(self.model.visits.shape).copy()
        shown[self.model.visits > 0] += shift
        shown[self.untouched] = np.nan
        final, touched = self.greedy.backed_up.copy(), ~self.untouched
        final[touched] = np.fmax.reduce(shown[touched], axis=1)
        policy = np.where(touched, self.greedy.policy, NO_ACTION).astype(np.int64)
        lost = np.array(trapped, np.int64)
        return Solution(final, shown, policy, rounds, bound, bound <= tolerance, discount, lost)


_RESIDUAL = 1e-11  # of an evaluation, as a share of the largest value
_CLOSEST = 1e-13  # the same, where the decision is whether endless behaviour pays
_ROUNDS = 1000
_PATIENCE = 1000.0  # horizons after which a policy is taken never to end


def solve_undiscounted(
    problem: PlanningProblem, values: Floats, *, tolerance: float, horizon: float
) -> Solution:
    """Solve with discount 1, or with 1 - 1 / horizon if endless behaviour pays."""
    ways_out = problem.ways_out(problem.pairs.usable)
    trapped = ways_out == NO_ACTION
    floor = 1.0 - 1.0 / horizon
    discounts, longest = np.where(trapped, floor, 1.0), _PATIENCE * horizon

    def starts() -> Iterator[tuple[Floats, Int32s]]:
        """Yield values and policies to start from: the greedy, a discounted one, the ways out."""
        policy = problem.greedy.policy
        problem.improve(values, discounts)
        yield values, policy
        near = problem.solve_discounted(values, floor, tolerance).values
        yield near, policy
        yield near, np.where(trapped, policy, ways_out)

    for start, policy in starts():  # the first that ends soon enough is taken
        problem.greedy.policy[:] = policy
        if problem.n_endless() == trapped.sum() and problem.steps(discounts) <= longest:
            solution = _iterate(problem, start.copy(), discounts, longest, tolerance)
            if solution is not None:
                return solution
            break
    return problem.solve_discounted(values, floor, tolerance)


def _iterate(
    problem: PlanningProblem, values: Floats, discounts: Floats, longest: float, tolerance: float
) -> Solution | None:
    """Improve a policy that ends; None if endless behaviour, or values out of reach, pay."""
    trapped, worth, (policy, _, backed_up) = discounts < 1.0, problem.pairs.worth, problem.greedy
    ceiling = longest * float(np.abs(worth).max())
    close, narrowest, stalled = False, np.inf, 0
    residual = _RESIDUAL * (1.0 + float(np.abs(values).max()))
    for rounds in range(1, _ROUNDS + 1):
        reached = problem.evaluate(values, discounts, worth[problem.chosen], residual)
        before = policy.copy()
        changes = problem.improve(values, discounts)
        size = float(np.abs(backed_up).max())
        if problem.n_endless() > trapped.sum() or not size <= ceiling:
            if close:
                return None
            # Inexact values can make endless behaviour look better than it is: look closely.
            policy[:] = before
            residual, close = _CLOSEST * (1.0 + size), True
            continue
        change, close, bound = float(np.abs(backed_up - values).max()), False, np.inf
        residual = _RESIDUAL * (1.0 + size)
        if not changes:
            steps = problem.steps(discounts)
            if steps > longest:
                return None
            bound = change + reached * steps
            stalled = 0 if bound < narrowest else stalled + 1
            narrowest = min(narrowest, bound)
            residual = min(residual, 0.1 * tolerance / steps)
        if bound <= tolerance or stalled == 3 or rounds == _ROUNDS:
            break
        values = backed_up.copy()
    return problem.solution(rounds, bound, tolerance, trapped=np.flatnonzero(trapped))


def solve(
    model: Model,
    discount: float,
    *,
    tolerance: float = 1e-6,
    initial_values: ArrayLike | None = None,
    initial_policy: ArrayLike | None = None,
    untried: float | None = None,
    horizon: float = 1000.0,
) -> Solution:
    """Return V, Q and a best policy of a model.

    Args:
        model: Pr and R.
        discount: Weight of the next step's value, from 0 to 1.
        tolerance: Error that may remain in any value.
        initial_values: Where to begin; 0 if None. States in which nothing was tried keep theirs.
        initial_policy: Actions that are kept on ties; NO_ACTION for no preference.
        untried: Value of an action that was never tried; None leaves it out.
        horizon: Steps after which endless behaviour is taken to end; used with discount 1 only.
    """
    discount = check_number("discount", discount, low=0.0, high=1.0)
    tolerance = check_number("tolerance", tolerance, low=0.0, low_open=True)
    horizon = check_number("horizon", horizon, low=1.0)
    start = np.zeros(model.n_states) if initial_values is None else initial_values
    values = np.array(check_vector("initial_values", start, size=model.n_states))
    problem = PlanningProblem.of(model, values, untried)
    problem.keep(initial_policy)
    if discount < 1.0:
        return problem.solve_discounted(values, discount, tolerance)
    return solve_undiscounted(problem, values, tolerance=tolerance, horizon=horizon)
