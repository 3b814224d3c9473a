"""Exact solution of an MDP over leaves, with a certified bound on what is left of the error.

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
   discount 1 - 1 / horizon in all states, and ``Solution.discount`` says so. What takes more than
   1000 horizons to end counts as endless.

The bound is then residual * (expected steps to the end under the policy, at most): the error of V
as the value of the returned policy, which no single action improves.

An action that was never tried is left out of the maximum, or counts ``untried``. A state in which
nothing was tried keeps its initial value, as if the episode ended there with that reward.

References: M. L. Puterman, *Markov Decision Processes* (1994), sections 6.4 to 6.6 and 7.2; D. P.
Bertsekas, J. N. Tsitsiklis, *An analysis of stochastic shortest path problems* (1991).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Int32s
from eutree.mdp.problem import NO_ACTION, Model, Problem, Solution
from eutree.validation import check_number, check_vector


def solve_discounted(
    problem: Problem, values: Floats, discount: float, tolerance: float
) -> Solution:
    """Solve where every step is discounted."""
    backed_up = np.empty_like(values)
    rounds, bound, shift = problem.iterate_discounted(values.copy(), backed_up, discount, tolerance)
    return problem.solution(
        backed_up, shift, rounds=rounds, bound=bound, tolerance=tolerance, discount=discount,
        trapped=np.empty(0, np.int64),
    )  # fmt: skip


_RESIDUAL = 1e-11  # of an evaluation, as a share of the largest value
_CLOSEST = 1e-13  # the same, where the decision is whether endless behaviour pays
_ROUNDS = 1000
_PATIENCE = 1000.0  # horizons after which a policy is taken never to end


def solve_undiscounted(
    problem: Problem, values: Floats, *, tolerance: float, horizon: float
) -> Solution:
    """Solve with discount 1, or with 1 - 1 / horizon if endless behaviour pays."""
    ways_out = problem.ways_out(problem.pairs.usable)
    trapped = ways_out == NO_ACTION
    discounts = np.where(trapped, 1.0 - 1.0 / horizon, 1.0)
    longest = _PATIENCE * horizon
    for start, policy in _starts(problem, values, discounts, ways_out, tolerance, horizon):
        problem.policy[:] = policy
        if problem.n_endless() == trapped.sum() and problem.steps(discounts) <= longest:
            solution = _iterate(problem, start.copy(), discounts, longest, tolerance)
            if solution is not None:
                return solution
            break
    return solve_discounted(problem, values, 1.0 - 1.0 / horizon, tolerance)


def _starts(
    problem: Problem,
    values: Floats,
    discounts: Floats,
    ways_out: Int32s,
    tolerance: float,
    horizon: float,
) -> Iterator[tuple[Floats, Int32s]]:
    """Yield values and policies to start from, of which the first that ends soon enough is taken.

    They are the greedy policy of the initial values, that of a discounted solution, and the
    actions that lead towards an end.
    """
    problem.improve(values, discounts, np.empty_like(values))
    yield values, problem.policy
    near = solve_discounted(problem, values, 1.0 - 1.0 / horizon, tolerance)
    yield near.values, problem.policy
    yield near.values, np.where(ways_out == NO_ACTION, problem.policy, ways_out)


def _iterate(
    problem: Problem,
    values: Floats,
    discounts: Floats,
    longest: float,
    tolerance: float,
) -> Solution | None:
    """Improve a policy that ends; None if endless behaviour, or values out of reach, pay."""
    trapped = discounts < 1.0
    ceiling = longest * float(np.abs(problem.pairs.worth).max())
    backed_up = np.empty_like(values)
    close, narrowest, stalled = False, np.inf, 0
    residual = _RESIDUAL * (1.0 + float(np.abs(values).max()))
    for rounds in range(1, _ROUNDS + 1):
        reached = problem.evaluate(values, discounts, residual)
        before = problem.policy.copy()
        changes = problem.improve(values, discounts, backed_up)
        size = float(np.abs(backed_up).max())
        if problem.n_endless() > trapped.sum() or not size <= ceiling:
            if close:
                return None
            # Inexact values can make endless behaviour look better than it is: look closely.
            problem.policy[:] = before
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
    return problem.solution(
        backed_up, 0.0, rounds=rounds, bound=bound, tolerance=tolerance, discount=1.0,
        trapped=np.flatnonzero(trapped),
    )  # fmt: skip


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
        untried: What an action counts that was never tried; None leaves it out.
        horizon: Steps after which endless behaviour is taken to end; used with discount 1 only.
    """
    discount = check_number("discount", discount, low=0.0, high=1.0)
    tolerance = check_number("tolerance", tolerance, low=0.0, low_open=True)
    horizon = check_number("horizon", horizon, low=1.0)
    start = np.zeros(model.n_states) if initial_values is None else initial_values
    values = np.array(check_vector("initial_values", start, size=model.n_states))
    problem = Problem.of(model, values, untried)
    problem.keep(initial_policy)
    if discount < 1.0:
        return solve_discounted(problem, values, discount, tolerance)
    return solve_undiscounted(problem, values, tolerance=tolerance, horizon=horizon)
