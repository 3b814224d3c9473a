import time

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.envs.experts import careless, look_ahead, wait_at_crossing
from eutree.errors import EnvironmentFault, InvalidArgumentError
from eutree.evaluation import Evaluation, evaluate
from eutree.interaction import episode_seed
from eutree.schema import EnvironmentSpec
from tests.evaluation.acting import random_policy

FIELDS = ("returns", "lengths", "endings", "successes")


class OneAtATime:
    """A policy that knows single observations only, and counts what it is asked."""

    def __init__(self, policy):
        self.policy, self.calls = policy, 0

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        self.calls += 1
        assert np.ndim(observation) == 1
        return self.policy.predict(observation, state, episode_start, deterministic)


def assert_same(one, other):
    for name in FIELDS:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("eutree/Evasion2-v0", {}),
        ("eutree/Evasion3-v0", {"opponent_speed": 4.2, "noise": 0.3}),
        ("eutree/Evasion-v0", {"observe_direction": True, "stop_reward": -0.1}),
    ],
)
@pytest.mark.parametrize("history", [0, 2])
def test_side_by_side_equals_one_by_one_bit_for_bit(name, arguments, history):
    env = gymnasium.make(name, **arguments)
    policy = random_policy(env.observation_space.shape[0], history=history)
    together = evaluate(policy, env, episodes=40, seed=3)
    single = OneAtATime(policy)
    assert_same(together, evaluate(single, env, episodes=40, seed=3))
    assert single.calls == together.steps + 1


def test_many_episodes_go_in_blocks():
    policy = random_policy(3)
    whole = evaluate(policy, "eutree/Evasion2-v0", episodes=600, seed=1)
    assert whole.episodes == 600
    first = evaluate(policy, "eutree/Evasion2-v0", episodes=10, seed=1)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(first, name), getattr(whole, name)[:10])


def test_a_scripted_expert_is_evaluated_side_by_side():
    env = gymnasium.make("eutree/Evasion2-v0")
    expert = wait_at_crossing(env)
    evaluation = evaluate(expert, env, episodes=300, seed=0)
    assert_same(evaluation, evaluate(OneAtATime(expert), env, episodes=300, seed=0))
    assert evaluation.success_rate > 0.98
    assert 80 < evaluation.mean_return < 90
    assert evaluation.n_leaves is None
    assert set(evaluation.endings) <= {"goal", "collision", "time limit"}


def test_an_expert_that_reads_its_environment_goes_one_by_one():
    env = gymnasium.make("eutree/Evasion2-v0")
    evaluation = evaluate(look_ahead(env), env, episodes=5, seed=0)
    assert evaluation.success_rate == 1.0


def test_a_careless_expert_can_be_evaluated():
    env = gymnasium.make("eutree/Evasion2-v0")
    policy = careless(wait_at_crossing, 0.2, seed=0)(env)
    assert evaluate(policy, env, episodes=20, seed=0).episodes == 20


def test_an_environment_is_evaluated_as_it_is_and_not_as_its_spec_says():
    """A wrapper, a picture or a changed parameter must not be lost in the copies."""

    class Richer(gymnasium.RewardWrapper):
        def reward(self, reward):
            return reward + 1000.0

    policy = random_policy(3)
    wrapped = evaluate(policy, Richer(gymnasium.make("eutree/Evasion2-v0")), episodes=5)
    plain = evaluate(policy, "eutree/Evasion2-v0", episodes=5)
    np.testing.assert_allclose(wrapped.returns, plain.returns + 1000.0 * plain.lengths)
    changed = gymnasium.make("eutree/Evasion2-v0")
    changed.unwrapped.parameters = gymnasium.make(
        "eutree/Evasion2-v0", goal_reward=500.0
    ).unwrapped.parameters
    richer = evaluate(wait_at_crossing(changed), changed, episodes=20)
    assert richer.returns.max() > 400.0
    watched = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
    assert_same(evaluate(policy, watched, episodes=5), plain)


def test_environment_id_and_spec_and_arguments_mean_the_same():
    policy = random_policy(3)
    spec = EnvironmentSpec("eutree/Evasion2-v0", {"opponent_speed": 4.0})
    results = [
        evaluate(policy, gymnasium.make("eutree/Evasion2-v0", opponent_speed=4.0), episodes=9),
        evaluate(policy, spec, episodes=9),
        evaluate(
            policy, "eutree/Evasion2-v0", episodes=9,
            environment_arguments={"opponent_speed": 4.0},
        ),
    ]  # fmt: skip
    assert_same(results[0], results[1])
    assert_same(results[0], results[2])


def test_episodes_are_seeded_one_by_one():
    env = gymnasium.make("CartPole-v1")
    policy = random_policy(4, n_leaves=2)
    evaluation = evaluate(policy, env, episodes=4, seed=7)
    for k in range(4):
        observation, _ = env.reset(seed=episode_seed(7, k))
        total, ended = 0.0, False
        while not ended:
            action, _ = policy.predict(observation)
            observation, reward, terminated, truncated, _ = env.step(action)
            total, ended = total + reward, terminated or truncated
        assert evaluation.returns[k] == total
    assert evaluation.success_rate is None
    assert evaluation.success_interval is None
    assert evaluation.n_leaves == 2


def test_an_environment_that_breaks_its_contract_is_a_fault():
    class Sick(gymnasium.ObservationWrapper):
        def observation(self, observation):
            return observation * np.nan

    env = Sick(gymnasium.make("eutree/Evasion2-v0"))
    with pytest.raises(EnvironmentFault, match="must be finite"):
        evaluate(random_policy(3), env, episodes=2)


def test_what_is_wrong_with_a_policy_shows():
    with pytest.raises(InvalidArgumentError, match="policy must have the features and actions of"):
        evaluate(random_policy(5), "eutree/Evasion2-v0", episodes=3)


