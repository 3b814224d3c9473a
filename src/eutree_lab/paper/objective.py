"""How far a setting is from the paper: the distance to every number that the paper states.

This is what the search for the domain and the reading minimizes. It was written before anything
was searched, and is a graded form of the claims: a claim holds or does not, while a search has to
see that 94 % of successes is nearer to 100 % than 65 %. The judging of claims is left to
``claims``, on other seeds.

Each number has a range in which ours agrees with the paper's and a unit, one *miss*. A number in
its range costs nothing. One outside costs a quarter, and up to three quarters more in proportion
to its misses, of which no more than three count: so a number that no setting reaches does not
outweigh those that some do.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import UNSET, structs

from eutree.evaluation import kaplan_meier, spearman
from eutree_lab.paper.figure_2_3 import durations, final, success
from eutree_lab.paper.figure_4_5 import NEAR
from eutree_lab.paper.finals import FINALS
from eutree_lab.paper.runs import DEMONSTRATED_SPEED, Performance, RunRecord

MOST_MISSES = 3.0
TWO, THREE = "2-Evasion", "3-Evasion"
DOMAINS = {"Evasion2": TWO, "Evasion3": THREE}


class MissingEvidenceError(LookupError):
    """Some number cannot be told from the runs that there are."""


class Evidence:
    """The records of one setting, by domain, learner and opponent speed.

    Args:
        records: Any runs of one setting.
        rule: Name of the rule that says which policy of a run is its final one.
    """

    def __init__(self, records: Sequence[RunRecord], rule: str) -> None:
        self._rule = rule
        self._groups: dict[tuple[str, str, float], list[RunRecord]] = {}
        for record in sorted(records, key=lambda r: r.spec.seed):
            spec = record.spec
            domain = next(name for key, name in DOMAINS.items() if key in spec.environment)
            self._groups.setdefault((domain, spec.learner, spec.opponent_speed), []).append(record)

    def runs(self, domain: str, learner: str, speed: float = DEMONSTRATED_SPEED) -> list[RunRecord]:
        """Return the runs of a learner.

        Raises:
            MissingEvidenceError: There is none.
        """
        try:
            return self._groups[domain, learner, speed]
        except KeyError:
            raise MissingEvidenceError(f"{learner} in {domain} at {speed:g} m/s") from None

    def speeds(self, learner: str) -> list[float]:
        """Return the opponent speeds at which there are runs in 2-Evasion, ascending."""
        return sorted(v for domain, name, v in self._groups if (domain, name) == (TWO, learner))

    def finals(self, domain: str, learner: str) -> list[Performance]:
        """Return the final policies of a learner's runs."""
        return [final(run, self._rule) for run in self.runs(domain, learner)]

    def expert(self, domain: str, speed: float = DEMONSTRATED_SPEED) -> list[Performance]:
        """Return the expert trees of the runs."""
        return [run.expert for run in self.runs(domain, "expert", speed) if run.expert]

    def learned(self) -> list[RunRecord]:
        """Return every run that learned a tree at the demonstrated speed."""
        return [
            run
            for (_, learner, speed), runs in self._groups.items()
            if learner in ("c-u-tree", "eu-tree") and speed == DEMONSTRATED_SPEED
            for run in runs
        ]


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number that the paper states, and when ours agrees.

    Attributes:
        name: What it is.
        paper: The paper's, as text.
        low: Least of ours that agrees.
        high: Most of ours that agrees.
        unit: One miss.
        of: Ours, from the evidence.
    """

    name: str
    paper: str
    low: float = -np.inf
    high: float = np.inf
    unit: float
    of: Callable[[Evidence], float]


@dataclass(frozen=True)
class Distance:
    """How far the numbers of a setting are from the paper's.

    Attributes:
        ours: Our numbers, those that there is evidence for.
        costs: What each costs, from 0 (agrees) to 1.
    """

    ours: Mapping[str, float]
    costs: Mapping[str, float]

    @property
    def total(self) -> float:
        """The sum of the costs."""
        return sum(self.costs.values())

    @property
    def mean(self) -> float:
        """The mean of the costs: what the search minimizes; it knows of some numbers only."""
        return self.total / max(len(self.costs), 1)

    @property
    def n_agreeing(self) -> int:
        """How many numbers agree."""
        return sum(cost == 0.0 for cost in self.costs.values())


def distance(
    records: Sequence[RunRecord], rule: str, numbers: Sequence[Number] | None = None
) -> Distance:
    """Return how far the records of a setting are from the paper.

    Args:
        records: Runs of one setting; a number that they cannot tell is left out.
        rule: Name of the rule that says which policy of a run is its final one.
        numbers: Which; all by default.
    """
    evidence = Evidence(records, rule)
    ours, costs = {}, {}
    for number in NUMBERS if numbers is None else numbers:
        try:
            value = float(number.of(evidence))
        except MissingEvidenceError:
            continue
        ours[number.name], costs[number.name] = value, cost(number, value)
    return Distance(ours, costs)


def nearest(records: Sequence[RunRecord]) -> tuple[str, Distance]:
    """Return the rule for final policies under which the records are nearest, and how near."""
    found = {rule: distance(records, rule) for rule in FINALS}
    best = min(found, key=lambda rule: found[rule].mean)
    return best, found[best]


def shortened(record: RunRecord, episodes: int) -> RunRecord:
    """Return the record as it had been if the run had ended after so many episodes.

    No learner here looks at how long it will run, so the beginning of a run is a run; to the leaf
    if a gathering phase ends there, as a run ends with an expansion. Policies are as good as they
    were at the evaluations along it; a compressed one is not known.
    """
    curve = [point for point in record.curve if point.episode <= episodes]
    if not curve or len(curve) == len(record.curve):
        return record
    last = Performance(curve[-1].success, curve[-1].mean_return, curve[-1].n_leaves)
    return structs.replace(record, curve=curve, final=last, finals=UNSET, compressed=None)


def cost(number: Number, value: float) -> float:
    """Return what our number costs."""
    outside = max(number.low - value, value - number.high, 0.0)
    if outside == 0.0:
        return 0.0
    return 0.25 + 0.75 * min(outside / number.unit, MOST_MISSES) / MOST_MISSES


# Our numbers ------------------------------------------------------------------------------------


def _mean(policies: Sequence[Performance], field: str) -> float:
    return float(np.mean([getattr(policy, field) for policy in policies]))


def _expert(field: str, domain: str = TWO) -> Callable[[Evidence], float]:
    return lambda evidence: _mean(evidence.expert(domain), field)


def _slower(evidence: Evidence) -> float:
    slow = [v for v in evidence.speeds("expert") if v <= DEMONSTRATED_SPEED]
    if len(slow) < 2:
        raise MissingEvidenceError("the expert tree at slower speeds")
    return float(np.mean([_mean(evidence.expert(TWO, v), "success") for v in slow]))


def _final(learner: str, field: str, domain: str = TWO) -> Callable[[Evidence], float]:
    return lambda evidence: _mean(evidence.finals(domain, learner), field)


def _ratio_of_states(evidence: Evidence) -> float:
    return _final("c-u-tree", "n_leaves")(evidence) / _final("eu-tree", "n_leaves")(evidence)


def _ratio_of_states_at_the_end(evidence: Evidence) -> float:
    ends = [
        _mean([run.final for run in evidence.runs(TWO, name)], "n_leaves")
        for name in ("c-u-tree", "eu-tree")
    ]
    return ends[0] / ends[1]


def _margin(first: Callable[[Evidence], float], second: Callable[[Evidence], float]) -> (
    Callable[[Evidence], float]
):  # fmt: skip
    return lambda evidence: first(evidence) - second(evidence)


def _trials(runs: list[RunRecord]) -> float:
    """Return the mean number of episodes to the level, those that do not get there at the last."""
    return kaplan_meier(durations(runs)).restricted_mean(float(runs[0].curve[-1].episode))


def _share_of_trials(domain: str) -> Callable[[Evidence], float]:
    def share(evidence: Evidence) -> float:
        plain = _trials(evidence.runs(domain, "c-u-tree"))
        return _trials(evidence.runs(domain, "eu-tree")) / plain if plain else 1.0

    return share


def _difference(domain: str) -> Callable[[Evidence], float]:
    def difference(evidence: Evidence) -> float:
        complete, without = (evidence.runs(domain, name) for name in ("eu-tree", "eu-tree-dt"))
        return float(success(complete).mean() - success(without).mean())

    return difference


def _smallest_lead(domain: str) -> Callable[[Evidence], float]:
    def lead(evidence: Evidence) -> float:
        complete, plain = (evidence.runs(domain, name) for name in ("eu-tree", "c-u-tree"))
        return float((success(complete).mean(axis=0) - success(plain).mean(axis=0)).min())

    return lead


def _curves(evidence: Evidence) -> dict[float, float]:
    """Return the mean success along the EU-Tree's curve at each speed, of three or more."""
    speeds = evidence.speeds("eu-tree")
    if len(speeds) < 3:
        raise MissingEvidenceError("the EU-Tree at other speeds")
    return {v: float(success(evidence.runs(TWO, "eu-tree", v)).mean()) for v in speeds}


