"""A log that is learned from offline: what is learned from, and what judges the result.

What is learned from a log may be worse than an imitation of whoever acted in it, and no episode can
be run to find out. So a third of the episodes is held out, and unless they speak for the learned
tree the result is that of ``fit``, which is fitted to all of them.
"""

from dataclasses import dataclass, replace
from typing import Self

from eutree.data import Demonstrations, Episode, check_rewards
from eutree.evaluation.off_policy import OffPolicyComparison, compare_off_policy, hold_out
from eutree.interaction.seeding import Stream
from eutree.learners import fit_expert_tree
from eutree.policies import TreePolicy
from eutree.training.beginning import generator_of

DISCOUNT = 0.99  # of advantages, for methods without a discount


@dataclass(frozen=True, eq=False)
class Log:
    """Recorded episodes in two parts.

    Attributes:
        recorded: All of them.
        known: Those that are learned from.
        held_out: Those that judge.
        expert: The tree to beat; None for that of ``fit``.
        seed: Seed of the division and of what is estimated.
    """

    recorded: Demonstrations
    known: Demonstrations
    held_out: tuple[Episode, ...]
    expert: TreePolicy | None = None
    seed: int = 0

    @classmethod
    def of(cls, recorded: Demonstrations, expert: TreePolicy | None, *, seed: int) -> Self:
        """Divide recorded episodes; the seed chooses which are held out."""
        check_rewards(recorded, alone=True)
        known, held_out = hold_out(recorded.kept, generator_of(seed, Stream.HOLD_OUT, 0))
        return cls(recorded, replace(recorded, episodes=known), held_out, expert, seed)

    def chosen(
        self, learned: TreePolicy, *, discount: float
    ) -> tuple[TreePolicy, OffPolicyComparison]:
        """Return the learned tree if it is believed to be the better, else the one to beat."""
        rival = self._fitted(self.known, learned) if self.expert is None else self.expert
        found = compare_off_policy(
            learned,
            rival,
            self.known.kept,
            self.held_out,
            discount=discount,
            generator=generator_of(self.seed, Stream.HOLD_OUT, 1),
        )
        if found.believed:
            return learned, found
        return self.expert or self._fitted(self.recorded, learned), found

    def _fitted(self, episodes: Demonstrations, learned: TreePolicy) -> TreePolicy:
        """Return the tree of ``fit``, with the past among its features as the learned one has."""
        return replace(
            fit_expert_tree(episodes), history=learned.history, past_actions=learned.past_actions
        )