def test_what_cannot_be_evaluated_is_refused():
    policy = random_policy(3)
    with pytest.raises(InvalidArgumentError, match="episodes must be an integer >= 1, got 0"):
        evaluate(policy, "eutree/Evasion2-v0", episodes=0)
    with pytest.raises(InvalidArgumentError, match=r"environment must be a gymnasium\.Env"):
        evaluate(policy, 3)
    env = gymnasium.make("eutree/Evasion2-v0")
    with pytest.raises(InvalidArgumentError, match="environment_arguments must be empty"):
        evaluate(policy, env, environment_arguments={"noise": 0.1})


class Turned(gymnasium.Env):
    """Observes and takes the same numbers as its like, under names in another order."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))
    action_space = gymnasium.spaces.Discrete(2)
    max_steps = 3

    def __init__(self, features, actions):
        self.feature_names, self.action_names = features, actions

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.step_number = 0
        return self.observation_space.low, {}

    def step(self, action):
        self.step_number += 1
        return self.observation_space.low, 0.0, self.step_number == self.max_steps, False, {}


@pytest.mark.parametrize(
    "use",
    [
        lambda tree, env: eutree.evaluate(tree, env, episodes=2),
        lambda tree, env: eutree.play(tree, env, seed=0),
        lambda tree, env: eutree.record(env, tree, episodes=1),
        lambda tree, env: eutree.distill(tree, env),
        lambda tree, env: eutree.compress(tree, np.zeros((1, 2)), env=env),
    ],
)
def test_a_tree_of_another_task_is_refused_and_one_without_names_taken(use):
    named = Turned(["angle", "rate"], ["left", "right"])
    tree = eutree.fit_expert_tree(eutree.record(named, lambda seen: 0, episodes=1))
    for other in (
        Turned(["rate", "angle"], ["left", "right"]),
        Turned(["angle", "rate"], ["right", "left"]),
        gymnasium.make("CartPole-v1"),
    ):
        with pytest.raises(InvalidArgumentError, match="must have the features and actions of"):
            use(tree, other)
    use(tree, named)
    use(tree, Turned(["x0", "x1"], ["action_0", "action_1"]))
    numbered = eutree.Schema((eutree.Feature("x0"), eutree.Feature("x1")), ("0", "1"))
    use(eutree.TreePolicy(tree.tree, tree.actions, numbered), named)  # as of scikit-learn


def test_an_evaluation_is_frozen_and_consistent():
    evaluation = Evaluation([1.0, 3.0], [5, 7], ["goal", "collision"], [True, False], 4)
    assert (evaluation.episodes, evaluation.steps) == (2, 12)
    assert (evaluation.mean_return, evaluation.mean_length) == (2.0, 6.0)
    assert evaluation.success_rate == 0.5
    low, high = evaluation.return_interval
    assert low == pytest.approx(2.0 - 12.7062, abs=1e-3)
    assert high == pytest.approx(2.0 + 12.7062, abs=1e-3)
    with pytest.raises(ValueError, match="read-only"):
        evaluation.returns[0] = 0.0
    with pytest.raises(InvalidArgumentError, match="vectors of one size"):
        Evaluation([1.0], [5, 7], ["goal", "goal"])


def test_one_episode_is_enough():
    evaluation = evaluate(random_policy(3), "eutree/Evasion2-v0", episodes=1)
    assert evaluation.return_interval == (evaluation.mean_return, evaluation.mean_return)
    assert f"mean return {evaluation.mean_return:.2f}, " in str(evaluation)
    assert "interval" not in evaluation._repr_html_().split("mean return")[1].split("</tr>")[0]


def test_side_by_side_is_much_faster():
    """Measured: about 30 times; a tenth of that is left for a busy machine."""
    env = gymnasium.make("eutree/Evasion2-v0")
    policy = random_policy(3)
    evaluate(policy, env, episodes=100)

    def cost(subject):
        start = time.thread_time()
        evaluate(subject, env, episodes=100)
        return time.thread_time() - start

    assert min(cost(policy) for _ in range(3)) < cost(OneAtATime(policy)) / 3


def test_it_is_public():
    assert eutree.evaluate is evaluate


def test_an_evaluation_prints_as_one_line():
    told = evaluate(wait_at_crossing(gymnasium.make("eutree/Evasion2-v0")), "eutree/Evasion2-v0")
    low, high = told.success_interval
    said = f"100 episodes: success {told.success_rate:.1%} [{low:.1%}, {high:.1%}], mean return "
    assert str(told).startswith(said)
    assert len(repr(told)) < 150
    assert "\n" not in str(told)


def test_beside_the_mean_stand_the_worst_episode_and_the_quantile():
    returns = np.arange(100.0)
    found = Evaluation(returns, np.ones(100), np.full(100, "end"))
    assert found.extremes == "worst episode 0, one in twenty at most 4"
    assert found.warning == ""


def test_a_rare_loss_among_few_episodes_is_warned_of():
    """The squared skewness of one loss in 100 is 98 ** 2 / 99."""
    rare = Evaluation(np.append(np.ones(99), -50.0), np.ones(100), np.full(100, "end"))
    assert "a few bad episodes make much of the mean" in rare.warning
    assert "2,426 episodes" in rare.warning
    same = Evaluation(np.full(5, 0.1), np.ones(5), np.full(5, "end"))
    assert same.warning == ""


@pytest.mark.parametrize("unknown", [np.nan, np.inf])
def test_unknown_returns_warn_of_nothing(unknown):
    found = Evaluation(np.array([unknown, 1.0, 2.0]), np.ones(3), np.full(3, "end"))
    assert found.warning == ""
