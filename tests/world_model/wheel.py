"""A wheel that turns, observed by an angle's cosine and sine, and by derived features."""

import numpy as np

from eutree.features import Derivation
from eutree.schema import Schema
from eutree.world_model import Transitions
from eutree.world_model.transitions import seen_as

WHEEL = Derivation.of(
    Schema.anonymous(5, 2).derive(
        ["lead = x2 + 0.51 * x0", "turned = x1 - last(x1) if x0 > 0 else min(lead, 1)"]
    )
)


def spins(n_episodes, seed):
    """A wheel of radius 2 that turns, pushed one way or the other, until it is fast.

    Features: rate, position right and up, whether it turns left, a constant, and ``WHEEL``'s.
    """
    generator = np.random.default_rng(seed)
    rows = []
    for episode in range(n_episodes):
        angle, rate = generator.uniform(-3, 3), 0.0
        seen = wheel_seen(angle, rate, None)
        for _ in range(40):
            action = int(generator.integers(2))
            rate += 0.1 * (2 * action - 1)
            angle += rate
            then, fast = wheel_seen(angle, rate, seen), abs(rate) > 0.8
            rows.append((seen, action, -1.0, then, fast, episode))
            seen = then
            if fast:
                break
    o, a, r, later, ended, episodes = (np.array(c) for c in zip(*rows, strict=True))
    return seen_as(WHEEL, Transitions(o, a, r, later, ended, episodes, 2))


def wheel_seen(angle, rate, before):
    measured = rate, 2 * np.cos(angle), 2 * np.sin(angle), float(rate > 0.0), 2.0
    return WHEEL.rows(np.array(measured), before)
