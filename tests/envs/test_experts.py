"""The scripted experts earn what is said of them, alone, in batches and made worse."""

from typing import Any

import gymnasium
import numpy as np
import pytest

import eutree
from eutree import experts
from eutree.envs import IDS
from eutree.errors import InvalidArgumentError, UnknownNameError


def run(env: Any, policy: Any, episodes: int) -> np.ndarray:
    """Return rows of (return, success) of episodes with seeds from 0."""
    rows = []
    for seed in range(episodes):
        observation, _ = env.reset(seed=seed)
        total, state, is_first = 0.0, None, True
        while True:
            action, state = policy.predict(observation, state, np.array(is_first))
            observation, reward, terminated, truncated, info = env.step(int(action))
            total, is_first = total + reward, False
            if terminated or truncated:
                break
        rows.append((total, info.get("is_success", np.nan)))
    return np.array(rows)


def run_vector(env: Any, policy: Any, steps: int) -> np.ndarray:
    """Return rows of (return, success) of the episodes that end within ``steps`` steps."""
    observations, _ = env.reset(seed=0)
    totals, rows, state, starts = np.zeros(env.num_envs), [], None, np.ones(env.num_envs, bool)
    for _ in range(steps):
        actions, state = policy.predict(observations, state, starts)
        observations, rewards, terminated, truncated, info = env.step(actions)
        starts = ~info["_is_success"]
        totals += rewards
        for e in np.flatnonzero(terminated | truncated):
            rows.append((totals[e], info["is_success"][e]))
            totals[e] = 0.0
    return np.array(rows)


def make_vec(name: str, copies: int, **arguments: Any) -> Any:
    return gymnasium.make_vec(
        name, num_envs=copies, vectorization_mode="vector_entry_point", **arguments
    )


@pytest.mark.parametrize(("count", "success", "reward"), [(2, 0.985, 83.0), (3, 0.985, 83.0)])
def test_gate_rule_is_a_good_demonstrator(count: int, success: float, reward: float) -> None:
    env = make_vec(f"eutree/Evasion{count}-v0", 250)
    rows = run_vector(env, experts.wait_at_crossing(env), 200)
    assert len(rows) > 1500
    assert rows[:, 1].mean() > success
    assert reward < rows[:, 0].mean() < 88.0


def test_gate_rule_drops_with_faster_opponents() -> None:
    rates = []
    for speed in (2.2, 2.7, 3.7, 4.2):
        env = make_vec("eutree/Evasion2-v0", 100, opponent_speed=speed)
        rates.append(run_vector(env, experts.wait_at_crossing(env), 200)[:, 1].mean())
    assert min(rates[:2]) > 0.98
    assert 0.85 < rates[2] < 0.97
    assert 0.45 < rates[3] < 0.75


@pytest.mark.parametrize("count", [1, 2, 3])
def test_looking_ahead_is_better_still(count: int) -> None:
    env = gymnasium.make("eutree/Evasion-v0", n_opponents=count)
    rows = run(env, experts.look_ahead(env), 60)
    assert rows[:, 1].mean() > 0.97
    assert rows[:, 0].mean() > 91.0


def test_looking_ahead_adapts_to_fast_opponents() -> None:
    env = gymnasium.make("eutree/Evasion2-v0", opponent_speed=4.2)
    assert run(env, experts.look_ahead(env), 40)[:, 1].mean() > 0.95


def test_looking_ahead_waits_at_an_opponent_that_stands_still() -> None:
    """It cannot get by, and running out of time costs nothing here."""
    env = gymnasium.make(
        "eutree/Evasion-v0", n_opponents=1, opponent_speed=0.0, path_length=1.0, stop_reward=0.0,
        collision_reward=-50.0, trial_limit=30.0,
    )  # fmt: skip
    assert run(env, experts.look_ahead(env), 2)[:, 0].tolist() == [0.0, 0.0]


def test_batches_agree_with_single_observations() -> None:
    env = gymnasium.make("eutree/Evasion3-v0")
    observations = np.array([env.observation_space.sample() for _ in range(500)])
    policy = experts.wait_at_crossing(env)
    actions, _ = policy.predict(observations)
    assert set(actions.tolist()) == {0, 1}
    assert [int(policy.predict(o)[0]) for o in observations] == actions.tolist()


def test_gate_rule_by_hand() -> None:
    policy = experts.wait_at_crossing(gymnasium.make("eutree/Evasion2-v0"))
    cases = [
        ([6.0, 8.4, 0.0], 0),  # at the first gate [5.75, 8), the first opponent near
        ([6.0, -8.4, 0.0], 0),
        ([6.0, 8.6, 0.0], 1),
        ([5.7, 0.0, 0.0], 1),  # not yet at the gate
        ([8.0, 0.0, 0.0], 1),  # past it: no stopping in the band
        ([16.0, 0.0, 9.0], 1),  # at the second gate, which is not about the first opponent
        ([16.0, 0.0, 8.0], 0),
    ]
    for observation, action in cases:
        assert int(policy.predict(np.array(observation))[0]) == action, observation


def test_careless_acts_at_random_at_its_rate() -> None:
    env = gymnasium.make("eutree/Evasion2-v0")
    going = np.tile([0.0, 5.0, 5.0], (20_000, 1))  # where the gate rule goes
    policy = experts.careless(experts.wait_at_crossing, 0.3, seed=4)(env)
    assert policy.predict(going)[0].mean() == pytest.approx(0.85, abs=0.01)
    again = experts.careless(experts.wait_at_crossing, 0.3, seed=4)(env)
    other = experts.careless(experts.wait_at_crossing, 0.3, seed=5)(env)
    first = experts.careless(experts.wait_at_crossing, 0.3, seed=4)(env).predict(going)[0]
    assert again.predict(going)[0].tolist() == first.tolist()
    assert other.predict(going)[0].tolist() != first.tolist()


