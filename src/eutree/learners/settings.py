"""The settings of a learner: each a choice that the paper makes, leaves open, or that we improve.

A setting that has strategies holds one as a value (``OneStep()``, ``LambdaReturn(0.95)``), so an
ablation replaces one value and nothing else.
"""

from collections.abc import Iterator
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any

from eutree.imagination import Imagination
from eutree.learners.gates import AlwaysOpen, Gate
from eutree.learners.targets import OneStep, Target
from eutree.splitting import KolmogorovSmirnov, Naive, Significance
from eutree.validation import check_integer, check_number


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How a ``UTree`` learns.

    Attributes:
        discount: gamma of Eqs. 2 and 5.
        exploration: epsilon, the probability of a random action while gathering.
        gathering_episodes: Episodes of a data gathering phase, between two expansions.
        target: What q of a transition is (Eq. 2).
        splitter: Which cut of a leaf is its best.
        significance: Whether the best cut is more than chance (the stopping criterion).
        gate: Whether a significant split is worth a leaf.
        solve_each_split: Solve the MDP after every split, as Table 1 says, instead of once at the
            end of an expansion.
        solve_growth: Solve the MDP exactly only in an expansion to which the history has grown to
            this many times its size at the last exact solution; those between leave it to
            prioritized sweeping, from the leaves they split. 1 solves in every expansion.
        retest_growth: A leaf is tested again only when it holds this many times the transitions
            that it held at its last test; 1 tests every leaf in every expansion.
        untried_value: Q of an action never tried in a leaf; None leaves it out of the maximum.
        backups: Prioritized-sweeping backups after each step (Moore & Atkeson 1993).
        imagination: Plan the tree in a world model instead of splitting its leaves by tests; None
            is the paper's way.
        max_transitions: Most transitions remembered between two episodes: a sample of those of
            each leaf and action or, with imagination, whole episodes. None remembers all.
    """

    discount: float = 0.99
    exploration: float = 0.1
    gathering_episodes: int = 20
    target: Target = OneStep()
    splitter: KolmogorovSmirnov = KolmogorovSmirnov()
    significance: Significance = Naive()
    gate: Gate = AlwaysOpen()
    solve_each_split: bool = False
    solve_growth: float = 1.0
    retest_growth: float = 1.0
    untried_value: float | None = None
    backups: int = 5
    imagination: Imagination | None = None
    max_transitions: int | None = None

    def __post_init__(self) -> None:
        check_number("discount", self.discount, low=0.0, high=1.0)
        check_number("exploration", self.exploration, low=0.0, high=1.0)
        check_integer("gathering_episodes", self.gathering_episodes, low=1)
        check_number("solve_growth", self.solve_growth, low=1.0)
        check_number("retest_growth", self.retest_growth, low=1.0)
        check_integer("backups", self.backups, low=0)
        if self.untried_value is not None:
            check_number("untried_value", self.untried_value)
        if self.max_transitions is not None:
            check_integer("max_transitions", self.max_transitions, low=1)


def described(settings: Settings) -> dict[str, tuple[str, str]]:
    """Return each setting and its default as text, those of a strategy as ``"target.decay"``."""
    return {name: (text, default) for name, text, default in _described("", settings, Settings())}


def _described(prefix: str, value: Any, usual: Any) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and default of each field; ``usual`` is an example of defaults, or None."""
    for field in fields(value):
        name, inner = prefix + field.name, getattr(value, field.name)
        default = field.default if usual is None else getattr(usual, field.name)
        if not is_dataclass(inner):
            yield name, repr(inner), "" if default is MISSING else repr(default)
            continue
        yield name, type(inner).__name__, type(default).__name__
        yield from _described(name + ".", inner, default if type(default) is type(inner) else None)
