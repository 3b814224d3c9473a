"""Where nobody has shown anything, trees begin at lucky episodes, and real returns decide."""

from dataclasses import replace

import numpy as np
import pytest

import eutree
from eutree.learners import DEFAULT, Start
from eutree.policy_search.climbing import luckiest
from eutree.policy_search.planner import Planned, Planner
from eutree.world_model.action_trees import n_leaves, nested, packed
from tests.naive_world_model import act
from tests.world_model.walks import GO, STAY, Unimproved, mean_return, walks
from tests.worlds import Walk

TURNS = (1, 0.0, STAY, GO)  # goes in every other step


def planned(plan, data):
    return Planner(n_episodes=200, improvement=Unimproved()).plan(
        plan, data, np.random.default_rng(0)
    )


def mimicked(data, tree):
    """Return the episodes in which a tree would have done all that was done."""
    done = np.array([act(nested(tree), o) for o in data.observations]) == data.actions
    return {one for one in range(data.episodes[-1] + 1) if done[data.episodes == one].all()}


def test_trees_of_the_episodes_that_earned_most_are_begun_from():
    found = planned(Planned(packed(STAY)), walks(200, 7)).challenger
    assert n_leaves(found) > 1
    assert mean_return(found) > mean_return(packed(GO)) > mean_return(packed(STAY))


def test_they_are_not_where_somebody_has_shown_something():
    plan = Planned(packed(STAY), incumbent_episodes=(0, 1), demonstrations=2)
    assert planned(plan, walks(200, 7)).challenger is None


def test_a_lucky_episode_is_on_trial_where_the_model_prefers_nothing(monkeypatch):
    monkeypatch.setattr("eutree.policy_search.planner.restarts", lambda data, max_leaves: ())
    data = walks(200, 7, policy=lambda o: act(TURNS, o))
    found = planned(Planned(packed(STAY)), data).challenger
    assert n_leaves(found) == 2
    assert mimicked(data, found) & set(np.argsort(-data.episode_returns, kind="stable")[:5])


def test_the_tree_of_an_episode_does_what_was_done_in_it():
    data = walks(20, 3, policy=lambda o: act(TURNS, o))
    tree = luckiest(data, np.random.default_rng(0), max_leaves=10)
    assert mimicked(data, tree) & set(np.argsort(-data.episode_returns, kind="stable")[:5])
    same = replace(data, rewards=np.zeros(data.rewards.size))
    assert luckiest(same, np.random.default_rng(0), max_leaves=10) is None


@pytest.mark.parametrize(
    ("demonstrations", "planned_at", "adopted"), [(0, 0, True), (1, 0, False), (0, 10**4, False)]
)
def test_real_returns_alone_put_a_tree_in_the_place_of_an_unknown_action(
    demonstrations, planned_at, adopted
):
    """The model knows that staying earns nothing; what was earned in its name speaks for it.

    Not if somebody has shown something, nor by episodes of challengers before it.
    """
    data = walks(200, 7)
    well = np.flatnonzero(data.rewards[data.last] == 100.0)[1:9]
    badly = tuple(np.flatnonzero(data.rewards[data.last] == -50.0)[1:].tolist())
    plan = Planned(
        packed(GO),
        challenger=packed(STAY),
        incumbent_episodes=badly,
        challenger_episodes=tuple(well.tolist()),
        demonstrations=demonstrations,
        planned_at=min(planned_at, len(data.episodes)),
    )
    after = planned(plan, data)
    assert (nested(after.incumbent) == STAY) == adopted
    assert not adopted or after.incumbent_episodes == plan.challenger_episodes


def test_who_knows_nothing_tries_a_tree_or_draws_each_action():
    learner, world = DEFAULT.start(Walk.problem, Start()), Walk(np.random.default_rng(0))
    generator, acting, exploring = np.random.default_rng(1), [], []
    for _ in range(40):
        world.run(learner, generator)
        acting.append(learner._acting)
        exploring.append(learner._exploration)
    assert set(exploring) == {0.0, 1.0}
    assert {n_leaves(one) for one in acting} >= {1, 2, 3}
    assert {int(a) for one in acting for a in one.action[one.feature < 0]} == {0, 1}


