"""U-Tree with a memory: the Continuous U-Tree on stacked features, and a deeper fringe."""

from dataclasses import fields

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.c45 import C45Settings, grow
from eutree.errors import InvalidArgumentError
from eutree.interaction import GuardedEnv
from eutree.learners import Start
from eutree.learners.starts import start_of
from eutree.learners.u_tree import UTreeMethod
from eutree.recording import record
from eutree.splitting import LeafSample
from eutree_lab.history_u_tree.method import HistoryUTreeMethod
from tests.worlds import FEW_DRAWS, Corridor, play, problem_of, recorded


def without_a_memory(method):
    """Return the history U-Tree of a Continuous U-Tree's choices that remembers nothing."""
    choices = {field.name: getattr(method, field.name) for field in fields(UTreeMethod)}
    return HistoryUTreeMethod(**choices, history=0, past_actions=0, fringe=1)


@pytest.mark.parametrize("method", [UTreeMethod(), FEW_DRAWS], ids=["paper", "corrected"])
def test_without_a_memory_it_is_the_continuous_u_tree_byte_for_byte(method):
    problem, shown = problem_of(Corridor()), recorded()
    start = start_of(None, problem, demonstrations=shown, generator=np.random.default_rng(0))
    learners = [kind.start(problem, start) for kind in (method, without_a_memory(method))]
    for number in range(16):
        for learner in learners:
            play(learner, Corridor(), seed=number)
            if number % 4 == 3:
                learner.update(np.random.default_rng(number))
    one, other = (learner.state() for learner in learners)
    assert {k: a.tobytes() for k, a in one.items()} == {k: a.tobytes() for k, a in other.items()}
    assert learners[0].decisions().tree.n_leaves > 1


def exclusive_or(seed, n=400):
    """Two percepts whose exclusive or decides the return, among three that do not matter."""
    generator = np.random.default_rng(seed)
    rows = generator.integers(2, size=(n, 5)).astype(np.float64)
    rows[:, 4] = generator.normal(size=n)
    returns = (rows[:, 1] != rows[:, 3]) + 0.3 * generator.normal(size=n)
    return LeafSample(rows, returns, generator.integers(2, size=n), generator.integers(40, size=n))


@pytest.mark.parametrize("seed", range(5))
def test_only_a_fringe_of_depth_2_sees_what_distinguishes_together(seed):
    sample, generator = exclusive_or(seed), np.random.default_rng(seed)
    assert HistoryUTreeMethod(fringe=1).cut(sample, generator) is None
    assert HistoryUTreeMethod(fringe=2).cut(sample, generator).feature in (1, 3)


def test_on_noise_a_deeper_fringe_cuts_no_more_often_than_its_level():
    method, cuts, n_leaves = HistoryUTreeMethod(fringe=2), 0, 150
    for seed in range(n_leaves):
        generator = np.random.default_rng(1000 + seed)
        rows = generator.integers(2, size=(160, 6)).astype(np.float64)
        rows[:, 4:] = generator.normal(size=(160, 2))
        noise = LeafSample(rows, generator.normal(size=160), generator.integers(2, size=160))
        cuts += method.cut(noise, generator) is not None
    # Two tests at 1 %: a single cut, and a pair; 2 % and three standard errors.
    assert cuts <= n_leaves * 0.02 + 3 * np.sqrt(n_leaves * 0.02 * 0.98)


class Lamp(gymnasium.Env):
    """A lamp that is switched in one step of twenty; say whether it is on. The eye is dim."""

    def __init__(self):
        self.observation_space = spaces.Box(-9.0, 9.0, (1,), dtype=np.float64)
        self.action_space = spaces.Discrete(2)
        self.spec = None

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.on, self.left = int(self.np_random.integers(2)), 200
        return self.seen(), {}

    def step(self, action):
        reward = float(action == self.on)
        self.on ^= int(self.np_random.random() < 0.05)
        self.left -= 1
        return self.seen(), reward, False, self.left == 0, {}

    def seen(self):
        return np.clip([self.on + 0.6 * self.np_random.normal()], -9.0, 9.0)


class Sighted:
    """Sees the lamp itself."""

    def __init__(self, env):
        self.env = env

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return self.env.unwrapped.on, state


def share_of_right_steps(decide, seed):
    env = GuardedEnv(Lamp(), past_actions=1)
    seen, right = env.reset(seed), 0.0
    while True:
        seen, reward, _, truncated, _ = env.step(decide(seen))
        right += reward
        if truncated:
            return right / 200


def test_an_expert_tree_that_may_copy_does_nothing_else_so_ours_may_not():
    env = Lamp()
    shown = record(env, Sighted(env), episodes=10, seed=0)
    stacked = shown.with_history(0, 1)
    copying = grow(stacked.observations, stacked.actions, n_classes=2, settings=C45Settings())
    tree, actions = copying.to_decision_tree()
    labels = actions[tree.leaf_index(stacked.observations)]
    assert (labels == stacked.actions).mean() >= 0.9  # almost always right ...
    copied = share_of_right_steps(lambda seen: int(actions[tree.leaf_of(seen.tolist())]), seed=5)

    problem = problem_of(env)
    start = start_of("tree+demos", problem, demonstrations=shown, generator=np.random.default_rng())
    learner = HistoryUTreeMethod(history=0, past_actions=1).start(problem, start)
    own = learner.decisions().tree
    assert set(own.feature[own.feature >= 0].tolist()) == {0}  # ... but this one looks
    policy = Start(start.expert).expert
    looked = share_of_right_steps(lambda seen: policy.act(seen[:1].tolist()), seed=5)
    assert looked > copied + 0.1


def test_its_policy_remembers_by_itself(tmp_path):
    problem, shown = problem_of(Corridor()), recorded()
    learner = HistoryUTreeMethod().start(problem, Start(episodes=shown.kept))
    policy = learner.decisions().policy(problem)
    assert (policy.history, policy.past_actions) == (1, 1)
    assert policy.schema.feature_names[-1] == "did action_1, 1 ago"


def recorded_crossings():
    careless = eutree.experts.careless(eutree.experts.wait_at_crossing, 0.3, seed=1)
    return eutree.record("eutree/Evasion2-v0", careless, episodes=15, seed=3)


def test_it_learns_from_a_log_alone():
    result = eutree.learn(None, demonstrations=recorded_crossings(), method=HistoryUTreeMethod())
    assert result.learned.past_actions == 1
    assert result.against_fit.n_held_out == 5


def test_a_past_that_it_is_given_besides_is_refused(tmp_path):
    """It ended in names that stood twice: "x0, 1 ago, 1 ago"."""
    with pytest.raises(
        InvalidArgumentError, match="history must be 0 with method 'history-u-tree'"
    ):
        eutree.learn("eutree/Evasion2-v0", method="history-u-tree", history=1, episodes=1)


@pytest.mark.parametrize("alone", [False, True])
def test_monotone_rules_are_kept_by_policies_that_remember(alone):
    """Rules of the observation did not fit what remembers more: an internal error."""
    log, rule = recorded_crossings(), "go in position"
    result = eutree.learn(
        None if alone else "eutree/Evasion2-v0",
        demonstrations=log,
        method="history-u-tree",
        monotone=[rule],
        episodes=4,
        judge_episodes=0,
        front_steps=0,
    )
    assert result.learned.history == 1
    assert eutree.verify(result.learned, f"monotone {rule}").holds
