"""How much is searched: the stages of the race, and how many settings go through each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from eutree_lab.paper.experiment import FULL, SMOKE, Scale
from eutree_lab.paper.search_space import DEPARTURES, STEPS
from eutree_lab.paper.settings import LOOK_AHEAD, Demonstrator, Domain, Reading, Setting


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
        wider: Settings drawn in the fifth stage, and those made from the best of them.
        asked_wider: Settings that are tried beside those drawn there.
        departures: What the nearest is changed in, one at a time.
        steps: Settings on the way from the first domain and reading to those of the preset.
        frontier: Settings made, in each round, from those nearest to agreeing in both of two
            numbers of expert trees that agreed under no setting together.
        halves: Settings whose expert trees drop to a half that are asked about other speeds.
        rungs: The stages.
        scale: Episodes of runs and evaluations.
        speeds: Opponent speeds of the expert stage.
        far: Those of the last stage.
    """

    domains: int
    neighbours: tuple[int, int]
    asked: tuple[Setting, ...] = ()
    wider: tuple[int, int] = (0, 0)
    asked_wider: tuple[Setting, ...] = ()
    departures: tuple[tuple[str, str, Any], ...] = ()
    steps: tuple[Setting, ...] = ()
    frontier: tuple[int, ...] = ()
    halves: int = 0
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

# And one with a demonstrator who sees directions, found in the same way.
ASKED_WIDER = (
    Setting(
        domain=Domain(
            time_step=0.6, collision_distance=1.5, noise=0.03, start="either end", bounce="turn"
        ),
        demonstrator=Demonstrator(rule=LOOK_AHEAD, margin=1.5),
    ),
)

# How much is learned in a stage: nothing; in 2-Evasion; in 3-Evasion too; at other speeds too.
NOTHING, IN_TWO, IN_THREE, AT_SPEEDS = range(4)
LEARNED: Mapping[str, int] = {
    "expert": NOTHING,
    "2-Evasion": IN_TWO,
    "3-Evasion": IN_THREE,
    "neighbours": IN_THREE,
    "wider": NOTHING,
    "wider, changed": NOTHING,
    "wider, learned": IN_THREE,
    "departures": IN_TWO,
    "steps": IN_TWO,
    "frontier": NOTHING,
    "frontier, learned": IN_THREE,
    "speeds": AT_SPEEDS,
}

PLAN = SearchPlan(
    asked=ASKED,
    domains=140,
    neighbours=(8, 10),
    wider=(60, 24),
    asked_wider=ASKED_WIDER,
    departures=DEPARTURES,
    steps=STEPS,
    frontier=(30, 20, 20),
    halves=4,
    rungs=(
        Rung(name="expert", keep=(36, 12), per_group=3, group=_time_step),
        Rung(name="2-Evasion", keep=(8, 5, 4), per_group=2, group=_domain),
        Rung(name="3-Evasion", keep=(4, 3)),
        Rung(name="neighbours", keep=(6, 4, 3)),
        Rung(name="wider", keep=(8,)),
        Rung(name="wider, changed", keep=(5, 3)),
        Rung(name="wider, learned", keep=(3, 2)),
        Rung(name="departures", keep=(8, 8)),
        Rung(name="steps", keep=(len(STEPS), len(STEPS))),
        Rung(name="frontier", keep=(8, 4)),
        Rung(name="frontier, learned", keep=(4, 2)),
        Rung(name="speeds", keep=(12, 6, 3)),
    ),
    scale=replace(FULL, final_episodes=400),
)
SMOKE_PLAN = SearchPlan(
    domains=4,
    neighbours=(1, 1),
    wider=(2, 1),
    departures=DEPARTURES[:1],
    steps=STEPS[:2],
    frontier=(1, 1),
    halves=1,
    rungs=(
        Rung(name="expert", keep=(2, 1)),
        Rung(name="2-Evasion", keep=(2,)),
        Rung(name="3-Evasion", keep=(1,)),
        Rung(name="neighbours", keep=(1,)),
        Rung(name="wider", keep=(1,)),
        Rung(name="wider, changed", keep=(1,)),
        Rung(name="wider, learned", keep=(1,)),
        Rung(name="departures", keep=(1,)),
        Rung(name="steps", keep=(len(STEPS),)),
        Rung(name="frontier", keep=(1,)),
        Rung(name="frontier, learned", keep=(1,)),
        Rung(name="speeds", keep=(1, 1)),
    ),
    scale=SMOKE,
)