class Echo:
    """A policy whose action is the observation's first number."""

    def predict(self, observation: Any, state: Any = None, **_: Any) -> tuple[Any, Any]:
        return np.asarray(observation)[..., 0].astype(np.int64), state


def test_late_repeats_what_was_seen_before() -> None:
    policy = experts.late(lambda env: Echo(), 2)(None)
    acted, state = [], None
    for step, seen in enumerate([7, 1, 2, 3, 4]):
        action, state = policy.predict(np.array([seen]), state, np.array(step == 0))
        acted.append(int(action))
    assert acted == [7, 7, 7, 1, 2]


def test_late_forgets_where_an_episode_starts() -> None:
    policy = experts.late(lambda env: Echo(), 1)(None)
    _, state = policy.predict(np.array([[1], [2]]), None, np.array([True, True]))
    action, state = policy.predict(np.array([[3], [4]]), state, np.array([True, False]))
    assert action.tolist() == [3, 2]
    action, _ = policy.predict(np.array([[5], [6]]), state, np.array([False, False]))
    assert action.tolist() == [3, 4]


def test_late_by_nothing_is_prompt() -> None:
    policy = experts.late(lambda env: Echo(), 0)(None)
    assert int(policy.predict(np.array([3]))[0]) == 3


def test_worse_experts_earn_less() -> None:
    env = make_vec("eutree/Evasion2-v0", 100)
    gate = experts.wait_at_crossing
    careless, late = experts.careless(gate, 0.1), experts.late(gate, 1)
    good, mean, bad = (run_vector(env, e(env), 150)[:, 1].mean() for e in (gate, careless, late))
    assert good > mean + 0.05 > bad + 0.2


def test_record_takes_experts() -> None:
    env = gymnasium.make("eutree/Evasion2-v0")
    demonstrations = eutree.record(env, experts.wait_at_crossing, episodes=3, seed=0)
    assert [episode.ending for episode in demonstrations.episodes] == ["goal"] * 3
    assert demonstrations.schema.feature_names == ("position", "opponent_1", "opponent_2")
    assert demonstrations.schema.actions == ("stop", "go")
    assert demonstrations.expert == "wait_at_crossing"
    careless = eutree.record(env, experts.careless(experts.look_ahead, 0.25), episodes=1, seed=0)
    assert careless.expert == "careless(look_ahead, 0.25)"


def test_every_id_has_experts() -> None:
    for name in IDS:
        assert list(experts.experts_for(name)) == ["gate", "look-ahead"]
    assert experts.experts_for("eutree:eutree/Evasion2-v0")["gate"] is experts.wait_at_crossing
    for name in ("eutree/Evasion2", "eutree:eutree/Evasion2"):  # Gymnasium makes the latest
        assert experts.experts_for(name) == experts.experts_for("eutree/Evasion2-v0")
    assert list(experts.experts_for("CartPole")) == ["fall", "balance"]  # of -v1; -v0 has none
    with pytest.raises(UnknownNameError, match="Did you mean 'CartPole-v1'"):
        experts.experts_for("CartPole-v0")


BANDS = [
    ("CartPole-v1", "fall", 40, 160, 240),
    ("CartPole-v1", "balance", 10, 495, 500),
    ("MountainCar-v0", "push", 60, -160, -115),
    ("MountainCar-v0", "rock", 20, -122, -114),
    ("Acrobot-v1", "both", 30, -150, -95),
    ("Acrobot-v1", "elbow", 30, -105, -70),
]


@pytest.mark.parametrize(("name", "expert", "episodes", "low", "high"), BANDS)
def test_classic_experts(name: str, expert: str, episodes: int, low: float, high: float) -> None:
    env = gymnasium.make(name)
    rows = run(env, experts.experts_for(name)[expert](env), episodes)
    assert low <= rows[:, 0].mean() <= high


def test_lunar_landers() -> None:
    pytest.importorskip("Box2D", reason="needs Box2D (extra envs)")
    env = gymnasium.make("LunarLander-v3")
    plain, better = (run(env, e(env), 8)[:, 0] for e in experts.experts_for(env.spec.id).values())
    assert plain.mean() < 150 < 220 < better.mean()
    env.close()


@pytest.mark.parametrize("expert", [experts.wait_at_crossing, experts.look_ahead])
def test_evasion_experts_refuse_other_environments(expert: Any) -> None:
    with pytest.raises(InvalidArgumentError, match="env must be an Evasion environment, got"):
        expert(gymnasium.make("CartPole-v1"))


def test_other_mistakes() -> None:
    env = gymnasium.make("eutree/Evasion2-v0")
    with pytest.raises(InvalidArgumentError, match="observations of 4 numbers for this expert"):
        experts.balance(env)
    with pytest.raises(InvalidArgumentError, match="single environment for the look-ahead expert"):
        experts.look_ahead(make_vec("eutree/Evasion2-v0", 2))
    with pytest.raises(InvalidArgumentError, match="got a batch of observations"):
        experts.look_ahead(env).predict(np.zeros((2, 3)))
    with pytest.raises(InvalidArgumentError, match=r"probability must be a number in \[0, 1\]"):
        experts.careless(experts.look_ahead, 1.5)
    with pytest.raises(InvalidArgumentError, match="steps must be an integer >= 0, got -1"):
        experts.late(experts.look_ahead, -1)
