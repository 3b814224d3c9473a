"""Where a run acts, and what frozen trees did there: none plays the same start twice."""

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from eutree.compression.playing import Ground
from eutree.evaluation import Evaluation
from eutree.interaction import GuardedEnv
from eutree.policies import TreePolicy
from eutree.training.proposals import key

KNOWN = 16  # trees whose episodes are remembered

Player = Callable[[TreePolicy, Sequence[int], int], Evaluation]  # (policy, starts, seed)


@dataclass(frozen=True)
class Arena:
    """Where a run acts.

    Attributes:
        env: Where episodes are gathered and raced.
        play: How to play a frozen policy from some starts of an evaluation with a seed.
        ground: How to let many frozen policies play beside each other, from starts with a seed.
        return_range: Lowest and highest return of an episode; None where they are not known.
    """

    env: GuardedEnv
    play: Player
    ground: Callable[[int], Ground]
    return_range: tuple[float, float] | None = None


class PlayedStarts:
    """What frozen trees did from numbered starts, and how much that was.

    What was played once is counted once, though its returns may be lost between two parts of a run
    and have to be played again.

    Attributes:
        counts: How many starts, the first ones, each tree has played, by a digest; the last is the
            latest.
        episodes: Episodes played.
        steps: Their steps.
        seconds: Their time by the clock.
    """

    def __init__(self) -> None:
        self._known: dict[str, Evaluation] = {}
        self.counts: dict[str, int] = {}
        self.episodes = self.steps = 0
        self.seconds = 0.0

    def known(self, policy: TreePolicy, seed: int) -> int:
        """Return from how many starts, the first ones, a policy has played."""
        return self.counts.get(_digest(policy, seed), 0)

    def of(self, policy: TreePolicy, starts: Sequence[int], seed: int, arena: Arena) -> Evaluation:
        """Return what a policy does from some starts, ascending, of an evaluation with this seed.

        Those before them are played, too, if they were not yet.
        """
        asked, n = _digest(policy, seed), starts[-1] + 1
        found, counted = self._known.pop(asked, None), self.counts.pop(asked, 0)
        have = 0 if found is None else found.episodes
        if found is None or n > have:
            begin = time.monotonic()
            more = arena.play(policy, range(have, n), seed)
            self.seconds += time.monotonic() - begin
            found = more if found is None else Evaluation.join([found, more])
        self.steps += int(found.lengths[counted:].sum())
        self.episodes += max(found.episodes - counted, 0)
        self._known[asked], self.counts[asked] = found, max(found.episodes, counted)
        for old in list(self.counts)[:-KNOWN]:
            del self.counts[old]
            self._known.pop(old, None)
        return found.of_episodes(starts)


def _digest(policy: TreePolicy, seed: int) -> str:
    return hashlib.sha256(key(policy) + seed.to_bytes(8, "big")).hexdigest()[:16]
