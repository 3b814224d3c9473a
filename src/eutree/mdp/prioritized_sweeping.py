"""Prioritized sweeping (Moore & Atkeson 1993): put each backup where it changes most.

After every real step the state it left goes on top of a queue. Then, as often as the budget
allows, the first state s of the queue is backed up; when its value changed by Delta, each pair
(s', a) that was seen to lead to s gives its state the priority

    Pr(s', a, s) * Delta

unless that is below a threshold. A state that is queued already keeps the *larger* of its two
priorities. Ties go to the lower state.

A backup here solves the loops of a state to itself at once: staying with an action until it leaves
the state has the same fixed point as Eq. 5, and leaves of a tree loop often. So a state never
queues itself, and an endless loop (discount 1, all transitions of an action back to their leaf)
cannot eat the budget: it is worth ``horizon`` times its reward, and chosen only if that is
positive or nothing else was tried.

An error of at most ``precision`` a step can hide below the threshold; discounted over all later
steps it grows by 1 / (1 - discount), so the threshold is ``precision * (1 - discount)``. With
discount 1 there is no such bound, and the threshold is ``precision / 1000``.

Reference: A. W. Moore, C. G. Atkeson, *Prioritized sweeping: reinforcement learning with less data
and less time*, Machine Learning 13 (1993).
"""

from dataclasses import dataclass

from eutree.validation import check_number


@dataclass(frozen=True)
class Sweeping:
    """When prioritized sweeping lets a change rest.

    Attributes:
        precision: Error of V that may remain for each change left alone.
    """

    precision: float = 1e-3

    def __post_init__(self) -> None:
        check_number("precision", self.precision, low=0.0)

    def threshold(self, discount: float) -> float:
        """Return the smallest change that is passed on to predecessors."""
        return self.precision * max(1.0 - discount, 1e-3)
