"""Two claims made in the text alone: the expert tree is perfect, compression halves the tree."""

from collections.abc import Sequence

import numpy as np

from eutree_lab.paper.claims import Claim, claimed
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
        claimed(
            f"expert/perfect-in-{name.lower()}",
            bootstrap(
                [r.final.success for r in records if f"Evasion{count}-" in r.spec.environment]
            ),
            domain=name,
            key="perfect",
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
        claimed("compression/less-than-half", bootstrap(ratio)),
        claimed("compression/no-loss", bootstrap(change)),
        claimed("compression/never-larger", bootstrap(grown)),
        claimed(
            "compression/same-mapping",
            bootstrap(np.array([r.agreement for r in records if r.agreement is not None])),
        ),
    ]


EXPERT = Experiment(
    id="expert", title="The expert tree in its own domain", specs=expert_specs, judge=judge_expert
)
COMPRESSION = Experiment(
    id="compression",
    title="Tree compression by C4.5",
    specs=compression_specs,
    judge=judge_compression,
)
