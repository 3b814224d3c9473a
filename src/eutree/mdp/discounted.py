"""Policy iteration where every step is discounted; :mod:`eutree.mdp.solver` has the theory."""

import numpy as np

from eutree.arrays import Floats
from eutree.mdp.problem import Problem, Solution


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
