"""The search for the domain and the reading in which the paper's numbers come out.

Settings race: many are screened cheaply, those clearly worse are dropped, and what is saved goes
into more seeds and more learners for those that stay (successive halving: K. Jamieson, A.
Talwalkar, *Non-stochastic best arm identification and hyperparameter optimization*, AISTATS 2016).

1. *expert*: domains and demonstrators, by the expert trees alone, which cost no learning.
2. *2-Evasion*: the best of each time step, in each corner reading, with the three learners.
3. *3-Evasion*: the same learners there too.
4. *neighbours*: the nearest with a choice or two changed, what else a reading has included; then
   the nearest of those with finer changes.
5. *speeds*: the last few, on more seeds and at other opponent speeds.

Every run is a document in a folder of results, and what is run next follows from the documents
alone: after an interruption the same call goes on with what is missing. The seeds are none that a
claim is judged on.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from eutree.experiments.experiment import FULL, SMOKE, Scale
from eutree.experiments.figure_2_3 import LEARNERS
from eutree.experiments.objective import Distance, distance, nearest
from eutree.experiments.results import Results
from eutree.experiments.runs import RunRecord, RunSpec
from eutree.experiments.settings import LABEL, SPLITS, ZERO, Demonstrator, Domain, Reading, Setting

FIRST_SEED = 7000  # of the search; claims are judged on others
TWO, THREE = "eutree/Evasion2-v0", "eutree/Evasion3-v0"
PRESET = "paper"  # whose reading every setting spells out

DOMAINS: Mapping[str, tuple[Any, ...]] = {
    "time_step": (0.5, 1.0, 1.5, 2.0, 3.0),
    "collision_distance": (1.0, 1.5, 2.0, 2.5, 3.0),
    "noise": (0.01, 0.02, 0.05, 0.1),
    "start": ("anywhere", "either end", "same end"),
    "bounce": ("reflect", "turn"),
}
DEMONSTRATORS: Mapping[str, tuple[Any, ...]] = {"wait_distance": (5.5, 6.5, 7.5, 8.5, 9.5, 10.5)}
READINGS: Mapping[str, tuple[Any, ...]] = {
    "untried": (LABEL, ZERO),
    "split": tuple(SPLITS),
    "compare": ("pooled", "action"),
    "min_leaf": (1, 5, 10),
    "gathering_episodes": (10, 20, 40),
    "exploration": (0.05, 0.1, 0.2),
    "discount": (0.9, 0.99, 1.0),
}
FINER: Mapping[str, tuple[Any, ...]] = {
    **DOMAINS,
    "time_step": (0.5, 0.6, 0.75, 0.9, 1.0, 1.25, 1.5),
    "collision_distance": (0.75, 1.0, 1.25, 1.5, 1.75, 2.0),
    "noise": (0.01, 0.02, 0.03, 0.05, 0.07, 0.1),
}
FINER_DEMONSTRATORS: Mapping[str, tuple[Any, ...]] = {
    "wait_distance": (6.5, 7.5, 8.5, 9.0, 9.5, 10.0, 10.5)
}
LEAST_SEEDS = 3  # a standard error of two seeds says little
# With labels, as without them the two EU-Trees begin apart; neighbours try that too.
CORNERS = tuple(Reading(untried=LABEL, split=split, exploration=0.1) for split in SPLITS)


@dataclass(frozen=True, kw_only=True)
class Rung:
    """One stage of the race.

    Attributes:
        name: What is run.
        keep: How many settings stay after each seed.
        per_group: Most that stay of those that share what ``group`` returns; None for no limit.
        group: What settings are alike by.
    """

    name: str
    keep: tuple[int, ...]
    per_group: int | None = None
    group: Callable[[Setting], Any] = lambda setting: None


@dataclass(frozen=True, kw_only=True)
class SearchPlan:
    """How much is searched.

    Attributes:
        domains: Domains and demonstrators drawn.
        neighbours: Settings made from the nearest, in each round of the fourth stage.
        asked: Settings that are tried beside those of the second round.
        rungs: The stages.
        scale: Episodes of runs and evaluations.
        speeds: Opponent speeds of the expert stage.
        far: Those of the last stage.
    """

    domains: int
    neighbours: tuple[int, int]
    asked: tuple[Setting, ...] = ()
    rungs: tuple[Rung, ...]
    scale: Scale
    speeds: tuple[float, ...] = (2.2, 2.7, 4.2)
    far: tuple[float, ...] = (2.2, 3.7, 4.2)


def _time_step(setting: Setting) -> float:
    return setting.domain.time_step


def _domain(setting: Setting) -> tuple[Domain, Demonstrator]:
    return setting.domain, setting.demonstrator


# Two domains between those drawn, in which expert trees do what the paper's did: found by looking
# at expert trees alone, at the seeds of the search.
_AT_ENDS = Domain(time_step=0.75, collision_distance=1.0, noise=0.05, start="either end")
ASKED = (
    Setting(
        domain=_AT_ENDS,
        demonstrator=Demonstrator(wait_distance=9.5),
        reading=Reading(exploration=0.1),
    ),
    Setting(
        domain=replace(_AT_ENDS, collision_distance=2.0),
        demonstrator=Demonstrator(wait_distance=9.0),
        reading=Reading(exploration=0.1),
    ),
)

PLAN = SearchPlan(
    asked=ASKED,
    domains=140,
    neighbours=(5, 6),
    rungs=(
        Rung(name="expert", keep=(36, 9), per_group=3, group=_time_step),
        Rung(name="2-Evasion", keep=(6, 4), per_group=2, group=_domain),
        Rung(name="3-Evasion", keep=(3,)),
        Rung(name="neighbours", keep=(3, 2)),
        Rung(name="speeds", keep=(2,)),
    ),
    scale=replace(FULL, final_episodes=400),
)
SMOKE_PLAN = SearchPlan(
    domains=4,
    neighbours=(1, 1),
    rungs=(
        Rung(name="expert", keep=(2, 1)),
        Rung(name="2-Evasion", keep=(2,)),
        Rung(name="3-Evasion", keep=(1,)),
        Rung(name="neighbours", keep=(1,)),
        Rung(name="speeds", keep=(1, 1)),
    ),
    scale=SMOKE,
)


@dataclass(frozen=True)
class Scored:
    """What is known of a setting.

    Attributes:
        setting: The setting.
        stage: The last stage that it was run in.
        runs: How many runs that took.
        final: The rule for final policies under which it is nearest to the paper.
        distance: How near.
    """

    setting: Setting
    stage: str
    runs: int
    final: str
    distance: Distance


class Search:
    """One search in a folder of results.

    Args:
        folder: Results; runs that are there are not done again.
        plan: How much.
        demonstrations: Folders of persons' demonstrations of 2-Evasion, tried beside the rule.
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
        self._people = [Demonstrator.recorded(path) for path in demonstrations]
        self._n_jobs = n_jobs
        self._on_run = on_run
        self._generator = np.random.default_rng(FIRST_SEED)
        self._records: dict[Setting, dict[RunSpec, RunRecord]] = {}
        self._stages: dict[Setting, str] = {}

    def run(self) -> list[Scored]:
        """Search, and return every setting that was tried, the nearest of the last stage first."""
        expert, two, three, neighbours, speeds = self.plan.rungs
        shown = self._race(expert, self._first())
        read = [replace(s, reading=reading) for s in shown for reading in CORNERS]
        self._inherit(read)
        near = self._race(three, self._race(two, read))
        for count, finer in zip(self.plan.neighbours, (False, True), strict=True):
            changed = self._neighbours(near, count, finer=finer)
            if finer:
                changed = [*self.plan.asked, *changed]
            self._inherit(changed)
            near = self._race(neighbours, [*near, *changed])
        best = self._race(speeds, near)
        return self._ranking(best)

    @property
    def n_runs(self) -> int:
        """Return how many runs the settings took; several settings share those of expert trees."""
        return len({spec for records in self._records.values() for spec in records})

    def _first(self) -> list[Setting]:
        """Return the domains and demonstrators to screen: random ones, and those in use."""
        generator = self._generator
        found = {Setting(demonstrator=person): None for person in self._people}
        found[Setting()] = None
        while len(found) < self.plan.domains + len(self._people):
            domain = Domain(**{name: _draw(generator, of) for name, of in DOMAINS.items()})
            rule = Demonstrator(
                **{name: _draw(generator, of) for name, of in DEMONSTRATORS.items()}
            )
            found[Setting(domain=domain, demonstrator=rule)] = None
        return list(found)

    def _neighbours(self, near: Sequence[Setting], count: int, *, finer: bool) -> list[Setting]:
        """Return settings that differ from a near one by one or two choices."""
        found: dict[Setting, None] = {}
        for number in range(20 * count):
            changed = near[number % len(near)]
            for _ in range(int(self._generator.integers(1, 3))):
                changed = mutated(changed, self._generator, finer=finer)
            if changed not in self._records:
                found[changed] = None
            if len(found) == count:
                break
        return list(found)

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
        wanted = {s: self._specs(stage, s, number) for s in settings}
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

    def _specs(self, stage: str, setting: Setting, number: int) -> list[RunSpec]:
        """Return the runs of a setting in a stage, with those of the stages before it."""
        scale = replace(self.plan.scale, first_seed=FIRST_SEED + number, setting=setting)
        plain = replace(scale, setting=replace(setting, reading=None))
        is_person = bool(setting.demonstrator.folder)  # who showed 2-Evasion alone
        specs = [plain.spec(TWO, "expert", "", 0, v) for v in (3.2, *self.plan.speeds)]
        if not is_person:
            specs.append(plain.spec(THREE, "expert", "", 0))
        if stage == "expert":
            return specs
        specs += [scale.spec(TWO, learner, PRESET, 0) for learner in LEARNERS]
        if stage == "2-Evasion" or is_person:
            return specs
        specs += [scale.spec(THREE, learner, PRESET, 0) for learner in LEARNERS]
        if stage == "speeds":
            specs += [scale.spec(TWO, "eu-tree", PRESET, 0, v) for v in self.plan.far]
        return specs

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
        order = [rung.name for rung in self.plan.rungs]
        scored = [
            Scored(s, stage, len(self._records[s]), *nearest(self._of(s)))
            for s, stage in self._stages.items()
        ]
        return sorted(
            scored,
            key=lambda s: (s.setting not in best, -order.index(s.stage), s.distance.total),
        )


