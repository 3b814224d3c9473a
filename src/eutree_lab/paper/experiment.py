"""An experiment is three answers, as data: its runs, how they are judged, how they are drawn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from eutree_lab.paper.claims import Claim
from eutree_lab.paper.runs import RunRecord, RunSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Records = Sequence[RunRecord]


@dataclass(frozen=True, kw_only=True)
class ExperimentScale:
    """How much of an experiment is run.

    Attributes:
        runs: Runs of each learner (the paper: 15).
        episodes: Episodes of each run.
        evaluate_every: Episodes between two evaluations (the paper: 20).
        evaluation_episodes: Episodes of each evaluation (the paper: 100).
        final_episodes: Episodes of the evaluation of a final policy.
        speeds: Opponent speeds in m/s (the paper: 2.2 to 4.2 in steps of 0.1).
        first_seed: Seed of the first run.
        domain: ``"PaperEvasion"``, the constants in which most of the paper is true, or
            ``"Evasion"``, in which things were measured before those were found.
        smoke: Whether it only shows that everything works.
    """

    runs: int = 15
    episodes: int = 400
    evaluate_every: int = 20
    evaluation_episodes: int = 100
    final_episodes: int = 1000
    speeds: tuple[float, ...] = tuple(round(2.2 + 0.1 * i, 1) for i in range(21))
    first_seed: int = 0
    domain: str = "PaperEvasion"
    smoke: bool = False

    def environment(self, opponents: int) -> str:
        """Return the id of the domain with two or three opponents."""
        return f"eutree/{self.domain}{opponents}-v0"

    def spec(
        self, environment: str, learner: str, preset: str, run: int, speed: float = 3.2
    ) -> RunSpec:
        """Return one run at this scale."""
        learns = learner != "expert"
        return RunSpec(
            environment=environment,
            learner=learner,
            preset=preset if learns else "",
            opponent_speed=speed,
            episodes=self.episodes if learns else 0,
            evaluate_every=self.evaluate_every if learns else 0,
            evaluation_episodes=self.evaluation_episodes if learns else 0,
            final_episodes=self.final_episodes,
            seed=self.first_seed + run,
        )


FULL = ExperimentScale()
SMOKE = ExperimentScale(
    runs=3,
    episodes=20,
    evaluate_every=10,
    evaluation_episodes=10,
    final_episodes=20,
    speeds=(2.2, 3.2, 4.2),
    smoke=True,
)


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A result of the paper.

    Attributes:
        id: Its name, after the figure or table.
        title: Heading of its figure or table.
        specs: The runs that it needs, at a scale and under a preset.
        judge: The claims, from its records under a preset.
        draw: Draws the panel of a preset from its records; None where there is no figure.
    """

    id: str
    title: str
    specs: Callable[[ExperimentScale, str], list[RunSpec]]
    judge: Callable[[Records], list[Claim]]
    draw: "Callable[[Axes, Records], None] | None" = None


def by_learner(records: Records) -> dict[str, list[RunRecord]]:
    """Return the records of each learner, in the order of their seeds."""
    groups: dict[str, list[RunRecord]] = {}
    for record in sorted(records, key=lambda r: (r.spec.seed, r.spec.opponent_speed)):
        groups.setdefault(record.spec.learner, []).append(record)
    return groups


def by_speed(records: Records) -> dict[float, list[RunRecord]]:
    """Return the records at each opponent speed, ascending."""
    groups: dict[float, list[RunRecord]] = {}
    for record in sorted(records, key=lambda r: (r.spec.opponent_speed, r.spec.seed)):
        groups.setdefault(record.spec.opponent_speed, []).append(record)
    return groups
