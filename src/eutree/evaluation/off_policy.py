"""Is a tree believed to beat another, by recorded episodes that neither was fitted to?

Each held-out episode gives one estimate of the gain (:mod:`eutree.evaluation.log_gains`), and the
numbers of whole episodes do not depend on each other. Their mean is bounded from below by betting
(:mod:`eutree.contests.betting`): where the range of returns is known, the bound is above the truth
in at most 5 % of all logs, however rare the losses. Where it is not known that of the whole log
stands for it, the sentence says so, and nothing is believed of actions that the log shows less than
300 times where the trees differ.

Single deviations are bounded by the numbers seen alone, whatever range of returns is known: they
need the 300 steps, too. And they say little of a tree that goes where nobody stayed. So where they
speak, the tree must also earn more in a world model of the episodes that it was learned from, in
paired rollouts from their starts. The two fail differently: the first where trees differ in long
runs, the second where the model is poor. Their joint verdict holds under a condition, which is in
the sentence.

A tree learned from a log may be worse than an imitation of its actor, and no episode can be run to
find out. So of a log (``Log``) a third of the episodes is held out; the learned tree is cut to the
size that they support, and unless they speak for it the result is the tree of ``fit``, which is
fitted to all of them: it imitates actions and knows no rewards, so it is the tree to beat, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from eutree.contests import Bounds
from eutree.contests.betting import lower_bound, tuned_stake
from eutree.contests.rules import BLIND
from eutree.data import Demonstrations, Episode, check_rewards
from eutree.display import counted
from eutree.evaluation.log_gains import FittedLog, Gains, cuts
from eutree.interaction.episode import Stream
from eutree.learners.starts import SETTINGS, best_left_out, fitted_trees
from eutree.policies import TreePolicy
from eutree.validation import check_number
from eutree.world_model import PairedRollouts, Transitions, fit_world_models
from eutree.world_model.action_trees import from_decision_tree
from eutree.world_model.transitions import seen_as

FEWEST_HELD_OUT = 4  # episodes; below that no difference is believed
HELD_OUT = 1 / 3  # share of the episodes
ROLLOUTS = 200
# Of a whole episode. Heavier ones say next to nothing, but need no condition.
MOST_WEIGHT, MOST_WEIGHT_KNOWN = 20.0, 1000.0  # the second where the range of returns is known
MIDDLE = 0.5  # between pessimism and optimism
CONFIDENCE = 0.95  # of the one-sided bound
DISCOUNT = 0.99  # of advantages, for methods without a discount


@dataclass(frozen=True)
class OffPolicyComparison:
    """The gain of a learned tree over another, estimated from held-out episodes."""

    # Estimated gain of the learned tree over the other in an episode; nan where unknown
    gain: float
    low: float  # lower bound of the gain at the confidence of ``CONFIDENCE``
    # Its gain in rollouts of a world model, less a standard error; nan where whole episodes speak,
    # which need no model
    predicted: float
    n_held_out: int  # held-out episodes
    condition: str = ""  # assumption of the bound, as the end of a sentence; "" where there is none
    tried: int = 0  # steps of the log at which the trees differ and the learned one was followed
    # Steps of that kind that a claim needs: where no known range of returns bounds what is lost, as
    # it never does of single deviations, losses rarer than once in a third of them may be unseen
    needed: int = 0
    most: float = np.inf  # the widest gain that returns allow

    @property
    def believed(self) -> bool:
        """Whether the learned tree is believed to be the better."""
        agreed = np.isnan(self.predicted) or self.predicted > 0.0
        possible = self.low <= self.most
        return bool(self.low > 0.0 and agreed and possible and self.tried >= self.needed)

    def facts(self) -> dict[str, float | int | bool | str | None]:
        """Return the comparison in JSON's types; None where nothing is known."""
        known = self.n_held_out >= FEWEST_HELD_OUT
        return {
            "gain": self.gain if known else None,
            "low": self.low if known else None,
            "predicted": self.predicted if known and not np.isnan(self.predicted) else None,
            "n_held_out": self.n_held_out,
            "believed": self.believed,
            "condition": self.condition,
            "tried": self.tried,
            "needed": self.needed,
        }

    def describe(self) -> str:
        """Return the comparison in one line."""
        if self.n_held_out < FEWEST_HELD_OUT:
            return (
                f"not believed to beat fit: {self.n_held_out} episodes could be held out, and "
                f"{FEWEST_HELD_OUT} are needed; this is the tree of fit"
            )
        whole = np.isnan(self.predicted)
        found = (
            f"{'return' if whole else 'by single deviations'} {self.gain:+.4g}, at least "
            f"{self.low:+.4g} at {CONFIDENCE:.0%}, by {self.n_held_out} held-out episodes"
        )
        found += "" if whole else f"; {self.predicted:+.4g} in a world model"
        if self.believed:
            found = f"believed to beat fit: {found}"
            return f"{found}, {self.condition}" if self.condition else found
        if self.tried < self.needed:
            found += (
                f"; in the log it was followed at {counted(self.tried, 'step')} at which they "
                f"differ, and {self.needed} are needed where the range of returns is not known"
                f"{'' if whole else ' or bounds nothing, as here'}"
            )
        if self.low > self.most:
            found += (
                f"; no two returns differ by more than {self.most:.4g}, so the log's chances of "
                "actions are not known"
            )
        return f"not believed to beat fit ({found}); this is the tree of fit"


