"""Slow twins of what ``eutree.proof`` computes: mpmath's intervals, one number at a time."""

import mpmath

CONTEXT = mpmath.iv


def interval(low, high):
    """Return an interval of mpmath between two doubles."""
    return CONTEXT.mpf([float(low), float(high)])


def ends(value):
    """Return the bounds of an interval of mpmath, as exact numbers."""
    with mpmath.workprec(200):
        return mpmath.mpf(value.a), mpmath.mpf(value.b)


def twin_of(name, *operands):
    """Return an operation on intervals [low, high] by mpmath."""
    values = [interval(*ends) for ends in operands]
    if name == "square":
        return values[0] ** 2
    if name in ("sin", "cos", "sqrt"):
        return getattr(CONTEXT, name)(*values)
    return {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "truediv": lambda a, b: a / b,
    }[name](*values)


def share_bounds(successes, n, error):
    """Return Clopper and Pearson's bounds by SciPy's quantiles of the beta distribution."""
    from scipy import stats

    low = 0.0 if successes == 0 else stats.beta.ppf(error, successes, n - successes + 1)
    high = 1.0 if successes == n else stats.beta.ppf(1 - error, successes + 1, n - successes)
    return float(low), float(high)
