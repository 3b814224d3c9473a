"""Learning from a tree that is worse than what was shown: whose returns count, where to begin."""

from dataclasses import replace
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from benchmarks.people import TASKS, folder

import eutree
from eutree.data import Episode
from eutree.learners.learner import Problem, Start
from eutree.learners.planning import PlanningMethod
from eutree.policy_search.planner import Planned, Planner
from eutree.world_model import Transitions, leaf_node
from eutree.world_model.action_trees import packed

PLAIN = PlanningMethod(
    planner=Planner(incumbent_first=0, trust_demonstrations=True), unpruned_start=False
)


def test_incumbent_and_challenger_take_turns_until_enough_is_known_of_the_incumbent():
    plan = Planned(packed(0), challenger=packed(1), incumbent_episodes=(0, 1), demonstrations=2)
    assert not PLAIN.planner.incumbent_acts(plan)
    planner, acts = Planner(incumbent_first=3), []
    for episode in range(2, 9):
        acts.append(planner.incumbent_acts(plan))
        plan = plan.with_episode(episode, incumbent=acts[-1])
    assert acts == [True, False, True, False, True, False, False]
    assert plan.own_episodes == (2, 4, 6)
    assert plan.challenger_episodes == (3, 5, 7, 8)


def test_an_incumbent_that_was_adopted_early_has_to_prove_itself():
    """Five lucky episodes were the bar for all that came after (returns 87, of a tree worth 60)."""
    plan = Planned(
        packed(1),
        challenger=packed(0),
        incumbent_episodes=(7, 8, 9, 10, 11),
        challenger_episodes=(12, 13, 14, 15),
        demonstrations=3,
    )
    assert not Planner().incumbent_acts(plan)
    assert Planner().incumbent_acts(plan.with_episode(16))
    from_nothing = replace(plan.with_episode(16), demonstrations=0)
    assert not Planner().incumbent_acts(from_nothing)
    enough = replace(plan, incumbent_episodes=tuple(range(30)), challenger_episodes=())
    assert not Planner().incumbent_acts(enough)


@pytest.mark.parametrize(
    ("explored", "leads"),
    [((90.0,) * 6, True), ((50.0,) * 6, False), ((90.0,) * 4, False)],
)
def test_challengers_begin_from_an_explorer_that_earns_more_than_the_incumbent(explored, leads):
    """What poor teachers need made planning from good ones dearer, and no better."""
    plan = Planned(packed(0), incumbent_episodes=tuple(range(2, 12)), demonstrations=2)
    for episode in range(12, 12 + len(explored)):
        plan = plan.with_explored(episode)
    data = SimpleNamespace(episode_returns=np.array([95.0, 95.0, *[60.0] * 10, *explored]))
    assert Planner()._explorers_lead(plan, data) is leads
    assert Planner()._explorers_lead(replace(plan, demonstrations=0), data)  # from nothing


def test_what_the_tree_has_played_itself_can_be_trusted():
    """Practice hands over as demonstrations what the incumbent has played."""
    plan = Planned(
        packed(0),
        challenger=packed(1),
        incumbent_episodes=tuple(range(200)),
        demonstrations=200,
    )
    assert Planner().incumbent_acts(plan)
    assert not Planner(trust_demonstrations=True).incumbent_acts(plan)


def test_what_was_shown_is_where_the_first_planning_begins_too():
    demonstrations = folder("evasion", 35)
    expert = eutree.fit_expert_tree(demonstrations)
    assert expert.n_leaves == 1
    start = Start(expert, demonstrations.kept)
    problem = Problem(demonstrations.schema)
    assert PLAIN.start(problem, start).plan.corrected is None
    tree = PlanningMethod().start(problem, start).plan.corrected
    decided = [tree.action[leaf_node(tree, 0, seen)] for seen in demonstrations.observations]
    assert np.mean(decided == demonstrations.actions) > 0.97
    assert np.mean(demonstrations.actions == 1) < 0.9  # what the single leaf decides alike


def test_what_was_shown_is_kept_when_the_tree_made_of_it_always_fails():
    """Its failure was taken for another world, and all that the person had shown was forgotten."""
    demonstrations = folder("evasion", 111)
    learner = after(20, demonstrations, TASKS["evasion"].make())
    assert learner.plan.demonstrations == len(demonstrations.kept) == 15
    assert learner.plan.valid_from == 0


def test_what_was_shown_is_kept_where_the_person_stopped_before_the_end():
    """Thirty steps of -1 seemed a better world than the hundred that lead to the goal."""
    generator = np.random.default_rng(0)

    def walk(longest):
        places = np.cumsum(generator.uniform(0.0, 0.2, 400))
        n = min(longest, int((places < 10.0).sum()) + 1)
        return Episode(
            np.append(0.0, places[:n])[:, None], np.ones(n, dtype=np.int64), -np.ones(n),
            terminated=n < longest, truncated=False,
        )  # fmt: skip

    for longest in (30, 400):
        episodes = [walk(longest) for _ in range(10)] + [walk(400) for _ in range(12)]
        data = Transitions.of(episodes, 2)
        plan = Planned(packed(1), incumbent_episodes=tuple(range(22)), demonstrations=10)
        after = Planner().plan(plan, data, np.random.default_rng(0))
        assert (after.demonstrations, after.valid_from) == (10, 0)


def test_what_was_shown_is_forgotten_when_the_opponents_have_become_faster():
    env = gymnasium.make("eutree/Evasion2-v0")
    shown = eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=1000)
    learner = after(20, shown, gymnasium.make("eutree/Evasion2-v0", opponent_speed=4.2))
    assert learner.plan.demonstrations == 0
    assert learner.plan.valid_from == 15


def after(episodes, demonstrations, env):
    """Return the learner after so many episodes, from the tree of release 8."""
    learners = []
    eutree.learn(
        env,
        demonstrations=demonstrations,
        expert=eutree.fit_expert_tree(demonstrations),
        episodes=episodes,
        evaluate_every=episodes,
        evaluation_episodes=1,
        seed=0,
        on_progress=lambda run: learners.append(run.learner),
    )
    return learners[-1]


@pytest.mark.slow
def test_a_run_from_one_leaf_does_not_stall():
    """Five seeds: 200 episodes, where the plain method stays at its 59 %."""
    demonstrations = folder("evasion", 35)
    reached = []
    for seed in range(5):
        env = TASKS["evasion"].make()
        result = eutree.learn(
            env,
            demonstrations=demonstrations,
            episodes=200,
            evaluate_every=200,
            evaluation_episodes=1,
            seed=seed,
        )
        reached.append(eutree.evaluate(result.policy, env, episodes=200, seed=9).success_rate)
    error = np.std(reached) / np.sqrt(5)
    assert np.mean(reached) > 0.95 - 2 * error
    assert min(reached) > 0.85
