"""Where a test between two values of a feature lies: the one rule of every tree here."""


def threshold_between(low: float, high: float) -> float:
    """Return the midpoint of ``low < high``, or ``low`` where the midpoint rounds to an end.

    The result t satisfies ``low <= t < high`` for all finite float64, also one unit in the last
    place apart, so ``x <= t`` parts the two. Of two equal values it is that value. Kernels compile
    this same function.
    """
    middle = low / 2 + high / 2  # halves first: the sum of two large numbers would overflow
    return middle if low <= middle < high else low
