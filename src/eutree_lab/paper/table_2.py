"""Table 2: states and reward of the expert tree, the C. U-Tree and the EU-Tree in 2-Evasion.

A run's *final policy* is chosen as in ``eutree_lab.paper.finals``. The other reading, the policies
after equally many episodes, is claimed too.
"""

import numpy as np

from eutree.arrays import Integers
from eutree.evaluation import Estimate
from eutree_lab.paper.claims import Claim, claimed, close_to
from eutree_lab.paper.experiment import Experiment, ExperimentScale, Records, by_learner
from eutree_lab.paper.figure_2_3 import final, specs
from eutree_lab.paper.runs import Performance, RunRecord, RunSpec
from eutree_lab.statistics import bootstrap, bootstrap_rows

# (states, average reward per trial) of each row, and how near ours must be to say "the same"
PAPER = {"Expert tree": (9, 82), "C. U-Tree": (167, 50), "EU-Tree": (30, 80)}
NEAR_STATES = {"Expert tree": 2, "C. U-Tree": 50, "EU-Tree": 10}
NEAR_REWARD = 5.0


def judge(records: Records) -> list[Claim]:
    """Return Table 2's six numbers, and the order of its rows."""
    rows = table(records)
    claims = []
    for name, (states, reward) in PAPER.items():
        key = name.lower().replace(". ", "-").replace(" ", "-")
        claims.append(
            close_to(
                f"table-2/{key}/states",
                f"{name}: number of states.",
                number=states,
                estimate=bootstrap([p.n_leaves for p in rows[name]]),
                tolerance=NEAR_STATES[name],
            )
        )
        claims.append(
            close_to(
                f"table-2/{key}/reward",
                f"{name}: average reward per trial.",
                number=reward,
                estimate=bootstrap([p.mean_return for p in rows[name]]),
                tolerance=NEAR_REWARD,
            )
        )
    groups = by_learner(records)
    at_the_end = _ratio(
        _states([record.final for record in groups["c-u-tree"]]),
        _states([record.final for record in groups["eu-tree"]]),
    )
    return [*claims, *_orders(rows), claimed("table-2/far-more-states-at-the-end", at_the_end)]


def _states(row: list[Performance]) -> Integers:
    return np.array([performance.n_leaves for performance in row])


def table(records: Records) -> dict[str, list[Performance]]:
    """Return the final policies of each row of the table, one for each run."""
    groups = by_learner(records)
    return {
        "Expert tree": [_expert(record) for record in groups["eu-tree"]],
        "C. U-Tree": [final(record) for record in groups["c-u-tree"]],
        "EU-Tree": [final(record) for record in groups["eu-tree"]],
    }


def _expert(record: RunRecord) -> Performance:
    if record.expert is None:
        raise TypeError(f"{record.spec.name} has no expert tree")
    return record.expert


def _orders(rows: dict[str, list[Performance]]) -> list[Claim]:
    states = {name: _states(row) for name, row in rows.items()}
    reward = {name: np.array([p.mean_return for p in row]) for name, row in rows.items()}
    return [
        claimed("table-2/far-more-states", _ratio(states["C. U-Tree"], states["EU-Tree"])),
        claimed("table-2/poorer-performance", bootstrap(reward["EU-Tree"] - reward["C. U-Tree"])),
        claimed(
            "table-2/expert-best-by-a-small-margin",
            bootstrap(reward["Expert tree"] - reward["EU-Tree"]),
        ),
        claimed(
            "table-2/expert-smallest",
            bootstrap((states["EU-Tree"] - states["Expert tree"]).astype(np.float64)),
        ),
    ]


def _ratio(first: Integers, second: Integers) -> Estimate:
    """Return the ratio of two means over runs with its bootstrap interval; runs are paired."""
    return bootstrap_rows(
        lambda rows: first[rows].mean(axis=1) / second[rows].mean(axis=1), first.size
    )


def table_2_specs(scale: ExperimentScale, preset: str) -> list[RunSpec]:
    """Return the runs of Figure 2, which the table reads too."""
    return specs(2, scale, preset)


TABLE_2 = Experiment(
    id="table-2",
    title="Table 2: number of states and average reward in 2-Evasion",
    specs=table_2_specs,
    judge=judge,
)
