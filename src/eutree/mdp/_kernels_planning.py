"""Compiled loops of the exact solver: reachability, improvement backups, values of one policy.

Pair p = s A + a. ``worth`` is R(s, a); ``usable`` says which pairs may be chosen. The system of
one policy is divided by its diagonal D = 1 - discount * Pr(s, a, s), which solves the loops of
states to themselves: (I - M) V = r / D, where M holds the rest of discount * Pr / D by rows,
columns ascending.
"""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.compiled import compiled, overwrite

NO_ACTION = -1
SMALLEST = 1e-16  # diagonal: a loop that rounds to certain is left after 10^16 steps
SWEEPS = 20  # of symmetric Gauss-Seidel, where the Krylov iteration fails
RESTARTS = 4
KRYLOV_LIMIT = 300
ROUNDS = 200
FORCING = 0.03  # residual of an evaluation, as a share of the Bellman residual before it
TIGHT = 1e-6  # share from which on an evaluation counts as exact


class Pairs(NamedTuple):
    """The model, pair by pair."""

    indptr: Integers  # [S A + 1]
    successor: Int32s  # [K]
    probability: Floats  # [K]
    worth: Floats  # [S A]
    usable: Booleans  # [S A]


class Greedy(NamedTuple):
    """The greedy policy of an improvement, and the values by one backup of all states."""

    policy: Int32s  # [S]
    action_values: Floats  # [S A]
    backed_up: Floats  # [S]


class System(NamedTuple):
    """The linear system of one policy: M by rows and D; and room to solve it in."""

    starts: Integers  # [S + 1] first entry of each row
    middles: Integers  # [S] first entry above the diagonal
    column: Int32s  # [K]
    entry: Floats  # [K]
    diagonal: Floats  # [S] D
    work: Floats  # [8, S]


