"""All experiments by name."""

from eutree.validation import check_choice
from eutree_lab.paper.experiment import Experiment
from eutree_lab.paper.expert_and_compression import COMPRESSION, EXPERT
from eutree_lab.paper.figure_2_3 import FIGURE_2, FIGURE_3
from eutree_lab.paper.figure_4_5 import FIGURE_4A, FIGURE_4B, FIGURE_5
from eutree_lab.paper.table_2 import TABLE_2

EXPERIMENTS = {
    experiment.id: experiment
    for experiment in (
        FIGURE_2,
        FIGURE_3,
        TABLE_2,
        FIGURE_4A,
        FIGURE_4B,
        FIGURE_5,
        EXPERT,
        COMPRESSION,
    )
}

FRAMEWORK = "framework"  # runs methods from starts, not learners under presets
FRAMEWORK_TITLE = "The framework: every method, every start"


def chosen(name: str) -> list[Experiment]:
    """Return the experiment of that name, or every one of the paper's for ``"all"``."""
    check_choice("experiment", name, [*EXPERIMENTS, "all"])
    return list(EXPERIMENTS.values()) if name == "all" else [EXPERIMENTS[name]]