@pytest.mark.parametrize(
    ("task", "steps", "least"), [("CartPole-v1", 8000, 400.0), ("MountainCar-v0", 40_000, -125.0)]
)
def test_tasks_are_learned_from_nothing(task, steps, least):
    """CartPole stayed a single action in two of three runs, MountainCar in all of them."""
    earned = []
    for seed in (1, 2):
        found = eutree.learn(
            task, steps=steps, seed=seed, judge_episodes=0, front_steps=0, evaluate_every=10**6
        )
        earned.append(eutree.evaluate(found.policy, task, episodes=50, seed=5).mean_return)
    assert min(earned) > least


@pytest.mark.parametrize("earned", [0.0, -1.0, 1.0])
def test_demonstrations_that_came_by_nothing_show_nothing(earned):
    """Nobody knows what a task wants whose returns are all alike, unless they are a gain."""
    data = walks(20, 7, pit=(50.0, 60.0), policy=lambda o: STAY)
    data = replace(data, rewards=np.full_like(data.rewards, earned / 40.0))
    plan = Planned(packed(STAY), incumbent_episodes=tuple(range(20)), demonstrations=15)
    after = planned(plan, data)
    assert after.knows_nothing == (earned <= 0.0)
    assert after.incumbent_episodes == (tuple(range(20)) if earned > 0.0 else (15, 16, 17, 18, 19))
    rewards = data.rewards.copy()
    rewards[-1] += 1.0  # somebody came by something
    assert not planned(plan, replace(data, rewards=rewards)).knows_nothing


# Of explorers that are random trees alone none came out of the valley with these seeds.


def reached(result):
    """Return the episodes that earned more than the worst."""
    returns = np.bincount(result.history.episodes, result.history.rewards)
    return np.flatnonzero(returns > returns.min())


@pytest.mark.parametrize("seed", [1401, 1408, 1411])
def test_where_nothing_was_earned_explorers_go_where_nobody_was(seed):
    found = eutree.learn(
        "MountainCar-v0", start="nothing", steps=4_600, seed=seed, judge_episodes=0, front_steps=0
    )
    assert reached(found).size


@pytest.mark.parametrize("seed", [1400, 1402])
def test_so_they_do_where_the_demonstrations_never_earned(seed):
    """Somebody who holds against the slope stays in the valley."""

    def holds(observation):
        return 2 * int(observation[0] > -0.5)

    shown = eutree.record("MountainCar-v0", holds, episodes=4, seed=seed)
    assert {episode.rewards.sum() for episode in shown} == {-200.0}
    found = eutree.learn(
        "MountainCar-v0", demonstrations=shown, steps=6_000, seed=seed, judge_episodes=0,
        front_steps=0,
    )  # fmt: skip
    assert reached(found).size
    assert eutree.evaluate(found.policy, "MountainCar-v0", episodes=50, seed=5).mean_return > -170


def test_an_explorer_of_seldom_places_has_no_challenger_beside_it():
    draws = np.random.default_rng(3)
    data = walks(60, 7, pit=(20.0, 21.0), policy=lambda _: int(draws.random() < 0.1))
    idle = replace(data, rewards=np.zeros(data.rewards.size), terminated=data.terminated & False)
    plan = Planned(packed(STAY), challenger=packed(GO), challenger_episodes=(3,))
    planner = Planner(n_episodes=200, n_explorer_episodes=200)
    found = planner.plan(plan, idle, np.random.default_rng(0))
    assert found.challenger is None
    assert found.model_steps > 0
    assert act(nested(found.explorer), np.array([0.0, 0.5])) == GO  # where most stayed