@compiled
def find_ways_out(
    indptr: Integers,  # [S A + 1]
    successor: Int32s,  # [K]
    ends: Booleans,  # [S A]
    usable: Booleans,  # [S A]
    policy: Int32s,  # [S]
) -> None:
    """Write an action that leads towards an end for each state.

    ``ends`` are the pairs after which the process may stop. Followed from any state, the actions
    reach an end with probability 1. States without a way out get NO_ACTION.
    """
    n_states = policy.shape[0]
    n_actions = usable.shape[0] // n_states
    # Counting sort: incoming[starts[s]:starts[s + 1]] are the pairs that lead to s, ascending.
    starts = np.zeros(n_states + 1, np.int64)  # [S + 1] pairs that lead to each state
    for k in range(successor.shape[0]):
        starts[successor[k] + 1] += 1
    for s in range(n_states):
        starts[s + 1] += starts[s]
    incoming = np.empty(successor.shape[0], np.int64)
    filled = starts[:-1].copy()
    for p in range(usable.shape[0]):
        for k in range(indptr[p], indptr[p + 1]):
            incoming[filled[successor[k]]] = p
            filled[successor[k]] += 1
    found = np.empty(n_states, np.int64)
    n_found = 0
    policy[:] = NO_ACTION
    for p in range(usable.shape[0]):
        if usable[p] and ends[p] and policy[p // n_actions] == NO_ACTION:
            policy[p // n_actions] = p % n_actions
            found[n_found] = p // n_actions
            n_found += 1
    n_followed = 0
    # Breadth first, backwards from the ends. The states found have an action each that may lead to
    # one found earlier; those before n_followed have been followed back.
    while n_followed < n_found:
        state = found[n_followed]
        n_followed += 1
        for k in range(starts[state], starts[state + 1]):
            p = incoming[k]
            if usable[p] and policy[p // n_actions] == NO_ACTION:
                policy[p // n_actions] = p % n_actions
                found[n_found] = p // n_actions
                n_found += 1


@compiled
def improve(
    pairs: Pairs,
    discounts: Floats,  # [S]
    tie: float,
    values: Floats,  # [S]
    out: Greedy,
) -> int:
    """Back up every state at once (Eqs. 5, 6), make the policy greedy; return its changes.

    The old action stays unless another is better by more than ``tie`` times the size of the value:
    else rounding could turn the policy round for ever.
    """
    indptr, successor, probability, worth, usable = pairs
    policy, action_values, backed_up = out
    n_states = values.shape[0]
    n_actions = usable.shape[0] // n_states
    changes = 0
    for s in range(n_states):  # the states before it are backed up from the old values
        best, choice = -np.inf, NO_ACTION
        for p in range(s * n_actions, (s + 1) * n_actions):
            if not usable[p]:
                continue
            # Successors ascend: the order of the sum, and so its last bit, depends on counts alone.
            total = 0.0
            for k in range(indptr[p], indptr[p + 1]):
                total += probability[k] * values[successor[k]]
            action_values[p] = worth[p] + discounts[s] * total
            if action_values[p] > best:
                best, choice = action_values[p], p - s * n_actions
        backed_up[s] = best
        if policy[s] != NO_ACTION:
            old = action_values[s * n_actions + policy[s]]
            if policy[s] == choice or old >= best - tie * (1.0 + abs(best)):
                continue
        policy[s] = choice
        changes += 1
    return changes


@compiled
def fill_system(
    pairs: Pairs,
    discounts: Floats,  # [S]
    policy: Int32s,  # [S]
    out: System,
) -> None:
    """Write D and M of one policy."""
    indptr, successor, probability = pairs.indptr, pairs.successor, pairs.probability
    starts, middles, column, entry = out.starts, out.middles, out.column, out.entry
    n_states = policy.shape[0]
    n_actions = (indptr.shape[0] - 1) // n_states
    size = 0
    for s in range(n_states):  # the rows before s take up the first ``size`` entries
        p = s * n_actions + policy[s]
        middles[s] = starts[s]
        loops = 0.0
        for k in range(indptr[p], indptr[p + 1]):
            if successor[k] == s:
                loops = probability[k]
                continue
            # Successors ascend, so the entries below the diagonal are the first of their row.
            if successor[k] < s:
                middles[s] += 1
            column[size] = successor[k]
            entry[size] = probability[k]
            size += 1
        starts[s + 1] = size
        out.diagonal[s] = max(1.0 - discounts[s] * loops, SMALLEST)
        scale = discounts[s] / out.diagonal[s]
        for k in range(starts[s], size):
            entry[k] *= scale


@compiled
def _residual(
    system: System,
    right: Floats,  # [S]
    values: Floats,  # [S]
    out: Floats,  # [S]
) -> float:
    """Write right - (I - M) values to ``out``; return the size of its largest entry."""
    starts, column, entry = system.starts, system.column, system.entry
    largest = 0.0
    for s in range(values.shape[0]):
        total = right[s] - values[s]
        for k in range(starts[s], starts[s + 1]):
            total += entry[k] * values[column[k]]
        out[s] = total
        if not abs(total) <= largest:  # NaN counts as larger
            largest = abs(total)
    return float(largest)


@compiled
def _precondition(
    system: System,
    right: Floats,  # [S]
    out: Floats,  # [S]
) -> None:
    """Write the result of one symmetric Gauss-Seidel sweep from 0 for ``right``."""
    starts, middles, column, entry = system.starts, system.middles, system.column, system.entry
    # With M = L + U, its lower and upper triangle, out = (I - U)^-1 (I - L)^-1 right.
    n_states = right.shape[0]
    for s in range(n_states):  # forwards: out holds the lower triangle's solution up to s
        total = right[s]
        for k in range(starts[s], middles[s]):
            total += entry[k] * out[column[k]]
        out[s] = total
    for s in range(n_states - 1, -1, -1):  # backwards: out is final from s + 1 on
        total = 0.0
        for k in range(middles[s], starts[s + 1]):
            total += entry[k] * out[column[k]]
        out[s] += total


@compiled
def _relax(
    system: System,
    right: Floats,  # [S]
    values: Floats,  # [S]
) -> None:
    """Improve the values by Gauss-Seidel sweeps there and back; they converge always."""
    starts, column, entry = system.starts, system.column, system.entry
    n_states = right.shape[0]
    # There and back: a value runs through an ascending or a descending chain in one sweep.
    for sweep in range(2 * SWEEPS):
        for i in range(n_states):
            s = i if sweep % 2 == 0 else n_states - 1 - i
            total = right[s]
            for k in range(starts[s], starts[s + 1]):
                total += entry[k] * values[column[k]]
            values[s] = total


@compiled
def _dot(x: Floats, y: Floats) -> float:
    """Return the inner product, in an order of sums that is fixed."""
    # Two sums, because each addition waits for the one before it. Which entries go into which is
    # fixed: a compiler may not choose.
    even, odd = 0.0, 0.0
    for i in range(0, x.shape[0] - 1, 2):
        even += x[i] * y[i]
        odd += x[i + 1] * y[i + 1]
    if x.shape[0] % 2:
        even += x[-1] * y[-1]
    return even + odd


@compiled
def _advance(target: Floats, residual: Floats, step: float, direction: Floats,
             image: Floats) -> float:  # fmt: skip
    """Go a step: target += step * direction, residual -= step * image; return its largest size."""
    largest = 0.0
    for i in range(target.shape[0]):
        target[i] += step * direction[i]
        residual[i] += step * image[i]
        if not abs(residual[i]) <= largest:
            largest = abs(residual[i])
    return float(largest)


@compiled
def _krylov(
    system: System,
    right: Floats,  # [S]
    values: Floats,  # [S]
    tolerance: float,
    limit: int,
) -> int:
    """Solve (I - M) V = right by BiCGSTAB (van der Vorst 1992); return the iterations.

    The images below are those of -(I - M), the result of ``_residual`` with a zero right side. A
    breakdown (a divisor of 0) ends the iteration where it is.
    """
    work = system.work
    residual, shadow, direction, image = work[0], work[1], work[2], work[3]
    smooth, second, zero = work[4], work[5], work[6]
    zero[:] = 0.0
    if _residual(system, right, values, residual) <= tolerance:
        return 0
    # The usual shadow, so rho begins as the squared size of the residual.
    overwrite(shadow, residual)
    overwrite(direction, residual)
    rho = _dot(shadow, residual)
    # residual = right - (I - M) values up to rounding; rho = shadow . residual, both at the top.
    for iteration in range(1, limit + 1):
        _precondition(system, direction, smooth)
        _residual(system, zero, smooth, image)
        divisor = -_dot(shadow, image)
        if divisor == 0.0:
            return iteration
        # Half a step along the direction, then half a step of least residual (omega).
        alpha = rho / divisor
        if not _advance(values, residual, alpha, smooth, image) > tolerance:
            return iteration
        _precondition(system, residual, smooth)
        _residual(system, zero, smooth, second)
        divisor = _dot(second, second)
        if divisor == 0.0:
            return iteration
        omega = -_dot(second, residual) / divisor
        if not _advance(values, residual, omega, smooth, second) > tolerance:
            return iteration
        new_rho = _dot(shadow, residual)
        if new_rho == 0.0 or omega == 0.0:
            return iteration
        beta = new_rho / rho * (alpha / omega)
        rho = new_rho
        for i in range(direction.shape[0]):
            direction[i] = residual[i] + beta * (direction[i] + omega * image[i])
    return limit


@compiled
def evaluate(
    system: System,
    right: Floats,  # [S]
    values: Floats,  # [S]
    tolerance: float,
    limit: int,
) -> float:
    """Solve (I - M) V = right from the given values; return the size of the true residual.

    The true residual never ends larger than it began: where the Krylov iteration makes it worse,
    Gauss-Seidel sweeps take its place.
    """
    work, kept = system.work, system.work[7]
    size = _residual(system, right, values, work[0])
    for _ in range(RESTARTS):  # size is the true residual of the values, never larger than before
        if size <= tolerance:
            return size
        overwrite(kept, values)
        _krylov(system, right, values, tolerance, limit)
        new = _residual(system, right, values, work[0])
        # Less than halved counts as failure; values worse than before are taken back.
        if not new < 0.5 * size:
            if not new < size:
                overwrite(values, kept)
            _relax(system, right, values)
            new = _residual(system, right, values, work[0])
            if not new < size:
                overwrite(values, kept)
                return size
        size = new
    return size


@compiled
def _range(before: Floats, after: Floats, episodic: bool) -> tuple[float, float]:
    """Return the ends of the change of all states, the absorbing one (0) included."""
    low, high = after[0] - before[0], after[0] - before[0]
    for s in range(before.shape[0]):
        change = after[s] - before[s]
        low, high = min(low, change), max(high, change)
    # The absorbing state is backed up to 0 every time: it has not changed.
    if episodic:
        low, high = min(low, 0.0), max(high, 0.0)
    return low, high


@compiled
def iterate_discounted(
    pairs: Pairs,
    system: System,
    discount: float,
    tie: float,
    episodic: bool,
    tolerance: float,
    values: Floats,  # [S]
    out: Greedy,
) -> tuple[int, float, float]:
    """Improve the policy until the values are certain; return rounds, bound and shift.

    The answer is ``backed_up`` and ``action_values``, plus the shift.
    """
    backed_up = out.backed_up
    n_states = values.shape[0]
    n_actions = pairs.usable.shape[0] // n_states
    discounts = np.full(n_states, discount)
    right, kept = np.empty(n_states), values.copy()
    # After a backup with changes from low to high, V lies between backed_up + scale low and
    # backed_up + scale high (Porteus 1971); their middle is wrong by half the distance at most. An
    # evaluation that leaves a residual of ``aim`` leaves an error of 0.3 of the tolerance in V.
    scale, forcing, aim = discount / (1.0 - discount), FORCING, 0.3 * tolerance * (1.0 - discount)
    narrowest, bound, stalled, rounds = np.inf, np.inf, 0, 0
    low, high = 0.0, 0.0
    # kept are the values before the backup of the narrowest bound so far.
    while rounds < ROUNDS and stalled < 3:
        rounds += 1
        changes = improve(pairs, discounts, tie, values, out)
        low, high = _range(values, backed_up, episodic)
        bound = scale * (high - low) / 2
        if bound < narrowest:
            overwrite(kept, values)
            narrowest, stalled = bound, 0
        elif forcing > TIGHT:
            # Far horizons magnify the error of an evaluation: go back, and evaluate more closely.
            forcing *= 0.01
            improve(pairs, discounts, tie, kept, out)
            low, high = _range(kept, backed_up, episodic)
            bound = narrowest
        elif changes == 0:
            stalled += 1
        if bound <= tolerance:
            break
        # The next evaluation starts from the middle of the bounds.
        for s in range(n_states):
            values[s] = backed_up[s] + scale * (high + low) / 2
        fill_system(pairs, discounts, out.policy, system)
        for s in range(n_states):
            right[s] = pairs.worth[s * n_actions + out.policy[s]] / system.diagonal[s]
        # No closer than the next improvement can use: that is most of the time saved.
        target = max(forcing * (high - low) / 2, aim)
        evaluate(system, right, values, target, KRYLOV_LIMIT)
    if bound > narrowest:
        improve(pairs, discounts, tie, kept, out)
        low, high = _range(kept, backed_up, episodic)
    return rounds, narrowest, scale * (high + low) / 2
