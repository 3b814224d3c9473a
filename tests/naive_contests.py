"""Contests as plain loops over lists: slow, obvious twins of the rules of ``eutree.contests``.

A table is a list of rows, a row a list of returns in the order of starts; None is an episode that
was not run. A rule's twin returns ("run", trees, number of starts) or ("verdict", winner).
"""

import math

SHARES = [0.5**k for k in range(11)]


def log_wealth(gains, mean, worst):
    """Return the logarithm of what the gambler holds, stake by stake and value by value."""
    total = 0.0
    for share in SHARES:
        wealth = 1.0
        for gain in gains:
            wealth *= max(1.0 + share / (mean - worst) * (gain - mean), 0.0)
        total += wealth / len(SHARES)
    return math.log(total) if total > 0.0 else -math.inf


def mean_of(values):
    return sum(values) / len(values)


def standard_error(values):
    mean = mean_of(values)
    return math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1) / len(values))


def paired_gains(table, most):
    gains = []
    for own, other in list(zip(table[0], table[1], strict=True))[:most]:
        if own is None or other is None:
            break
        gains.append(other - own)
    return gains


def bounds_seen(table, known):
    told = [value for row in table for value in row if value is not None]
    told += list(known or ())
    return (min(told), max(told)) if told else (0.0, 0.0)


def not_worse(table, *, margin, error, most, known=None, blind=300):
    """Return what the rules NotWorse (and, at a margin of 0, Better) say."""
    gains = paired_gains(table, most)
    low, high = bounds_seen(table, known)
    worst = low - high
    first = 1 if known is not None else max(min(blind, most), 1)
    for n in range(first, len(gains) + 1):
        if worst == 0 and margin == 0:
            break
        if known is not None and worst >= -margin:
            return ("verdict", 1)
        if log_wealth(gains[:n], -margin, min(worst, -2 * margin)) >= -math.log(error):
            return ("verdict", 1)
    n = len(gains)
    if n >= most:
        return ("verdict", 0)
    if n >= 32:
        mean = mean_of(gains) + margin
        if mean + 2.33 * standard_error(gains) < 0 or (n >= most // 2 and mean <= 0):
            return ("verdict", 0)
    return ("run", (0, 1), min(max(32, math.ceil(1.5 * n)), most))


def halving(table, *, first, most, prices=None, guesses=None):
    """Return what Halving says, where one tree is left at the end."""
    alive, n = list(range(len(table))), min(first, most)
    while True:
        if any(table[tree][start] is None for tree in alive for start in range(n)):
            return ("run", tuple(sorted(alive)), n)
        score = {}
        for tree in alive:
            values = table[tree][:n] + ([guesses[tree]] * 64 if guesses else [])
            score[tree] = mean_of(values) - (prices[tree] if prices else 0.0)
        alive.sort(key=lambda tree: (-score[tree], tree))
        if len(alive) == 1:
            return ("verdict", alive[0])
        alive = alive[: (len(alive) + 1) // 2]
        if n >= most:
            return ("verdict", alive[0])
        n = min(2 * n, most)


def smallest_near_best(table, *, sizes, episodes):
    """Return what SmallestWithin says, where it is held against the best tree."""
    alive, n = list(range(len(table))), min(32, episodes)
    while True:
        if any(table[tree][start] is None for tree in alive for start in range(n)):
            return ("run", tuple(alive), n)
        best = max(alive, key=lambda tree: (mean_of(table[tree][:n]), -sizes[tree]))
        error = standard_error(table[best][:n])
        kept = []
        for tree in alive:
            gains = [table[tree][k] - table[best][k] for k in range(n)]
            if n < 32 or mean_of(gains) + 2.33 * standard_error(gains) >= -error:
                kept.append(tree)
        alive = kept
        if n == episodes:
            break
        n = min(2 * n, episodes)
    near = [
        tree
        for tree in alive
        if sizes[tree] < sizes[best]
        and mean_of([table[tree][k] - table[best][k] for k in range(n)]) >= -error
    ]
    near.sort(key=lambda tree: (sizes[tree], tree))
    for attempt, tree in enumerate(near[:3], 1):
        starts = range(attempt * episodes, (attempt + 1) * episodes)
        if any(table[one][start] is None for one in (best, tree) for start in starts):
            return ("run", (best, tree), starts.stop)
        if mean_of([table[tree][k] - table[best][k] for k in starts]) >= -error:
            return ("verdict", tree)
    return ("verdict", best)


def ahead(table, *, looks, errors, final, patient, rare_losses, prices=None, known=None):
    """Return what Ahead says, look by look and pair by pair."""
    prices = prices or [0.0] * len(table)
    alive = list(range(len(table)))
    for n in looks:
        if any(table[tree][start] is None for tree in alive for start in range(n)):
            return ("run", tuple(sorted(alive)), n)
        gains = {tree: [table[tree][k] - table[0][k] for k in range(n)] for tree in alive[1:]}
        lead = {tree: mean_of(gains[tree]) + prices[0] - prices[tree] for tree in gains}
        challengers = sorted(gains, key=lambda tree: (-lead[tree], tree))
        alive = [0, *challengers[: max(len(challengers) // 2, 1)]]
        if len(alive) > 2 and n < looks[-1]:
            continue
        challenger = alive[1]
        mean, error = lead[challenger], standard_error(gains[challenger])
        saved = prices[0] - prices[challenger]
        sure = mean_of(gains[challenger]) + min(saved, 0.0)
        told = [table[tree][k] for tree in (0, challenger) for k in range(n)] + list(known or ())
        stands = not rare_losses or n * mean + min(told) - max(told) > 0.0
        if stands and n >= 32 and sure > errors * error:
            return ("verdict", challenger)
        if stands and not patient and {8: 4.79, 16: 3.73}.get(n, math.inf) * error < sure:
            return ("verdict", challenger)
        if n == looks[-1]:
            return ("verdict", challenger if stands and mean > final * error else 0)
        if mean < -error and n >= 32 if patient else mean <= 0.0:
            return ("verdict", 0)
    raise AssertionError("the last look decides")