def _worst_speed(evidence: Evidence) -> float:
    plain = success(evidence.runs(TWO, "c-u-tree")).mean()
    return float(min(_curves(evidence).values()) - plain)


def _near_minus_far(evidence: Evidence) -> float:
    curves = _curves(evidence)
    near = [c for v, c in curves.items() if abs(v - DEMONSTRATED_SPEED) <= NEAR]
    far = [c for v, c in curves.items() if abs(v - DEMONSTRATED_SPEED) > NEAR]
    return float(np.mean(near) - np.mean(far))


def _time_and_quality(evidence: Evidence) -> float:
    speeds = list(_curves(evidence))
    runs = [evidence.runs(TWO, "eu-tree", v) for v in speeds]
    quality = [_mean([r.expert for r in some if r.expert], "success") for some in runs]
    times = [_trials(some) for some in runs]
    if len(set(quality)) == 1 or len(set(times)) == 1:
        return 0.0
    return float(spearman(quality, times).value)


def _compression(evidence: Evidence) -> float:
    pairs = [(r.compressed, r.final) for r in evidence.learned() if r.compressed is not None]
    if not pairs:
        raise MissingEvidenceError("compressed trees")
    return float(np.mean([after.n_leaves / before.n_leaves for after, before in pairs]))


_EXPERT_REWARD = _expert("mean_return")
_EXPERT_STATES = _expert("n_leaves")
_EU_TREE_REWARD = _final("eu-tree", "mean_return")
_C_U_TREE_REWARD = _final("c-u-tree", "mean_return")

