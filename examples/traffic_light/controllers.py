"""Controllers that a tree of the light has to beat. Each sees what the tree sees.

With K phases an observation is waiting [K], coming [K], green [K], red for [K], unchanged for; and
then what is derived of them.
"""

from typing import Any

import numpy as np

PERIOD = 10  # seconds: RESCO's step for both junctions (its map_config.py)


def longest_queue(observation: Any) -> int:
    """Serve the phase for which most wait: the rule of thumb."""
    waiting, _, green, _ = _parts(observation)
    return _largest(waiting, green)


def max_pressure(observation: Any) -> int:
    """Serve the phase of the largest pressure, every ten seconds, as RESCO's MAXPRESSURE does.

    The pressure is the queue in front less the queue behind, which is none at a single light.
    """
    waiting, _, green, since = _parts(observation)
    return _largest(waiting, green) if since >= PERIOD else int(np.argmax(green))


def max_wave(observation: Any) -> int:
    """Serve the phase with most vehicles, every ten seconds: RESCO's MAXWAVE."""
    waiting, coming, green, since = _parts(observation)
    return _largest(waiting + coming, green) if since >= PERIOD else int(np.argmax(green))


class FixedCycle:
    """Each phase in turn for so many seconds, whatever comes."""

    def __init__(self, env: Any = None, *, seconds: float = 20.0) -> None:
        self.seconds = seconds

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:  # fmt: skip
        """Return the phase that is to be green."""
        _, _, green, since = _parts(np.ravel(observation))
        return np.int64((np.argmax(green) + (since >= self.seconds)) % green.size), state


def _parts(observation: Any) -> tuple[Any, Any, Any, float]:
    n = (len(observation) - 1) // 4
    waiting, coming, green = (np.asarray(observation[k * n : (k + 1) * n]) for k in range(3))
    return waiting, coming, green, float(observation[4 * n])


def _largest(counts: Any, green: Any) -> int:
    """Return the phase with the largest count; the green one where it has as many."""
    return int(np.argmax(counts + 0.5 * green))
