"""The smallest tree that is not worse than another by more than a margin, by paired episodes.

Selection: all candidates and the input run the same episodes, in blocks that double. A candidate
that is surely worse than the margin allows leaves the race; when the smallest that is left is
surely good enough, the race ends. Looking so often makes these intervals too narrow, so nothing
is promised yet. Confirmation: the winner meets the input again on fresh episodes, which took no
part in choosing it; if it fails, the next larger one does, up to three, each at a third of the
error allowed. So a tree worse than the margin is returned with probability 1 - confidence at most.
The intervals are Student's, and so take the mean difference as normal.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.evaluation import Estimate, Evaluation, Interval, evaluate, mean_interval
from eutree.interaction import episode_seed
from eutree.policies import TreePolicy

_FIRST_BLOCK = 32
_ATTEMPTS = 3
_SELECTION, _CONFIRMATION = 11, 12  # streams of seeds
_MOST_RUNNERS = 48


@dataclass(eq=False)
class Arena:
    """An environment, and how much was asked of it.

    Attributes:
        env: The environment.
        seed: Seed of all its episodes.
        steps: Environment steps of all episodes so far.
    """

    env: gymnasium.Env[Any, Any]
    seed: int
    steps: int = 0

    def run(self, policy: TreePolicy, episodes: int, stream: int, block: int) -> Evaluation:
        """Return how a policy does on the episodes of one block; the same ones for each policy."""
        result = evaluate(
            policy, self.env, episodes=episodes, seed=episode_seed(self.seed, block, stream)
        )
        self.steps += result.steps
        return result


@dataclass(frozen=True, kw_only=True)
class Demand:
    """How sure one wants to be of what.

    Attributes:
        margin: How much lower than the input's the mean return may be.
        confidence: That it is not lower than that.
        episodes: Most episodes of a policy in the selection, and episodes of a confirmation.
    """

    margin: float
    confidence: float
    episodes: int


@dataclass(frozen=True)
class Verdict:
    """Two policies on the same fresh episodes.

    Attributes:
        before: Mean return of the input.
        after: Mean return of the other policy.
        change: Mean of after minus before, with its interval.
    """

    before: float
    after: float
    change: Estimate


@dataclass(eq=False)
class _Runner:
    policy: TreePolicy
    differences: Floats = field(default_factory=lambda: np.empty(0))  # [E] to the input

    def interval(self, confidence: float) -> Interval:
        """Return the interval of the mean difference; ``confidence`` holds for each side."""
        return mean_interval(self.differences, confidence=2 * confidence - 1)


def race(
    policy: TreePolicy, candidates: Sequence[TreePolicy], arena: Arena, demand: Demand
) -> tuple[TreePolicy, Verdict] | None:
    """Return the smallest candidate that is confirmed, and how it did; None if none is.

    Args:
        policy: The input.
        candidates: The smallest first.
        arena: Where they run.
        demand: What the winner has to keep.
    """
    sure = 1 - (1 - demand.confidence) / _ATTEMPTS
    passed = _selected(policy, candidates, arena, demand)[:_ATTEMPTS]
    for attempt, candidate in enumerate(passed):
        verdict = meet(
            policy, candidate, arena, confidence=sure, episodes=demand.episodes, block=attempt
        )
        if verdict.change.interval.low >= -demand.margin:
            return candidate, verdict
    return None


def meet(
    policy: TreePolicy,
    other: TreePolicy,
    arena: Arena,
    *,
    confidence: float,
    episodes: int,
    block: int = 0,
) -> Verdict:
    """Return how two policies do on the same fresh episodes; ``confidence`` holds for one side."""
    before = arena.run(policy, episodes, _CONFIRMATION, block)
    after = arena.run(other, episodes, _CONFIRMATION, block)
    change = after.returns - before.returns
    interval = mean_interval(change, confidence=2 * confidence - 1)
    estimate = Estimate(float(change.mean()), interval, change.size)
    return Verdict(before.mean_return, after.mean_return, estimate)


def _selected(
    policy: TreePolicy, candidates: Sequence[TreePolicy], arena: Arena, demand: Demand
) -> list[TreePolicy]:
    """Return the candidates that may pass, the smallest first."""
    if not candidates:
        return []
    chosen = np.unique(np.linspace(0, len(candidates) - 1, _MOST_RUNNERS).round().astype(int))
    runners = [_Runner(candidates[number]) for number in chosen]
    passed: list[_Runner] = []  # larger than those that run
    seen, block, size = 0, 0, min(_FIRST_BLOCK, demand.episodes)
    while runners and seen < demand.episodes:
        returns = arena.run(policy, size, _SELECTION, block).returns
        for runner in runners:
            new = arena.run(runner.policy, size, _SELECTION, block).returns - returns
            runner.differences = np.concatenate([runner.differences, new])
        seen, block = seen + size, block + 1
        size = min(seen, demand.episodes - seen)
        ends = [r.interval(demand.confidence) for r in runners]
        alive = [(r, e) for r, e in zip(runners, ends, strict=True) if e.high >= -demand.margin]
        good = [number for number, (_, end) in enumerate(alive) if end.low >= -demand.margin]
        runners = [runner for runner, _ in alive]
        if good:  # what is larger than a good one runs no more, but may step in for it
            passed = runners[good[0] :] + passed
            runners = runners[: good[0]]
    undecided = [r for r in runners if r.differences.mean() >= -demand.margin]
    return [runner.policy for runner in undecided + passed]
