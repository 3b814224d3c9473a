"""Learn from recorded episodes alone: the expansion phases of Table 1 over a fixed history."""

from typing import Any, ClassVar

from eutree.data import Demonstrations
from eutree.evaluation import CurvePoint
from eutree.learners import UTree
from eutree.policies import TreePolicy
from eutree.training.progress import GatheredEpisodes
from eutree.training.run import EXPANSION_STREAM, generator_of


class OfflineRun:
    """A run without an environment: expand until nothing is split any more.

    Args:
        learner: The learner, with the recorded transitions in its history.
        demonstrations: Where they come from, for the names in the policy.
        seed: Seed of the permutation tests.
        max_expansions: Most expansion phases.

    Attributes:
        learner: The learner.
        episode: Episodes of experience: none.
        steps: Steps of experience: none.
        curve: Frozen evaluations: none.
        events: The expansions made so far.
        gathered: Episodes of experience: none.
        whole: Whether the learner is between two expansions, so that a checkpoint may be saved.
    """

    EVENT_NUMBERS: ClassVar[tuple[str, ...]] = ("n_splits", "n_leaves")

    def __init__(
        self,
        learner: UTree,
        demonstrations: Demonstrations,
        *,
        seed: int,
        max_expansions: int,
        history: int = 0,
    ) -> None:
        self.learner = learner
        self.episode = 0
        self.steps = 0
        self.curve: list[CurvePoint] = []
        self.events: list[dict[str, Any]] = []
        self.gathered = GatheredEpisodes()
        self.whole = True
        self._demonstrations = demonstrations
        self._seed = seed
        self._left = max_expansions
        self._history = history

    @property
    def finished(self) -> bool:
        """Whether the last expansion split nothing, or enough were made."""
        settled = bool(self.events) and not self.events[-1]["n_splits"]
        return settled or self._left == 0

    def advance(self) -> None:
        """Run one expansion phase."""
        number = len(self.events)
        self.whole = False
        made = self.learner.expand(generator_of(self._seed, EXPANSION_STREAM, number))
        self.whole = True
        self._left -= 1
        self.events.append(
            {
                "event": "expansion",
                "n_splits": len(made),
                "n_leaves": self.learner.tree.n_leaves,
            }
        )

    def policy(self) -> TreePolicy:
        """Return the present policy, frozen."""
        demonstrations = self._demonstrations
        return self.learner.policy(
            demonstrations.schema, demonstrations.environment, history=self._history
        )
