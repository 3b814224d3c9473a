"""Goals, boxes, and what parti-game and variable resolution make of them."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree  # noqa: F401 - registers
from eutree import fit_expert_tree
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.learners.learner import Needs, Start, check_fits, reached
from eutree.trees import DecisionTree
from eutree_lab.parti_game.cells import goal_boxes
from eutree_lab.parti_game.method import PartiGameMethod
from eutree_lab.root_box import root_box
from eutree_lab.vrd.method import VariableResolutionMethod
from tests.worlds import Corridor, play, problem_of, recorded


def episode(rewards, *, terminated=True, is_success=None, end=1.0):
    places = np.linspace(0.0, end, len(rewards) + 1)[:, np.newaxis]
    return Episode(
        observations=places, actions=np.zeros(len(rewards), dtype=np.int64),
        rewards=np.array(rewards), terminated=terminated, truncated=not terminated,
        is_success=is_success,
    )  # fmt: skip


def test_an_end_that_saves_cost_is_a_goal_and_one_that_stops_earning_is_none():
    hill = [episode([-1.0] * 90), episode([-1.0] * 200, terminated=False)]
    assert reached(hill).tolist() == [True, False]
    pole = [episode([1.0] * 90), episode([1.0] * 200, terminated=False)]
    assert reached(pole).tolist() == [False, False]
    said = [episode([1.0] * 9, is_success=True), episode([-1.0] * 9, is_success=False)]
    assert reached(said).tolist() == [True, False]
    assert reached([]).tolist() == []


def test_a_goal_is_where_good_episodes_end():
    episodes = [episode([-1.0] * 50, end=1.0 + 0.01 * i) for i in range(5)]
    boxes = goal_boxes(episodes, np.array([0.0]), np.array([1.5]))
    assert boxes.shape[1:] == (2, 1)
    finals = np.array([e.observations[-1, 0] for e in episodes])
    inside = (boxes[:, 0] <= finals) & (finals <= boxes[:, 1])
    assert inside.any(axis=0).all()
    assert boxes[:, 0].min() > 0.9


def test_a_box_has_bounds_where_there_are_some_and_else_the_range_of_the_data():
    problem = problem_of(Corridor())
    cut = DecisionTree.single_leaf(3).split(0, 2, 7.0)
    low, high = root_box(problem, cut, np.array([[0.5, 0.0, 2.0], [0.25, 1.0, 2.0]]))
    assert low.tolist()[:2] == [0.0, 0.0]
    assert high.tolist()[:2] == [1.0, 1.0]
    assert low[2] == pytest.approx(1.75)  # 5 % of what data and threshold span
    assert high[2] == pytest.approx(7.25)


def test_parti_game_is_refused_by_name_and_reason():
    problem, method = problem_of(Corridor()), PartiGameMethod()
    with pytest.raises(InvalidArgumentError, match=r"'parti-game' does not fit .* needs a goal"):
        check_fits(method, problem, Start())
    pole = Start(episodes=(episode([1.0] * 30),))
    with pytest.raises(InvalidArgumentError, match="needs a goal"):
        check_fits(method, problem, pole)
    told = PartiGameMethod(goal=((0.9, 0.0, 0.0), (1.0, 1.0, 2.0)))
    check_fits(told, problem, Start())
    with pytest.raises(InvalidArgumentError, match="needs an environment to act in"):
        check_fits(told, problem, Start(), offline=True)
    with pytest.raises(InvalidArgumentError, match="goal must be two corners of one box"):
        PartiGameMethod(goal=((0.0,), (1.0, 1.0)))
    with pytest.raises(InvalidArgumentError, match="max_cells must be an integer >= 1"):
        PartiGameMethod(max_cells=0)


def test_variable_resolution_is_refused_by_name_and_reason():
    seven = Needs(max_features=2)
    assert "copes with 2 features, got 3" in seven.refusal(problem_of(Corridor()), Start())
    assert VariableResolutionMethod.needs.max_features == 6
    with pytest.raises(InvalidArgumentError, match="unknown criterion 'averages'"):
        VariableResolutionMethod(criterion="averages")
    with pytest.raises(InvalidArgumentError, match=r"share must be a number in \(0, 1\]"):
        VariableResolutionMethod(share=0.0)


def test_parti_game_splits_the_square_it_is_told_the_goal_of():
    """The corridor without its door: only position matters, and walking is the way."""

    class Open(Corridor):
        def step(self, action):
            self.open = True
            return super().step(action)

    method = PartiGameMethod(goal=((0.99, 0.0, 0.0), (1.0, 1.0, 2.0)))
    problem = problem_of(Open())
    for seed in range(5):
        learner = method.start(problem, Start())
        for number in range(6):
            earned = play(learner, Open(), seed=100 * seed + number)
        assert earned > 5.0
        assert learner.decisions().fidelity > 0.9
        assert learner.update(np.random.default_rng(0)).figures["losing_cells"] == 0
        assert not learner.game.exhausted


def test_the_expert_is_an_aim_of_parti_game_and_its_leaves_are_cells():
    demonstrations = recorded()
    expert = fit_expert_tree(demonstrations)
    problem, start = problem_of(Corridor()), Start(expert, tuple(demonstrations.episodes))
    learner = PartiGameMethod().start(problem, start)
    assert len(learner.game.cells) == expert.n_leaves
    rows = np.concatenate([e.observations[:-1] for e in demonstrations.episodes])
    own, _ = learner.own_policy().predict(rows)
    shown, _ = expert.predict(rows)
    # A perfect expert: every cell it was in is won by following it, or by a shorter way.
    assert (own == shown).mean() > 0.7
    assert not learner.game.plan().losing[np.unique(expert.tree.leaf_index(rows))].any()
    alone = PartiGameMethod(follow_expert=False, use_cells=False).start(problem, start)
    assert len(alone.game.cells) == 1
    assert alone.game.expert is None


class Ledge(gymnasium.Env):
    """Climb to a ledge before turning right: below it one falls, above the top too."""

    def __init__(self):
        self.observation_space = spaces.Box(0.0, 1.0, (2,), dtype=np.float64)
        self.action_space = spaces.Discrete(2)
        self.spec = None

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.left = self.np_random.uniform([0.0, 0.0], [0.4, 0.3]), 60
        return self.place.copy(), {}

    def step(self, action):
        self.place = self.place + ([0.07, 0.0] if action == 0 else [0.0, 0.07])
        out = bool((self.place > 1.0).any())
        good = bool(out and self.place[1] <= 1.0 and self.place[1] > 0.6)
        reward = (10.0 if good else -10.0) if out else -0.1
        self.left -= 1
        inside = np.minimum(self.place, 1.0)
        return inside, reward, out, self.left == 0 and not out, {"is_success": good}


@pytest.mark.parametrize("criterion", ["average", "starts"])
def test_variable_resolution_learns_where_to_turn(criterion):
    problem = problem_of(Ledge())
    episodes = []
    for seed in range(40):  # at random, so that falling is known too
        generator, env = np.random.default_rng(seed), Ledge()
        rows, actions, rewards, ended = [env.reset(seed=seed)[0]], [], [], False
        while not ended:
            actions.append(int(generator.random() < 0.5))
            after, reward, ended, cut, info = env.step(actions[-1])
            rows.append(after)
            rewards.append(reward)
        assert not cut
        episodes.append(Episode(
            observations=np.array(rows), actions=np.array(actions), rewards=np.array(rewards),
            terminated=True, truncated=False, is_success=info["is_success"],
        ))  # fmt: skip
    random_return = np.mean([e.rewards.sum() for e in episodes])
    method = VariableResolutionMethod(criterion=criterion, exploration=0.0, refinements=4)
    for seed in range(5):
        learner = method.start(problem, Start(None, tuple(episodes)))
        first = learner.solved.grid.n_corners
        earned = []
        for number in range(12):
            earned.append(play(learner, Ledge(), seed=1000 * seed + number))
            if number % 4 == 3:
                learner.update(np.random.default_rng(number))
        assert learner.solved.grid.n_corners > first
        assert np.mean(earned) > random_return + 4.0
        assert np.mean(earned) > 6.0


def test_the_true_model_takes_the_place_of_the_learned_one():
    env = gymnasium.make("eutree/CarOnHill-v0").unwrapped
    problem = problem_of(env)
    method = VariableResolutionMethod(true_model=True, discount=env.discount, refinements=6)
    with pytest.raises(InvalidArgumentError, match=r"'vrd' does not fit .* offers its model"):
        method.start(problem, Start())
    learner = method.start(replace(problem, model=env.model), Start())
    states = np.random.default_rng(0).uniform([-1, -4], [1, 4], (64, 2))
    ends = []
    for state in states:
        observation, _ = env.reset(options={"state": state})
        ended = False
        while not ended:
            action, _ = learner.own_policy().predict(observation)
            observation, _, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
        ends.append(info["ending"] == "goal")
    assert np.mean(ends) > 0.45  # from most others no policy can stop: the scripted expert's share
