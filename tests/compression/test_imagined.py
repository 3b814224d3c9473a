"""Cutting a tree to size by imagined returns."""

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.compression import ImaginedEpisodes
from eutree.compression.imagined import Pruned
from eutree.data import Episode
from eutree.envs.experts import follow_the_fall
from eutree.errors import FormatError, InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.training import stored_transitions
from eutree.trees import DecisionTree
from eutree.world_model import Transitions
from eutree.world_model.ensemble import EnsembleSettings
from tests.little_search import little_search

QUICK = EnsembleSettings(members=2, hidden=24, batch=64, updates=2000)
LENGTH, EPISODES = 10, 600


@pytest.fixture(scope="module")
def known():
    """A walk in [0, 1]; above 0.9 all actions but 1 cost 10, below only 1 costs something: 2."""
    generator = np.random.default_rng(0)
    x = np.empty((EPISODES, LENGTH + 1))
    x[:, 0] = generator.random(EPISODES)
    for t in range(LENGTH):
        x[:, t + 1] = np.clip(x[:, t] + 0.2 * generator.standard_normal(EPISODES), 0.0, 1.0)
    actions = generator.integers(3, size=EPISODES * LENGTH)
    before, after = x[:, :-1].reshape(-1, 1), x[:, 1:].reshape(-1, 1)
    high = before[:, 0] > 0.9
    rewards = np.where(high & (actions != 1), -10.0, np.where(~high & (actions == 1), -2.0, 0.0))
    numbers = np.repeat(np.arange(EPISODES), LENGTH)
    ends = np.zeros(EPISODES * LENGTH, dtype=np.bool_)
    return Transitions(before, actions, rewards, after, ends, numbers, 3)


@pytest.fixture(scope="module")
def policy():
    """Three leaves: the two large ones decide about nothing, the small one about everything."""
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.9).split(0, 0, 0.45)
    actions = np.empty(3, dtype=np.int64)
    for x, action in ((0.2, 0), (0.7, 2), (0.95, 1)):
        actions[tree.leaf_of([x])] = action
    return TreePolicy(tree, actions, Schema.anonymous(1, 3))


def action_at(policy, x):
    return int(policy.predict(np.array([x]))[0])


@pytest.mark.parametrize("seed", range(3))
def test_imagined_returns_keep_the_leaf_that_earns(known, policy, seed):
    small, report = eutree.compress(
        policy,
        known.observations,
        max_leaves=2,
        imagined=ImaginedEpisodes(known, QUICK),
        seed=seed,
    )
    assert small.n_leaves == 2
    assert action_at(small, 0.97) == 1
    assert report.method == "imagined"
    before, after = report.imagined
    assert after == pytest.approx(before, abs=2.0)


def test_labels_alone_give_it_up(known, policy):
    small, report = eutree.compress(policy, known.observations, max_leaves=2)
    assert small.n_leaves == 2
    assert action_at(small, 0.97) != 1
    assert report.method == "budget"
    assert report.imagined is None


def test_same_seed_same_bytes(known, policy):
    options = {"max_leaves": 2, "imagined": ImaginedEpisodes(known, QUICK), "seed": 4}
    one, _ = eutree.compress(policy, known.observations, **options)
    other, _ = eutree.compress(policy, known.observations, **options)
    assert one.to_bytes() == other.to_bytes()


def test_a_tree_that_is_small_enough_stays(known, policy):
    small, report = eutree.compress(
        policy, known.observations, max_leaves=3, imagined=ImaginedEpisodes(known)
    )
    assert small.n_leaves == 3
    assert report.method == "merge"


def test_what_cannot_be_is_refused(known, policy):
    rows = known.observations
    for options, words in (
        ({"imagined": ImaginedEpisodes(known)}, "imagined needs max_leaves"),
        ({"max_leaves": 2, "mode": "merge"}, 'max_leaves needs mode="auto"'),
        ({"max_leaves": 2, "max_disagreement": 0.1}, "neither max_disagreement nor margin"),
        ({"max_leaves": 1}, "max_leaves must be an integer >= 2, got 1"),
    ):
        with pytest.raises(InvalidArgumentError, match=words):
            eutree.compress(policy, rows, **options)
    with pytest.raises(InvalidArgumentError, match="at least one, to choose"):
        eutree.compress(policy, rows[:0], max_leaves=2)
    other = TreePolicy(DecisionTree.single_leaf(2).split(0, 1, 0.5).split(0, 0, 0.5),
                       np.array([0, 1, 2]), Schema.anonymous(2, 3))  # fmt: skip
    with pytest.raises(InvalidArgumentError, match="transitions of 2 features"):
        eutree.compress(other, np.ones((3, 2)), max_leaves=2, imagined=ImaginedEpisodes(known))


@little_search()
def test_a_run_folder_has_the_experience(tmp_path, capsys):
    env = gymnasium.make("CartPole-v1")
    shown = eutree.record(env, follow_the_fall, episodes=3, seed=0)
    folder = tmp_path / "run"
    result = eutree.learn(
        env, demonstrations=shown, method="u-tree", episodes=4, evaluation_episodes=2,
        judge_episodes=0, front_steps=0, out=folder,
    )  # fmt: skip
    stored = stored_transitions(folder, 2)
    assert (stored.observations == result.history.observations).all()
    assert (stored.rewards == result.history.rewards).all()
    assert stored.first.sum() == 7
    with pytest.raises(FormatError, match=r"history_actions: must be in 0\.\.0"):
        stored_transitions(folder, 1)
    out = tmp_path / "small.json"
    words = ["compress", str(folder), "--out", str(out), "--max-leaves", "2", "--json"]
    words += ["--episodes", "20"]
    assert run(words) == 0
    assert '"imagined": null' in capsys.readouterr().out
    assert TreePolicy.load(out).n_leaves <= 2
    assert run(["compress", str(out), "--out", str(out), "--imagined"]) != 0


class Line(gymnasium.Env):
    """One step: the further right a tree cuts, the more it earns."""

    observation_space = gymnasium.spaces.Box(0.0, 10.0, (1,), dtype=np.float64)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = self.np_random.uniform(0.0, 10.0)
        return np.array([self.place]), {}

    def step(self, action):
        return np.array([self.place]), float(action), True, False, {}


@pytest.mark.parametrize("sign", [1.0, -1.0, 0.0])
def test_a_world_model_is_refused_where_it_cannot_tell_trees(monkeypatch, sign):
    """It is asked about seven trees, which then play."""
    cuts = np.arange(1.0, 8.0)
    schema, stump = Schema.anonymous(1, 2), DecisionTree.single_leaf(1)
    asked = tuple(
        TreePolicy(stump.split(0, 0, cut), np.array([1, 0]), schema) for cut in cuts.tolist()
    )
    scores = sign * cuts
    found = Pruned(asked[-1], "imagined", 0.0, 1.0, asked, scores)
    monkeypatch.setattr(ImaginedEpisodes, "pruned", lambda *a, **k: found)
    known = Transitions.of(
        [Episode(np.array([[1.0], [2.0]]), np.array([0]), np.array([1.0]), True, False)], 2
    )
    large = TreePolicy(stump.split(0, 0, 3.0).split(1, 0, 6.0), np.array([0, 1, 0]), schema)
    options = {"max_leaves": 2, "imagined": ImaginedEpisodes(known), "env": Line()}
    if sign > 0:
        assert eutree.compress(large, np.ones((3, 1)), **options)[1].by == "model"
        return
    with pytest.raises(eutree.InvalidArgumentError, match="no better than chance"):
        eutree.compress(large, np.ones((3, 1)), **options)
