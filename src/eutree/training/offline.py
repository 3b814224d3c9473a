"""Learn from recorded episodes alone: a method's updates over a fixed history."""

from typing import Any, ClassVar

from eutree.evaluation import CurvePoint
from eutree.policies import TreePolicy
from eutree.training.progress import GatheredEpisodes
from eutree.training.run import EXPANSION_STREAM, Beginning, generator_of


class OfflineRun:
    """A run without an environment: update until nothing is split any more.

    Args:
        beginning: How is learned, what, and from where; the start holds the recorded episodes.
        seed: Seed of the updates.
        max_updates: Most updates.

    Attributes:
        beginning: What the run began with.
        learner: The learner.
        episode: Episodes of experience: none.
        steps: Steps of experience: none.
        curve: Frozen evaluations: none.
        events: The updates made so far.
        gathered: Episodes of experience: none.
        whole: Whether the learner is between two updates, so that a checkpoint may be saved.
    """

    EVENT_NUMBERS: ClassVar[tuple[str, ...]] = ("n_splits", "n_leaves")

    def __init__(
        self,
        beginning: Beginning,
        *,
        seed: int,
        max_updates: int,
    ) -> None:
        self.beginning = beginning
        self.learner = beginning.learner()
        self.episode = 0
        self.steps = 0
        self.curve: list[CurvePoint] = []
        self.events: list[dict[str, Any]] = []
        self.gathered = GatheredEpisodes()
        self.whole = True
        self._seed = seed
        self._left = max_updates

    @property
    def finished(self) -> bool:
        """Whether the last update split nothing, or enough were made."""
        settled = bool(self.events) and not self.events[-1]["n_splits"]
        return settled or self._left == 0

    def advance(self) -> None:
        """Make one update."""
        number = len(self.events)
        self.whole = False
        update = self.learner.update(generator_of(self._seed, EXPANSION_STREAM, number))
        self.whole = True
        self._left -= 1
        self.events.append(
            {
                "event": "expansion",
                "n_splits": len(update.splits),
                "n_leaves": self.learner.decisions().tree.n_leaves,
            }
        )

    def policy(self) -> TreePolicy:
        """Return the present policy, frozen."""
        return self.learner.decisions().policy(self.beginning.problem)