def hold_out(
    episodes: Sequence[Episode], generator: np.random.Generator
) -> tuple[tuple[Episode, ...], tuple[Episode, ...]]:
    """Return episodes to learn from and episodes to judge by, each in their order.

    Where too few could be held out, none are.
    """
    n = int(len(episodes) * HELD_OUT)
    if n < FEWEST_HELD_OUT:
        return tuple(episodes), ()
    out = set(generator.permutation(len(episodes))[:n].tolist())
    return (
        tuple(episode for k, episode in enumerate(episodes) if k not in out),
        tuple(episode for k, episode in enumerate(episodes) if k in out),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Judge:
    """Compares trees with one and the same other tree, for example that of ``fit``."""

    other: TreePolicy  # the tree to beat
    known: Sequence[Episode]  # episodes that V and the actions' chances are fitted to
    held_out: Sequence[Episode]  # episodes that nothing was fitted to
    discount: float  # gamma of the advantages of single deviations
    generator: np.random.Generator  # source of the random numbers of rollouts
    # Lowest and highest return of an episode; None where they are not known
    return_range: tuple[float, float] | None = None

    def of(self, learned: TreePolicy, error: float = 1.0 - CONFIDENCE) -> OffPolicyComparison:
        """Compare a tree by the held-out episodes; ``error`` is the chance of a wrong bound."""
        if len(self.held_out) < FEWEST_HELD_OUT:
            return OffPolicyComparison(float("nan"), -np.inf, -np.inf, len(self.held_out))
        found = self._gains(learned)
        stake = tuned_stake(found.fitted, 0.0, found.worst)[0] if found.worst < 0.0 else None
        return OffPolicyComparison(
            gain=float(found.values.mean()),
            low=lower_bound(found.values, found.worst, error, stake),
            predicted=float("nan") if found.whole else self._predicted(learned),
            n_held_out=len(self.held_out),
            condition=self._condition(found),
            tried=found.tried,
            needed=0 if found.whole and self.return_range is not None else BLIND,
            most=self._limits[1] - self._limits[0] if found.whole else np.inf,
        )

    def chosen(self, learned: TreePolicy) -> tuple[TreePolicy, OffPolicyComparison]:
        """Return the tree that the held-out episodes support, cut to it, and its comparison.

        Of the learned tree and its cuts those that are believed to beat the other tree are kept,
        each bound with its share of the error (Bonferroni), and the smallest within a standard
        error of the best of them is the one. Where none is believed it is the learned tree.
        """
        if len(self.held_out) < FEWEST_HELD_OUT:
            return learned, self.of(learned)
        trees = cuts(learned, self._log)
        said = [self.of(tree, (1.0 - CONFIDENCE) / len(trees)) for tree in trees]
        believed = [k for k, one in enumerate(said) if one.believed]
        if not believed:
            return learned, said[0]
        best = max(believed, key=lambda k: said[k].gain)
        values = self._gains(trees[best]).values
        least = said[best].gain - float(values.std(ddof=1)) / np.sqrt(values.size)
        near = [k for k in believed if said[k].gain >= least]
        smallest = min(near, key=lambda k: trees[k].n_leaves)
        return trees[smallest], said[smallest]

    def _gains(self, learned: TreePolicy) -> Gains:
        most = MOST_WEIGHT if self.return_range is None else MOST_WEIGHT_KNOWN
        return self._log.gains(learned, self.other, self.held_out, self._limits, most_weight=most)

    @cached_property
    def _log(self) -> FittedLog:
        return FittedLog(self.known, self.other.schema.n_actions, self.discount)

    @cached_property
    def _limits(self) -> tuple[float, float]:
        """Lowest and highest return of an episode: as known, and wider if seen wider."""
        every = [*self.known, *self.held_out]
        whole = [episode for episode in every if not episode.was_stopped] or every
        ends = [*(one.undiscounted_return for one in whole), *(self.return_range or ())]
        return min(ends), max(ends)

    @cached_property
    def _rollouts(self) -> PairedRollouts:
        """Rollouts of the other tree in a world model."""
        transitions = Transitions.of(self.known, self.other.schema.n_actions)
        (model,) = fit_world_models(seen_as(self.other.derivation, transitions), (MIDDLE,))
        rollouts = PairedRollouts(model, ROLLOUTS, 1.0, self.generator)
        rollouts.run(from_decision_tree(self.other.tree, self.other.actions))
        return rollouts

    def _predicted(self, learned: TreePolicy) -> float:
        """Return a tree's gain over the other in rollouts, less a standard error."""
        gain = self._rollouts.gain(from_decision_tree(learned.tree, learned.actions))
        return gain.mean - gain.error

    def _condition(self, found: Gains) -> str:
        if not found.whole:
            return (
                "if single deviations add up, and no episode speaks against it more strongly than "
                f"by {max(-found.worst, 0.0):.4g}, the most seen"
            )
        return Bounds(0.0, 0.0, 0.0, self._limits, self.return_range is not None).condition()


@dataclass(frozen=True, eq=False)
class Log:
    """Recorded episodes in two parts."""

    recorded: Demonstrations  # all of them
    known: Demonstrations  # those that are learned from
    held_out: tuple[Episode, ...]  # those that judge
    expert: TreePolicy | None = None  # the tree to beat; None for that of ``fit``
    # Lowest and highest return of an episode; None where they are not known
    return_range: tuple[float, float] | None = None
    seed: int = 0  # seed of the division and of the estimates

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
        low, high = return_range or (-np.inf, np.inf)
        for earned in (round(episode.undiscounted_return, 9) for episode in recorded):
            check_number("each return, by return_range,", earned, low=low, high=high)
        known, held_out = hold_out(recorded.kept, _chance(seed, 0))
        learned_from = replace(recorded, episodes=known)
        return cls(recorded, learned_from, held_out, expert, return_range, seed)

    def chosen(
        self, learned: TreePolicy, *, discount: float | None
    ) -> tuple[TreePolicy, OffPolicyComparison]:
        """Return the learned tree, cut, if it is believed to be the better; else the other one."""
        other = self.expert or self._fitted(learned)
        known, held_out = self.known.kept, self.held_out
        widest = max((learned, other), key=lambda policy: policy.tree.n_features)
        if widest.tree.n_features > self.recorded.schema.n_features:  # the other's come first in it
            known, held_out = (
                tuple(episode.with_features(widest.features) for episode in part)
                for part in (known, held_out)
            )
        tree, found = Judge(
            other=other,
            known=known,
            held_out=held_out,
            discount=DISCOUNT if discount is None else discount,
            generator=_chance(self.seed, 1),
            return_range=self.return_range,
        ).chosen(learned)
        return (tree if found.believed else other), found

    def _fitted(self, learned: TreePolicy) -> TreePolicy:
        """Return the tree of ``fit`` without playing.

        Like ``fit`` it may choose to see the observation before, unless the past is among the
        recorded features already, or the learned tree sees previous actions alone.
        """
        stacked = learned.history and learned.tree.n_features == self.recorded.schema.n_features
        may_see = not stacked and (learned.history or not learned.past_actions)
        histories = (0, 1) if may_see else (0,)
        found = fitted_trees(self.recorded, settings=SETTINGS, histories=histories)
        best = best_left_out(found).policy
        return replace(best, history=learned.history) if stacked else best


def _chance(seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence((seed, Stream.HOLD_OUT, number)))
