"""A log that is learned from offline: what is learned from, and what judges the result.

What is learned from a log may be worse than an imitation of its actor, and no episode can
be run to find out. So a third of the episodes is held out; the learned tree is cut to what they
support, and unless they speak for it the result is the tree of ``fit``, which is fitted to all of
them: it imitates actions and knows no rewards, so it is the tree to beat, too.
"""

from dataclasses import dataclass, replace
from typing import Self

from eutree.data import Demonstrations, Episode, check_rewards
from eutree.evaluation.off_policy import Judge, OffPolicyComparison, hold_out
from eutree.interaction.seeding import Stream
from eutree.learners.starts import SETTINGS, best_left_out, candidates
from eutree.policies import TreePolicy
from eutree.training.phases import generator_of

DISCOUNT = 0.99  # of advantages, for methods without a discount


@dataclass(frozen=True, eq=False)
class Log:
    """Recorded episodes in two parts.

    Attributes:
        recorded: All of them.
        known: Those that are learned from.
        held_out: Those that judge.
        expert: The tree to beat; None for that of ``fit``.
        return_range: Lowest and highest return of an episode; None where they are not known.
        seed: Seed of the division and of what is estimated.
    """

    recorded: Demonstrations
    known: Demonstrations
    held_out: tuple[Episode, ...]
    expert: TreePolicy | None = None
    return_range: tuple[float, float] | None = None
    seed: int = 0

    @classmethod
    def of(
        cls,
        recorded: Demonstrations,
        expert: TreePolicy | None,
        return_range: tuple[float, float] | None,
        *,
        seed: int,
    ) -> Self:
        """Divide recorded episodes; the seed chooses which are held out."""
        check_rewards(recorded, alone=True)
        known, held_out = hold_out(recorded.kept, generator_of(seed, Stream.HOLD_OUT, 0))
        learned_from = replace(recorded, episodes=known)
        return cls(recorded, learned_from, held_out, expert, return_range, seed)

    def chosen(
        self, learned: TreePolicy, *, discount: float | None
    ) -> tuple[TreePolicy, OffPolicyComparison]:
        """Return the learned tree, cut, if it is believed to be the better; else the other one."""
        rival = self.expert or self._fitted(learned)
        known, held_out = self.known.kept, self.held_out
        widest = max((learned, rival), key=lambda policy: policy.tree.n_features)
        if widest.tree.n_features > self.recorded.schema.n_features:  # the other's come first in it
            known, held_out = (
                tuple(episode.with_features(widest.features) for episode in part)
                for part in (known, held_out)
            )
        judge = Judge(
            other=rival,
            known=known,
            held_out=held_out,
            discount=DISCOUNT if discount is None else discount,
            generator=generator_of(self.seed, Stream.HOLD_OUT, 1),
            return_range=self.return_range,
        )
        tree, found = judge.chosen(learned)
        return (tree if found.believed else rival), found

    def _fitted(self, learned: TreePolicy) -> TreePolicy:
        """Return the tree of ``fit`` without playing.

        Like ``fit`` it may choose to see the observation before, unless the past is among the
        recorded features already, or the learned tree sees previous actions alone.
        """
        stacked = learned.history and learned.tree.n_features == self.recorded.schema.n_features
        if stacked:
            return replace(self._best(histories=(0,)), history=learned.history)
        return self._best(histories=(0, 1) if learned.history or not learned.past_actions else (0,))

    def _best(self, histories: tuple[int, ...]) -> TreePolicy:
        found = candidates(self.recorded, settings=SETTINGS, histories=histories)
        return best_left_out(found).policy
