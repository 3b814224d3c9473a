"""Compiled loops: nearest codewords and their means, and Q-learning over numbered states."""

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled


@compiled
def nearest(
    points: Floats,  # [N, d]
    codewords: Floats,  # [R, d]
    owners: Integers,  # [N] out
    squares: Floats,  # [N] out: squared distance to the owner
) -> None:
    """Write the nearest codeword of each point; ties go to the lower number.

    A sum of squares only grows, so a codeword is left as soon as it is no nearer than the best.
    """
    for i in range(points.shape[0]):
        # best is the smallest square of the codewords before r, owner the first that has it; -1
        # says that none was measured yet.
        best, owner = -1.0, 0
        for r in range(codewords.shape[0]):
            square = 0.0
            for j in range(points.shape[1]):
                offset = points[i, j] - codewords[r, j]
                square += offset * offset
                # Equal ones are left as well: the lower number keeps the point.
                if 0.0 <= best <= square:
                    break
            if best < 0.0 or square < best:
                best, owner = square, r
        owners[i], squares[i] = owner, best


@compiled
def nearest_in_leaf(
    points: Floats,  # [N, d]
    leaves: Integers,  # [N]
    codewords: Floats,  # [R, d], those of a leaf one after the other
    first: Integers,  # [L + 1]
    regions: Integers,  # [N] out
) -> None:
    """Write the nearest codeword of each point among those of its leaf."""
    for i in range(points.shape[0]):
        # As in ``nearest``, among the codewords of one leaf.
        best, region = -1.0, first[leaves[i]]
        for r in range(first[leaves[i]], first[leaves[i] + 1]):
            square = 0.0
            for j in range(points.shape[1]):
                offset = points[i, j] - codewords[r, j]
                square += offset * offset
            if best < 0.0 or square < best:
                best, region = square, r
        regions[i] = region


@compiled
def centroids(
    points: Floats,  # [N, d]
    owners: Integers,  # [N], each codeword owns a point
    codewords: Floats,  # [R, d] out
) -> None:
    """Write the mean of each codeword's points, added up in the order of the rows.

    The fixed order makes the same points in the same order the same bytes.
    """
    codewords[:] = 0.0
    counts = codewords[:, 0].copy()
    for i in range(points.shape[0]):
        counts[owners[i]] += 1.0
        for j in range(points.shape[1]):
            codewords[owners[i], j] += points[i, j]
    # Every codeword owns a point, so no count is 0.
    for r in range(codewords.shape[0]):
        for j in range(codewords.shape[1]):
            codewords[r, j] /= counts[r]


@compiled
def q_learning(
    states: Integers,  # [N]
    actions: Integers,  # [N]
    rewards: Floats,  # [N]
    next_states: Integers,  # [N], negative at a terminal state
    discount: float,
    rate: float,
    values: Floats,  # [S, A] in and out, NaN where never tried
    tried: Integers,  # [S, A] in and out
) -> None:
    """Update Q by the transitions, in their order (Watkins 1989).

    The n-th update of a state and action has the rate n ** -rate, so the first one replaces the
    value there. Actions never tried are left out of the maximum; a state without any has value 0.
    """
    for i in range(states.shape[0]):
        # values and tried hold the updates of the transitions before i.
        target = rewards[i]
        if next_states[i] >= 0:
            best, known = 0.0, False
            for a in range(values.shape[1]):
                value = values[next_states[i], a]
                # NaN compares unequal to itself: an action that was never tried.
                if value == value and (not known or value > best):
                    best, known = value, True
            target += discount * best
        s, a = states[i], actions[i]
        tried[s, a] += 1
        old = values[s, a]
        if old != old:
            old = 0.0
        # For 1/2 < rate <= 1 the rates sum to infinity and their squares do not.
        alpha = tried[s, a] ** -rate
        values[s, a] = old + alpha * (target - old)