NUMBERS: tuple[Number, ...] = (
    Number(name="expert tree: states", paper="9", low=7, high=11, unit=2, of=_EXPERT_STATES),
    Number(name="expert tree: reward", paper="82", low=77, high=87, unit=5, of=_EXPERT_REWARD),
    *(
        Number(name=f"expert tree: success in {domain}", paper="1", low=0.995, unit=0.02,
               of=_expert("success", domain))
        for domain in DOMAINS.values()
    ),
    Number(name="expert tree: success with slower opponents", paper="about 1", low=0.95, unit=0.05,
           of=_slower),
    Number(name="expert tree: success at 4.2 m/s", paper="about 0.5", low=0.4, high=0.65, unit=0.1,
           of=lambda evidence: _mean(evidence.expert(TWO, 4.2), "success")),
    Number(name="C. U-Tree: states", paper="167", low=117, high=217, unit=50,
           of=_final("c-u-tree", "n_leaves")),
    Number(name="C. U-Tree: reward", paper="50", low=45, high=55, unit=5, of=_C_U_TREE_REWARD),
    Number(name="EU-Tree: states", paper="30", low=20, high=40, unit=10,
           of=_final("eu-tree", "n_leaves")),
    Number(name="EU-Tree: reward", paper="80", low=75, high=85, unit=5, of=_EU_TREE_REWARD),
    Number(name="states, C. U-Tree over EU-Tree", paper="5.6", low=2, unit=1, of=_ratio_of_states),
    Number(name="states at the end, C. U-Tree over EU-Tree", paper="5.6", low=2, unit=1,
           of=_ratio_of_states_at_the_end),
    Number(name="reward, EU-Tree minus C. U-Tree", paper="30", low=0, unit=5,
           of=_margin(_EU_TREE_REWARD, _C_U_TREE_REWARD)),
    Number(name="reward, expert tree minus EU-Tree", paper="2", low=0, high=5, unit=5,
           of=_margin(_EXPERT_REWARD, _EU_TREE_REWARD)),
    Number(name="states, EU-Tree minus expert tree", paper="21", low=0, unit=5,
           of=_margin(_final("eu-tree", "n_leaves"), _EXPERT_STATES)),
    *(
        number
        for domain in DOMAINS.values()
        for number in (
            Number(name=f"share of trials in {domain}", paper="< 0.5", high=0.5, unit=0.25,
                   of=_share_of_trials(domain)),
            Number(name=f"EU-Tree minus EU-Tree - DT in {domain}", paper="0", low=-0.05, high=0.05,
                   unit=0.05, of=_difference(domain)),
            Number(name=f"smallest lead in {domain}", paper="> 0", low=0, unit=0.05,
                   of=_smallest_lead(domain)),
            Number(name=f"C. U-Tree: success in {domain}", paper="1", low=0.95, unit=0.05,
                   of=_final("c-u-tree", "success", domain)),
            Number(name=f"EU-Tree: success in {domain}", paper="1", low=0.95, unit=0.05,
                   of=_final("eu-tree", "success", domain)),
        )
    ),
    Number(name="curve at the worst speed minus C. U-Tree", paper=">= 0", low=-0.02, unit=0.05,
           of=_worst_speed),
    Number(name="curve near 3.2 m/s minus further away", paper="> 0", low=0, unit=0.02,
           of=_near_minus_far),
    Number(name="rank correlation of quality and time", paper="< 0", high=-0.1, unit=0.3,
           of=_time_and_quality),
    Number(name="compression", paper="< 0.5", high=0.5, unit=0.1, of=_compression),
)  # fmt: skip
