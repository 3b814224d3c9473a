"""Compiled loop of Q-learning over numbered states."""

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled


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

    The n-th update of a state and action has the rate n ** -rate, so the first one replaces what
    stood there. Actions never tried are left out of the maximum; a state without any has value 0.
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
