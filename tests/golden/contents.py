"""What the golden files hold, spelled out without any random generator."""

from dataclasses import replace

import eutree
from eutree.interaction.making import make
from eutree.learners import PAPER, PlanningMethod
from eutree.policy_search.planner import Planner
from eutree.schema import EnvironmentSpec
from eutree_lab.paper.runs import Performance, Point, RunRecord, RunSpec
from tests.data.journals import journal_of
from tests.data.strategies import three_episodes
from tests.policies.small import small_policy


def policy():
    return small_policy()


def demonstrations():
    return three_episodes(EnvironmentSpec("eutree/Evasion2-v0", {"opponent_speed": 2.5}))


def write_journal(path):
    journal_of(three_episodes().episodes[1], path).close()


# Every number that a preset might change one day is written out.
_PLANNED = PlanningMethod(planner=Planner(n_episodes=16, growth=1.5), gathering_episodes=4)
_PAPER = replace(
    PAPER, untried_value=0.0, exploration=0.1
)  # as the preset was when these files were written
METHODS = {
    "run": _PAPER,
    "run-planned": _PLANNED,
    "run-bounded": replace(_PAPER, max_transitions=60),
    "run-planned-bounded": replace(_PLANNED, max_transitions=200),
}


def learn(name, folder, *, episodes, resume):
    """Start a run of one of the methods, or go on with it."""
    return eutree.learn(
        make(EnvironmentSpec("eutree/Evasion2-v0")),
        method=METHODS[name],
        episodes=episodes,
        evaluate_every=10,
        evaluation_episodes=2,
        seed=7,
        out=folder,
        resume=resume,
    )


def experiment_run():
    spec = RunSpec(environment="eutree/Evasion2-v0", learner="eu-tree", preset="paper", seed=3)
    return RunRecord(
        spec=spec,
        expert=Performance(0.9, 70.5, 11),
        curve=[Point(0, 0.9, 70.5, 11), Point(20, 0.95, 80.25, 14)],
        final=Performance(0.95, 80.25, 14),
        compressed=Performance(0.95, 80.25, 12),
        agreement=1.0,
    )
