"""Policy iteration with discount 1; :mod:`eutree.mdp.solver` says what that means."""

from collections.abc import Iterator

import numpy as np

from eutree.arrays import Floats, Int32s
from eutree.mdp.discounted import solve_discounted
from eutree.mdp.model import NO_ACTION
from eutree.mdp.problem import Problem, Solution

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
