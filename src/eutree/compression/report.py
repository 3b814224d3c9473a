"""What a compression changed."""

from dataclasses import dataclass
from typing import Any

import msgspec

from eutree.compression.playing import Outcome
from eutree.evaluation import Estimate, Interval, mean_interval
from eutree.policies import TreePolicy

ROUNDED_EPISODES = 200  # that show what rounding changed, at most


@dataclass(frozen=True)
class RoundingPlayed:
    """What rounded thresholds changed, in the same episodes with the exact ones.

    Attributes:
        episodes: How many were played.
        different: Those that returned something else.
        exact: Mean return with the exact thresholds.
        rounded: Mean return with the rounded ones.
        kept: Whether the result is rounded; not where that loses more than the margin allows.
    """

    episodes: int
    different: int
    exact: float
    rounded: float
    kept: bool = True


_EARNED: dict[str, Any] = {
    "mean_return": float,
    "return_interval": Interval,
    "success_rate": float | None,
    "success_interval": Interval | None,
}


@dataclass(frozen=True)
class FrontEntry:
    """A tree of a front, and what it earned in episodes that chose nothing.

    Attributes:
        policy: The tree.
        mean_return: Its mean return.
        return_interval: 95 % interval of that.
        success_rate: Share of successes; None where none are reported.
        success_interval: 95 % interval of that.
    """

    policy: TreePolicy
    mean_return: float
    return_interval: Interval
    success_rate: float | None
    success_interval: Interval | None

    @classmethod
    def of(cls, policy: TreePolicy, outcome: Outcome) -> "FrontEntry":
        """Return the entry of a tree that earned this."""
        return cls(
            policy,
            outcome.mean_return,
            mean_interval(outcome.returns),
            outcome.success_rate,
            outcome.success_interval,
        )

    def facts(self, path: str | None = None) -> dict[str, Any]:
        """Return the entry in JSON's types; ``path`` is where its tree was written, if it was."""
        earned = {name: getattr(self, name) for name in _EARNED}
        return {"n_leaves": self.policy.n_leaves, **msgspec.to_builtins(earned), "path": path}

    @classmethod
    def from_facts(cls, policy: TreePolicy, facts: dict[str, Any]) -> "FrontEntry":
        """Take back ``facts()`` of a tree."""
        earned = {name: msgspec.convert(facts[name], kind) for name, kind in _EARNED.items()}
        return cls(policy, **earned)


@dataclass(frozen=True)
class CompressionReport:
    """What a compression changed.

    Attributes:
        n_leaves_before: Leaves of the input.
        n_leaves_after: Leaves of the result.
        agreement: Share of the recorded observations on which both decide the same.
        disagreement_volume: Exact share of the observations that can be on which they decide
            differently: in a box, the environment's, or the recorded data's where that is
            unbounded, in which whole values and categories are counted.
        method: Which candidate was kept: ``"merge"``, ``"drop"`` (tests that all recorded
            observations answer alike), ``"lossless"``, ``"paper"``, ``"budget"``, ``"return"``,
            ``"monotone"`` or ``"imagined"``.
        weighted_disagreement: What the changed decisions cost, as a share of the worst; with
            ``weights="visits"`` the share of recorded observations decided differently.
        environment_steps: Steps of all episodes run, in choosing and in confirming.
        mean_return_before: Mean return of the input on fresh episodes; None without environment.
        mean_return_after: Mean return of the result on the same episodes.
        return_change: Mean of after minus before, with bounds that hold for any returns within
            ``return_range``; each is wrong with probability 1 - confidence at most.
        return_range: Lowest and highest return of an episode.
        range_known: Whether that range is known, or else only the range of all returns seen.
        episodes_needed: How many episodes could have confirmed the margin at best, where those
            allowed were too few for any tree; else None.
        imagined: Scores of the input and of the result in a world model, pessimistic mean returns;
            None where there is none.
        rounding: What rounding changed in play; None where nothing was rounded, where there is no
            environment, or where the rounded tree won a race against the input itself.
        by: What chose the result: ``"episodes"`` of the environment, a world ``"model"``, or
            ``"labels"``, the decisions at recorded observations.
        front: The input and the best tree of each size, the largest first, all in the same
            episodes; empty unless episodes chose.
    """

    n_leaves_before: int
    n_leaves_after: int
    agreement: float
    disagreement_volume: float
    method: str
    weighted_disagreement: float = 0.0
    environment_steps: int = 0
    mean_return_before: float | None = None
    mean_return_after: float | None = None
    return_change: Estimate | None = None
    return_range: tuple[float, float] | None = None
    range_known: bool = False
    episodes_needed: int | None = None
    imagined: tuple[float, float] | None = None
    rounding: RoundingPlayed | None = None
    by: str = "labels"
    front: tuple[FrontEntry, ...] = ()
