"""A patient race: many rivals meet the incumbent on the same real episodes, and few are left early.

Entrant 0 is the incumbent and stays to the end. All run the same episodes; at each look half of
the rivals, those that earn least, leave. The last one goes on until it is clearly ahead or behind,
but is judged on no fewer than 32 pairs: with fewer, chance decides. Every pair of a race counts,
also those that were run while others were still in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eutree.arrays import Floats

ENOUGH = 32  # pairs below which nobody is called better or worse
SURE = 2.0  # standard errors ahead that end a race
LOOKS = (8, 20, 40, 72, 136)


@dataclass(frozen=True)
class Standing:
    """Where a race stands.

    Attributes:
        alive: Entrants that still run, the incumbent first, then the best rivals first.
        episodes: Episodes that all of them are to run next; 0 if the race is over.
    """

    alive: tuple[int, ...]
    episodes: int


class PatientRace:
    """One race; it says who runs which episode and is told the returns.

    Args:
        n_entrants: The incumbent and its rivals, at least two.
        looks: Episodes after which rivals are compared, ascending.
        returns: What is known already, NaN where nothing is, shape [n, E].

    Attributes:
        looks: As given.
        returns: Return of each entrant in each episode, NaN where it is not known.
    """

    def __init__(
        self, n_entrants: int, looks: Sequence[int] = LOOKS, returns: Floats | None = None
    ) -> None:
        self.looks = tuple(looks)
        unknown = np.full((n_entrants, self.looks[-1]), np.nan)
        self.returns = unknown if returns is None else returns.copy()

    def next(self) -> tuple[int, int] | None:
        """Return which entrant is to run which episode; None if the race is over."""
        standing = self.standing()
        alive = np.sort(np.array(standing.alive))
        missing = np.isnan(self.returns[alive, : standing.episodes])
        if not missing.any():
            return None
        episode = int(missing.any(axis=0).argmax())
        return int(alive[missing[:, episode].argmax()]), episode

    def tell(self, entrant: int, episode: int, value: float) -> None:
        """Take note of an entrant's return."""
        self.returns[entrant, episode] = value

    def standing(self) -> Standing:
        """Return who is still in the race. All of it follows from the returns."""
        alive = tuple(range(len(self.returns)))
        for look in self.looks:
            if np.isnan(self.returns[list(alive), :look]).any():
                return Standing(alive, look)
            rivals = sorted(alive[1:], key=lambda one: (-self.ahead(one)[0], one))
            alive = (0, *rivals[: max(len(rivals) // 2, 1)])
            if len(alive) == 2 and self._clear(alive[1]):
                break
        return Standing(alive, 0)

    def winner(self, *, clearly: bool = False) -> int:
        """Return who should be the incumbent, by the pairs known so far.

        On fewer than 32 pairs, where the steps ended the race, a rival has to be a standard error
        ahead.

        Args:
            clearly: A rival has to be two standard errors ahead, on any number of pairs.
        """
        best, most = 0, 0.0
        for rival in self.standing().alive[1:]:
            mean, error, n = self.ahead(rival)
            errors = SURE if clearly else float(n < ENOUGH)
            if n > 1 and mean > most and mean > errors * error:
                best, most = rival, mean
        return best

    def ahead(self, rival: int) -> tuple[float, float, int]:
        """Return by how much a rival is ahead of the incumbent, its standard error, and pairs."""
        gain = self.returns[rival] - self.returns[0]
        gain = gain[~np.isnan(gain)]
        if gain.size < 2:
            return (float(gain.sum()), float("inf"), gain.size)
        return float(gain.mean()), float(gain.std(ddof=1) / np.sqrt(gain.size)), gain.size

    def _clear(self, rival: int) -> bool:
        mean, error, n = self.ahead(rival)
        return n >= ENOUGH and (mean > SURE * error or mean < -error)
