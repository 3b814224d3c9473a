"""Two claims made in the text alone: the expert tree is perfect, compression halves the tree."""

from collections.abc import Sequence

import numpy as np

from eutree_lab.paper.claims import Claim, judged
from eutree_lab.paper.experiment import Experiment, ExperimentScale, Records
from eutree_lab.paper.runs import RunSpec
from eutree_lab.statistics import bootstrap

DOMAINS = {2: "2-Evasion", 3: "3-Evasion"}
LEARNERS = ("c-u-tree", "eu-tree")


def expert_specs(scale: ExperimentScale, preset: str) -> list[RunSpec]:
    """Return the expert trees of both domains in their own domain."""
    return _in_both_domains(("expert",), scale, preset)


def judge_expert(records: Records) -> list[Claim]:
    """Return the claim that expert trees complete all trials without collisions."""
    return [
        judged(
            f"expert/perfect-in-{name.lower()}",
            f"The expert tree performs perfectly in {name}, completing all trials without "
            "collisions.",
            paper="1",
            estimate=bootstrap(
                [r.final.success for r in records if f"Evasion{count}-" in r.spec.environment]
            ),
            low=0.995,
            rule="success rate, at least 99.5 %",
        )
        for count, name in DOMAINS.items()
    ]


def compression_specs(scale: ExperimentScale, preset: str) -> list[RunSpec]:
    """Return the learned trees that are compressed: those of Figures 2 and 3."""
    return _in_both_domains(LEARNERS, scale, preset)


def _in_both_domains(learners: Sequence[str], scale: ExperimentScale, preset: str) -> list[RunSpec]:
    return [
        scale.spec(scale.environment(count), learner, preset, run)
        for count in DOMAINS
        for learner in learners
        for run in range(scale.runs)
    ]


def judge_compression(records: Records) -> list[Claim]:
    """Return the claims about tree compression, over all learned trees."""
    pairs = [(r.final, r.compressed) for r in records if r.compressed is not None]
    ratio = [after.n_leaves / before.n_leaves for before, after in pairs]
    change = [after.success - before.success for before, after in pairs]
    grown = [float(after.n_leaves <= before.n_leaves) for before, after in pairs]
    return [
        judged(
            "compression/less-than-half",
            "The number of states is systematically reduced to less than half the size.",
            paper="< 0.5",
            estimate=bootstrap(ratio),
            high=0.5,
            rule="leaves after over leaves before, mean over trees, below a half",
        ),
        judged(
            "compression/no-loss",
            "... without loss of performance.",
            paper="0",
            estimate=bootstrap(change),
            low=-0.02,
            rule="change of success, mean over trees, above -0.02",
        ),
        judged(
            "compression/never-larger",
            "At worst it maintains the same number of states.",
            paper="1",
            estimate=bootstrap(grown),
            low=1.0,
            rule="share of trees that did not grow, all",
        ),
        judged(
            "compression/same-mapping",
            "The observation-action mapping is maintained on the recorded observations.",
            paper="1",
            estimate=bootstrap(np.array([r.agreement for r in records if r.agreement is not None])),
            low=1.0,
            rule="share of recorded observations with the same action, all",
        ),
    ]


EXPERT = Experiment(
    id="expert",
    title="The expert tree in its own domain",
    specs=expert_specs,
    judge=judge_expert,
)
COMPRESSION = Experiment(
    id="compression",
    title="Tree compression by C4.5",
    specs=compression_specs,
    judge=judge_compression,
)
