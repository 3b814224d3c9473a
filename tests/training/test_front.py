"""The front at the end of a run: the best tree of each size, the pick, and what is kept of them."""

import json
from dataclasses import replace

import gymnasium
import msgspec
import numpy as np
import pytest

import eutree
from eutree.compression.episodes import Demand
from eutree.compression.front import front_among
from eutree.compression.playing import CommonEpisodes, Ground
from eutree.compression.searching import FrontSearch
from eutree.contests import SmallestWithin, new_table
from eutree.policies import TreePolicy
from eutree.report.run_folder_report import report_of_run
from eutree.report.run_page import run_page
from eutree.schema import Schema
from eutree.training.front import FEWEST, MOST, TIMES, Extent, _by_labels, _few
from eutree.training.handover import TOO_LARGE, Handover
from eutree.training.phases import Phase, Plan, Position, due
from eutree.trees import DecisionTree
from eutree.world_model.action_trees import from_decision_tree
from tests.compression.policies import random_policy

OPTIONS = {"episodes": 60, "evaluate_every": 20, "evaluation_episodes": 10, "seed": 3}


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("eutree/Evasion2-v0")


@pytest.fixture(scope="module")
def shown(env):
    return eutree.record(env, eutree.experts.wait_at_crossing, episodes=8, seed=3)


@pytest.fixture(scope="module")
def folder(env, shown, tmp_path_factory):
    """A run and its folder."""
    path = tmp_path_factory.mktemp("front") / "run"
    return eutree.learn(env, demonstrations=shown, out=path, **OPTIONS), path


def same(one, other):
    return one.to_bytes() == other.to_bytes()


def test_a_run_ends_with_the_best_tree_of_each_size(folder):
    result, _path = folder
    sizes = [one.policy.n_leaves for one in result.front]
    assert sizes[0] == result.learned.n_leaves
    assert sizes[1:] == sorted(set(sizes[1:]), reverse=True)
    assert len(sizes) > 3
    assert any(same(result.picked, one.policy) for one in result.front)
    assert result.environment_steps.front > 0
    assert result.environment_steps.total > result.environment_steps.front
    assert result.policy in (result.first, result.picked)


def test_it_is_kept_with_its_trees(folder):
    result, path = folder
    rows = (path / "front.csv").read_text().splitlines()
    assert len(rows) == len(result.front) + 1
    assert sum(row.endswith(",1") for row in rows) == 1
    for row, one in zip(rows[1:], result.front, strict=True):
        name, n_leaves, *_ = row.split(",")
        assert int(n_leaves) == one.policy.n_leaves
        assert same(TreePolicy.load(path / name), one.policy)
    events = [json.loads(line) for line in (path / "events.jsonl").read_text().splitlines()]
    assert [event["event"] for event in events][-2:] == ["front", "judgement"]


def test_the_page_walks_along_it(folder):
    result, path = folder
    page = run_page(report_of_run(path))
    assert page.count('<details name="front">') == len(result.front)
    assert "the pick" in page
    assert "fewer leaves; another action on" in page


def test_the_same_seed_makes_the_same_front_and_without_it_the_same_tree_is_learned(
    env, shown, folder
):
    result, _ = folder
    again = eutree.learn(env, demonstrations=shown, **OPTIONS)
    assert again.front == result.front or all(
        same(one.policy, other.policy) and one.mean_return == other.mean_return
        for one, other in zip(again.front, result.front, strict=True)
    )
    assert same(again.policy, result.policy)
    without = eutree.learn(env, demonstrations=shown, front_steps=0, **OPTIONS)
    assert same(without.learned, result.learned)
    assert without.front == ()
    assert without.environment_steps.front == 0


def test_a_run_stopped_before_its_front_goes_on_to_the_same_one(env, shown, folder, tmp_path):
    result, whole = folder
    options = OPTIONS | {"demonstrations": shown, "out": tmp_path / "run"}
    stopped = []

    def stop():
        return bool(stopped)

    def follow(run):
        if run.phase is Phase.EVALUATE and run.episode == OPTIONS["episodes"]:
            stopped.append(True)

    eutree.learn(env, stop=stop, on_progress=follow, checkpoint_seconds=0, **options)
    assert not (tmp_path / "run" / "front.csv").exists()
    again = eutree.learn(env, resume=True, **options)
    for name in ("front.csv", "policy.json", "events.jsonl"):
        assert (tmp_path / "run" / name).read_bytes() == (whole / name).read_bytes()
    assert same(again.picked, result.picked)
    # and once more, from a folder that is whole
    more = eutree.learn(env, resume=True, **options)
    assert [one.mean_return for one in more.front] == [one.mean_return for one in result.front]


