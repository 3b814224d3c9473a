"""The search for the domain and the reading in which the paper's numbers come out.

Settings race: many are screened cheaply, those clearly worse are dropped, and what is saved goes
into more seeds and more learners for those that stay (successive halving: K. Jamieson, A.
Talwalkar, *Non-stochastic best arm identification and hyperparameter optimization*, AISTATS 2016).

1. *expert*: domains and demonstrators, by the expert trees alone, which cost no learning.
2. *2-Evasion*: the best of each time step, in each corner reading, with the three learners.
3. *3-Evasion*: the same learners there too.
4. *neighbours*: the nearest with a choice or two changed, what else a reading has included; then
   the nearest of those with finer changes.
5. *wider*: more domains and demonstrators by their expert trees alone: crossings elsewhere, and a
   demonstrator who sees where opponents are heading, as a person who watches does; the best of
   them are changed a little, then learned in.
6. *departures*: the nearest so far with one more choice changed: what the stages before did not
   vary, the agent's speed that the paper states, and persons' demonstrations.
7. *steps*: from the first domain and reading to the preset ``paper``, one change after another.
8. *frontier*: domains and demonstrators between those whose expert tree drops to a half with fast
   opponents and those whose expert tree is perfect in 3-Evasion; the best are learned in.
9. *speeds*: the last few at other opponent speeds, the preset ``paper``, and some whose expert
   trees drop to a half.

Every run is a document in a folder of results, and what is run next follows from the documents
alone: after an interruption the same call goes on with what is missing. The seeds are none that a
claim is judged on.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree_lab.paper.figure_2_3 import LEARNERS
from eutree_lab.paper.finals import FINALS
from eutree_lab.paper.objective import Distance, distance, nearest, shortened
from eutree_lab.paper.results import Results
from eutree_lab.paper.runs import RunRecord, RunSpec
from eutree_lab.paper.search_plan import (
    AT_SPEEDS,
    IN_TWO,
    LEARNED,
    NOTHING,
    PLAN,
    Rung,
    SearchPlan,
)
from eutree_lab.paper.search_space import (
    COARSE,
    FINE,
    NARROW,
    WIDE,
    Spaces,
    drawn,
    mutated,
    with_choice,
)
from eutree_lab.paper.settings import (
    LABEL,
    SPLITS,
    Demonstrator,
    Domain,
    Reading,
    Setting,
)

FIRST_SEED = 7000  # of the search; claims are judged on others
TWO, THREE = "eutree/Evasion2-v0", "eutree/Evasion3-v0"
PRESET = "paper"  # whose reading every setting spells out

HALF = "expert tree: success at 4.2 m/s"
# Under no setting of the first searches did an expert tree do both; between them lies the frontier.
FRONTIER = (HALF, "expert tree: success in 3-Evasion")
LEAST_SEEDS = 3  # a standard error of two seeds says little
# With labels, as without them the two EU-Trees begin apart; neighbours try that too.
CORNERS = tuple(Reading(untried=LABEL, split=split, exploration=0.1) for split in SPLITS)


@dataclass(frozen=True)
class Scored:
    """What is known of a setting.

    Attributes:
        setting: The setting.
        stage: The last stage that it was run in.
        runs: How many runs that took.
        final: The rule for final policies under which it is nearest to the paper.
        distance: How near.
        shorter: How near it is if its runs end after so many episodes, for those that learned.
        under: How near it is under each rule for final policies.
        changed_from: The setting that this one is a departure from.
    """

    setting: Setting
    stage: str
    runs: int
    final: str
    distance: Distance
    shorter: Mapping[int, Distance] = field(default_factory=dict)
    under: Mapping[str, Distance] = field(default_factory=dict)
    changed_from: Setting | None = None


class Search:
    """One search in a folder of results.

    Args:
        folder: Results; runs that are there are not done again.
        plan: How much.
        demonstrations: Folders of persons' demonstrations of 2-Evasion; each is tried in the
            domain in which it was recorded, in the nearest reading.
        n_jobs: Processes, as joblib counts them.
        on_run: Called after each run with the stage, how many of its runs are done and wanted.
    """

    def __init__(
        self,
        folder: str | Path,
        *,
        plan: SearchPlan = PLAN,
        demonstrations: Sequence[str | Path] = (),
        n_jobs: int = 1,
        on_run: Callable[[str, int, int], None] = lambda stage, count, total: None,
    ) -> None:
        self.plan = plan
        self._results = Results(folder)
        self._people = [recorded_setting(path) for path in demonstrations]
        self._n_jobs = n_jobs
        self._on_run = on_run
        self._generator = np.random.default_rng(FIRST_SEED)
        self._wide_generator = np.random.default_rng((FIRST_SEED, 1))
        self._frontier_generator = np.random.default_rng((FIRST_SEED, 2))
        self._records: dict[Setting, dict[RunSpec, RunRecord]] = {}
        self._stages: dict[Setting, str] = {}
        self._changed_from: dict[Setting, Setting] = {}

    def run(self) -> list[Scored]:
        """Search, and return every setting that was tried, the nearest of the last stage first."""
        rungs = {rung.name: rung for rung in self.plan.rungs}
        shown = self._race(rungs["expert"], self._first())
        read = [replace(s, reading=reading) for s in shown for reading in CORNERS]
        self._inherit(read)
        near = self._race(rungs["3-Evasion"], self._race(rungs["2-Evasion"], read))
        for count, spaces in zip(self.plan.neighbours, (COARSE, FINE), strict=True):
            changed = self._changed(near, count, spaces, self._generator)
            if spaces is FINE:
                changed = [*self.plan.asked, *changed]
            self._inherit(changed)
            near = self._race(rungs["neighbours"], [*near, *changed])
        wider = self._wider(near, rungs)
        self._race(rungs["departures"], self._departures(near[0]))
        self._inherit(self.plan.steps)
        self._race(rungs["steps"], self.plan.steps)
        between = self._frontier(near[0], rungs)
        preset = self.plan.steps[-1:]
        last = [*near, *wider, *between, *preset, *self._halves()]
        best = self._race(rungs["speeds"], last)
        return self._ranking(best)

    @property
    def n_runs(self) -> int:
        """Return how many runs the settings took; several settings share those of expert trees."""
        return len({spec for records in self._records.values() for spec in records})

    def _first(self) -> list[Setting]:
        """Return the domains and demonstrators to screen: random ones, and those in use."""
        generator = self._generator
        found = {Setting(): None}
        while len(found) < self.plan.domains:
            found[drawn(generator, COARSE)] = None
        return list(found)

    def _changed(
        self,
        near: Sequence[Setting],
        count: int,
        spaces: Spaces,
        generator: np.random.Generator,
    ) -> list[Setting]:
        """Return settings that differ from one of these by one or two choices."""
        found: dict[Setting, None] = {}
        for number in range(20 * count):
            changed = near[number % len(near)]
            for _ in range(int(generator.integers(1, 3))):
                changed = mutated(changed, generator, spaces)
            if changed not in self._records:
                found[changed] = None
            if len(found) == count:
                break
        return list(found)

    def _wider(self, near: Sequence[Setting], rungs: Mapping[str, Rung]) -> list[Setting]:
        """Return the best of wider domains and demonstrators, in the nearest reading."""
        n_drawn, count = self.plan.wider
        generator = self._wide_generator
        first = [*self.plan.asked_wider, *(drawn(generator, WIDE) for _ in range(n_drawn))]
        shown = self._race(rungs["wider"], first)
        changed = self._changed(shown, count, WIDE, generator)
        shown = self._race(rungs["wider, changed"], [*shown, *changed])
        read = [replace(s, reading=near[0].reading) for s in shown]
        self._inherit(read)
        return self._race(rungs["wider, learned"], read)

    def _departures(self, nearest: Setting) -> list[Setting]:
        """Return the nearest setting with one choice changed, and those of persons."""
        changed = [with_choice(nearest, *departure) for departure in self.plan.departures]
        people = [replace(person, reading=nearest.reading) for person in self._people]
        self._inherit([*changed, *people])
        found = [setting for setting in (*changed, *people) if setting != nearest]
        self._changed_from = dict.fromkeys(found, nearest)
        return found

    def _frontier(self, nearest: Setting, rungs: Mapping[str, Rung]) -> list[Setting]:
        """Return the best of those nearest to both numbers, in the nearest reading."""
        rung = rungs["frontier"]
        for count in self.plan.frontier:
            shown = self._between()[: rung.keep[0]]
            changed = self._changed(shown, count, NARROW, self._frontier_generator)
            self._run(rung.name, changed, 0)
        for number, keep in enumerate(rung.keep):
            self._run(rung.name, self._between()[:keep], number)
        read = [replace(s, reading=nearest.reading) for s in self._between()[: rung.keep[-1]]]
        self._inherit(read)
        return self._race(rungs["frontier, learned"], read)

    def _between(self) -> list[Setting]:
        """Return domains and demonstrators, those first that are nearest to both numbers."""
        plain = [s for s in self._stages if s.reading is None and not s.demonstrator.folder]
        return sorted(plain, key=self._miss_of_both)

    def _miss_of_both(self, setting: Setting) -> float:
        costs = nearest(self._of(setting))[1].costs
        return sum(costs[name] for name in FRONTIER)

    def _halves(self) -> list[Setting]:
        """Return the nearest settings that learned and whose expert trees drop to a half."""
        learned = [s for s in self._stages if s.reading is not None and not s.demonstrator.folder]
        found = [s for s in learned if nearest(self._of(s))[1].costs.get(HALF) == 0.0]
        return sorted(found, key=self._miss)[: self.plan.halves]

    def _inherit(self, settings: Iterable[Setting]) -> None:
        """Let settings have the runs of expert trees of their domain, whatever the reading."""
        for setting in settings:
            if setting not in self._records:
                plain = replace(setting, reading=None)
                self._records[setting] = dict(self._records.get(plain, {}))

    def _race(self, rung: Rung, settings: Sequence[Setting]) -> list[Setting]:
        """Run settings on one seed after the other, and drop the worse after each."""
        alive = list(dict.fromkeys(settings))
        for number, keep in enumerate(rung.keep):
            self._run(rung.name, alive, number)
            alive = self._not_clearly_worse(alive, FIRST_SEED + number)
            alive = _kept(sorted(alive, key=self._miss), keep, rung)
        return alive

    def _run(self, stage: str, settings: Sequence[Setting], number: int) -> None:
        """Do the runs of a stage on one seed."""
        wanted = {s: specs_of(self.plan, stage, s, number) for s in settings}
        every = [spec for specs in wanted.values() for spec in specs]
        total = len(set(every))
        self._results.complete(
            every, n_jobs=self._n_jobs, on_run=lambda count, spec: self._on_run(stage, count, total)
        )
        for setting, specs in wanted.items():
            known = self._records.setdefault(setting, {})
            new = [spec for spec in specs if spec not in known]
            known.update(zip(new, self._results.load(new), strict=True))
            self._stages[setting] = stage

    def _not_clearly_worse(self, settings: Sequence[Setting], last_seed: int) -> list[Setting]:
        """Drop those whose distance is above the leader's by two standard errors, seed by seed."""
        seeds = range(FIRST_SEED, last_seed + 1)
        if len(seeds) < LEAST_SEEDS:
            return list(settings)
        leader = min(settings, key=self._miss)
        of_leader = self._by_seed(leader, seeds)
        kept = []
        for setting in settings:
            behind = self._by_seed(setting, seeds) - of_leader
            error = float(behind.std(ddof=1)) / np.sqrt(len(behind))
            if setting == leader or behind.mean() <= 2.0 * error:
                kept.append(setting)
        return kept

    def _by_seed(self, setting: Setting, seeds: range) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return the distance on each seed alone, under the rule that is best on all."""
        final, _ = nearest(self._of(setting))
        return np.array(
            [
                distance([r for r in self._of(setting) if r.spec.seed == seed], final).mean
                for seed in seeds
            ]
        )

    def _of(self, setting: Setting) -> list[RunRecord]:
        return list(self._records[setting].values())

    def _miss(self, setting: Setting) -> float:
        return nearest(self._of(setting))[1].mean

    def _ranking(self, best: Sequence[Setting]) -> list[Scored]:
        """Return all settings, those that got furthest first, the nearest first among them."""
        scored = [
            Scored(
                s,
                stage,
                len(self._records[s]),
                *nearest(self._of(s)),
                shorter=_shorter(self._of(s), self.plan.scale.episodes) if s.reading else {},
                under={rule: distance(self._of(s), rule) for rule in FINALS},
                changed_from=self._changed_from.get(s),
            )
            for s, stage in self._stages.items()
        ]
        return sorted(
            scored,
            key=lambda s: (s.setting not in best, -LEARNED[s.stage], s.distance.mean),
        )


def recorded_setting(folder: str | Path) -> Setting:
    """Return the setting of a person's demonstrations: the domain in which they were recorded.

    Raises:
        InvalidArgumentError: They are of no domain with two opponents.
    """
    environment = Demonstrations.load(folder).environment
    if environment is None or "Evasion2" not in environment.id:
        raise InvalidArgumentError(
            f"demonstrations must be of 2-Evasion, {folder} has those of {environment}"
        )
    stated = gymnasium.spec(environment.id).kwargs | dict(environment.arguments)
    known = {field.name for field in fields(Domain)}
    domain = Domain(**{name: value for name, value in stated.items() if name in known})
    return Setting(domain=domain, demonstrator=Demonstrator.recorded(folder))


def specs_of(plan: SearchPlan, stage: str, setting: Setting, number: int) -> list[RunSpec]:
    """Return the runs of a setting in a stage, with those of the stages before it, on one seed."""
    scale = replace(plan.scale, first_seed=FIRST_SEED + number, setting=setting)
    plain = replace(scale, setting=replace(setting, reading=None))
    is_person = bool(setting.demonstrator.folder)  # who showed 2-Evasion alone
    specs = [plain.spec(TWO, "expert", "", 0, v) for v in (3.2, *plan.speeds)]
    if not is_person:
        specs.append(plain.spec(THREE, "expert", "", 0))
    learned = LEARNED[stage]
    if learned == NOTHING:
        return specs
    specs += [scale.spec(TWO, learner, PRESET, 0) for learner in LEARNERS]
    if learned == IN_TWO or is_person:
        return specs
    specs += [scale.spec(THREE, learner, PRESET, 0) for learner in LEARNERS]
    if learned == AT_SPEEDS:
        specs += [scale.spec(TWO, "eu-tree", PRESET, 0, v) for v in plan.far]
    return specs


def _kept(ranked: Sequence[Setting], keep: int, rung: Rung) -> list[Setting]:
    """Return the first few, no more of a group than may stay."""
    if rung.per_group is None:
        return list(ranked[:keep])
    counts: dict[Any, int] = {}
    kept = []
    for setting in ranked:
        key = rung.group(setting)
        counts[key] = counts.get(key, 0) + 1
        # The last seed's limit; before it, in proportion to how many stay.
        limit = -(-rung.per_group * keep // rung.keep[-1])
        if counts[key] <= limit:
            kept.append(setting)
    return kept[:keep]


def _shorter(records: Sequence[RunRecord], whole: int) -> dict[int, Distance]:
    """Return how near a setting is if its runs of ``whole`` episodes are shorter by quarters."""
    shares = (whole // 4, whole // 2, 3 * whole // 4)
    return {
        episodes: nearest([shortened(record, episodes) for record in records])[1]
        for episodes in shares
    }