def mutated(setting: Setting, generator: np.random.Generator, *, finer: bool = False) -> Setting:
    """Return the setting with one choice changed to another of its values."""
    parts = {"domain": DOMAINS, "demonstrator": DEMONSTRATORS, "reading": READINGS}
    if finer:
        parts |= {"domain": FINER, "demonstrator": FINER_DEMONSTRATORS}
    if setting.demonstrator.folder:
        del parts["domain"], parts["demonstrator"]
    if setting.reading is None:
        del parts["reading"]
    choices = [(part, name) for part, space in parts.items() for name in space]
    part, name = choices[int(generator.integers(len(choices)))]
    before = getattr(setting, part)
    others = [value for value in parts[part][name] if value != getattr(before, name)]
    return replace(setting, **{part: replace(before, **{name: _draw(generator, others)})})


def choices_of(setting: Setting) -> dict[str, Any]:
    """Return the choices of a setting by name; those of the reading are missing without one."""
    found = asdict(setting.domain) | asdict(setting.demonstrator)
    return found | (asdict(setting.reading) if setting.reading is not None else {})


CHOICES = tuple(f.name for part in (Domain, Demonstrator, Reading) for f in fields(part))


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


def _draw(generator: np.random.Generator, values: Sequence[Any]) -> Any:
    return values[int(generator.integers(len(values)))]