def test_the_most_leaves_that_are_wanted_are_kept(env, shown):
    result = eutree.learn(env, demonstrations=shown, max_leaves=4, **OPTIONS)
    assert result.policy.n_leaves <= 4


def test_the_front_comes_before_the_judgement_and_only_where_something_is_judged():
    plan = Plan(episodes=1, handover=Handover())
    at = Position(episode=1, updated_at=1, evaluated_at=1)
    asked = {"gathering_episodes": 1, "max_episode_steps": 10}
    assert due(plan, at, **asked) is Phase.FRONT
    assert due(plan, msgspec.structs.replace(at, fronted=True), **asked) is Phase.JUDGE
    for handover in (None, Handover(episodes=0), Handover(front_steps=0)):
        assert due(replace(plan, handover=handover), at, **asked) is not Phase.FRONT


def test_steps_that_are_dear_let_few_trees_play_and_too_few_none():
    assert Extent.of(10**8, 8_000, 400).starts == MOST
    few = Extent.of(20_000, 8_000, 400)
    assert (few.starts, few.trees < 10) == (FEWEST, True)
    assert Extent.of(1_000, 8_000, 400) is None
    assert Extent.of(10**8, 80, 4).imagined < few.imagined


def test_what_is_not_more_than_the_slack_is_no_difference():
    """The best never varies, so its standard error is 0: one step of the range is nothing."""
    table = new_table(2, 4 * 32)
    table[0], table[1] = 10.0, 9.95
    table[0, 0], table[1, 0] = 0.0, -0.05
    rule = {"sizes": (5, 3), "episodes": 32}
    tight = SmallestWithin(**rule).next(table[:, 1:] + 0.0 * table[:, 1:])
    assert tight.winner == 0
    assert SmallestWithin(slack=0.01, **rule).next(table).winner == 1


@pytest.mark.parametrize("seed", range(5))
def test_what_a_world_model_runs_of_a_tree_is_that_tree(seed):
    from eutree.compression.imagined import acting
    from eutree.compression.smaller_trees import merged

    policy = merged(random_policy(seed, 12, n_actions=3))
    quick, slow = acting(policy), from_decision_tree(policy.tree, policy.actions)
    inner = slow.feature >= 0
    assert (quick.feature == slow.feature).all()
    for name in ("threshold", "left", "right"):
        assert (getattr(quick, name)[inner] == getattr(slow, name)[inner]).all()
    assert (quick.action[~inner] == slow.action[~inner]).all()


def test_a_notebook_draws_it(folder):
    result, _path = folder
    drawn = result._repr_html_()
    assert "Mean return by leaves" in drawn
    assert drawn.count("<circle") >= len(result.front)


