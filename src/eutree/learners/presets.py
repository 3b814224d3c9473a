"""The presets: what the paper states, in its two readings, and what we recommend.

"The trial split that results in the largest difference between the two distributions is then
tested": the largest difference can be the lowest p-value, under which trees grow to the paper's
size (``paper``), or, to the letter, the largest Kolmogorov-Smirnov distance D (``paper-d``).
What else the paper leaves open is decided once for all experiments; how much each choice matters
is measured in ``docs/results/paper-sensitivity.md``.
"""

from dataclasses import replace

from eutree.imagination import Imagination
from eutree.learners.settings import Settings
from eutree.splitting import KolmogorovSmirnov, Naive
from eutree.validation import check_choice

PAPER = Settings(
    discount=0.99,
    exploration=0.1,
    gathering_episodes=20,
    splitter=KolmogorovSmirnov(score="scaled", compare="pooled", min_leaf=1),
    significance=Naive(alpha=0.01),
    solve_each_split=True,
    untried_value=0.0,
)

PAPER_D = replace(PAPER, splitter=KolmogorovSmirnov(score="distance", compare="pooled", min_leaf=1))

DEFAULT = replace(
    PAPER,
    splitter=KolmogorovSmirnov(score="scaled", compare="action", min_leaf=10),
    solve_each_split=False,
    solve_growth=1.1,
    retest_growth=1.5,
    untried_value=None,
    imagination=Imagination(),
)

PRESETS = {"default": DEFAULT, "paper": PAPER, "paper-d": PAPER_D}


def preset(name: str) -> Settings:
    """Return the settings of a preset: ``"default"``, ``"paper"`` or ``"paper-d"``."""
    return PRESETS[check_choice("preset", name, PRESETS)]
