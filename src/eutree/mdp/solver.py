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

import numpy as np
from numpy.typing import ArrayLike

from eutree.mdp.discounted import solve_discounted
from eutree.mdp.model import Model
from eutree.mdp.problem import Problem, Solution
from eutree.mdp.undiscounted import solve_undiscounted
from eutree.validation import check_number, check_vector


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