class Lottery(gymnasium.Env):
    """One step: much is paid where one loses once in 200 episodes, little where one never does."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,))
    action_space = gymnasium.spaces.Discrete(3)
    paid = (0.8, 0.3, 1.0)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.observation_space.high * self.np_random.random(dtype="float32"), {}

    def step(self, action):
        lost = action == 2 and self.np_random.random() < 1 / 200
        info = {"is_success": not lost}
        return self.observation_space.low, self.paid[action] - lost, True, False, info


@pytest.mark.parametrize(("margin", "action"), [(0.0, 1), (0.01, 2)])
def test_a_start_that_was_lucky_leaves_more_than_the_luckiest_tree(margin, action):
    """The start did not fail in these episodes, nor did the tree that earns little."""
    one = DecisionTree.single_leaf(1)
    start, poor = (TreePolicy(one, np.array([a]), Schema.anonymous(1, 3)) for a in (0, 1))
    rich = TreePolicy(one.split(0, 0, 0.5), np.array([2, 2]), Schema.anonymous(1, 3))
    common = CommonEpisodes(Ground(Lottery(), 1), 400)
    demand = Demand(episodes=400, floor=start, success_margin=margin)
    found = front_among(rich, [rich, poor], common, demand)
    assert found.picked.actions[0] == action
    assert 0.99 < common.outcome.success_rate < 1.0


@pytest.mark.parametrize("floored", [True, False])
def test_success_counts_too_where_a_number_of_leaves_is_asked_for(floored):
    """The tree of two leaves earns more than that of one, and fails where the start does not."""
    one = DecisionTree.single_leaf(1)
    start = TreePolicy(one, np.array([0]), Schema.anonymous(1, 3))
    poor = TreePolicy(one, np.array([1]), Schema.anonymous(1, 3))
    rich = TreePolicy(one.split(0, 0, 0.5), np.array([2, 2]), Schema.anonymous(1, 3))
    common = CommonEpisodes(Ground(Lottery(), 1), 400)
    floor = start if floored else None
    demand = Demand(episodes=400, max_leaves=2, floor=floor, success_margin=0.0)
    found = front_among(start, [rich, poor], common, demand)
    assert found.picked.actions[0] == 1
    loose = replace(demand, success_margin=0.01)
    assert front_among(start, [rich, poor], common, loose).picked.actions[0] == 2


def test_a_limit_takes_no_trees_away_and_holds_however_few_steps_there_are(env, shown):
    """Larger trees took the places of those that could be picked: a stump was left."""
    options = OPTIONS | {"demonstrations": shown, "episodes": 4, "max_leaves": 3}
    short = eutree.learn(env, **options)
    assert short.first.n_leaves > 3 >= short.policy.n_leaves
    assert len(short.front) > 1
    assert all(one.policy.n_leaves <= 3 for one in short.front[1:])
    assert short.against_start.why == TOO_LARGE
    assert "more leaves than were asked for" in short.against_start.verdict()


def test_a_few_trees_play_from_few_starts_only_where_they_have_to():
    assert Extent.of(1_000, 8_000, 400) is None
    few = Extent.of(1_000, 8_000, 400, least=2)
    assert (few.trees, few.starts) == (2, 12)
    assert Extent.of(1, 8_000, 400, least=2).starts == 2
    assert Extent.of(20_000, 8_000, 400, least=2) == Extent.of(20_000, 8_000, 400)


@pytest.mark.parametrize("limit", [None, 4])
def test_with_a_limit_cuts_of_the_start_may_be_picked(env, shown, monkeypatch, limit):
    """Where nothing is imagined only the learned tree was cut, however badly it played."""
    cut = []

    def noted(policy, *given):
        cut.append(policy.n_leaves)
        return _by_labels(policy, *given)

    monkeypatch.setattr("eutree.training.front._by_labels", noted)
    options = {"method": "adaptive-q", "episodes": 20, "front_steps": 20_000, "seed": 1}
    result = eutree.learn(env, demonstrations=shown, max_leaves=limit, **options)
    assert result.first.n_leaves > 4
    assert cut == [result.learned.n_leaves, result.first.n_leaves][: 1 + (limit is not None)]
    assert limit is None or result.policy.n_leaves <= limit


def test_with_a_limit_the_search_begins_near_it(env, shown, monkeypatch):
    """From a start of many leaves it spent all it had on sizes that may not be picked."""
    begun = []

    class Noted(FrontSearch):
        def __init__(self, policies, *given):
            begun.extend(one.n_leaves for one in policies)
            super().__init__(policies, *given)

    monkeypatch.setattr("eutree.training.front.FrontSearch", Noted)
    result = eutree.learn(env, demonstrations=shown, max_leaves=3, **OPTIONS)
    assert result.first.n_leaves > TIMES * 3 >= max(begun) > 3
    assert result.policy.n_leaves <= 3


def test_few_that_play_under_a_limit_are_those_that_stand_first():
    """The last of an evenly spread list was the second best tree of the smallest size."""
    sizes = (5, 5, 4, 4, 3, 3, 2, 2)
    trees = [random_policy(np.random.default_rng(k), size) for k, size in enumerate(sizes)]
    assert _few(trees, 2, spread=False) == trees[:2]
    assert _few(trees, 4, spread=True) == [trees[k] for k in (0, 1, 2, 6)]
    assert _few(trees, 6, spread=True) == [trees[k] for k in (0, 1, 2, 4, 6, 3)]


def test_a_method_that_remembers_has_a_front_beside_a_start_that_does_not():
    """The start's tree was widened to the features remembered, and then saw the present alone."""
    maze = gymnasium.make("eutree/CheeseMaze-v0")
    shown = eutree.record(maze, lambda _: 1, episodes=3, seed=0)
    options = {"episodes": 30, "evaluation_episodes": 2, "front_steps": 60_000, "seed": 0}
    result = eutree.learn(maze, demonstrations=shown, method="history-u-tree", **options)
    assert result.learned.history or result.learned.past_actions
    assert result.front
