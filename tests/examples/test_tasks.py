"""The small tasks among the examples: their contracts, their physics, their rules of thumb."""

import ast
import importlib
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import eutree
from eutree.interaction import DerivedObservation
from eutree.interaction.first_look import return_range
from eutree.interaction.names import declarations

FOLDER = Path(__file__).parents[2] / "examples"
TASKS = {  # module: id, class, rule of thumb, features, actions
    "inventory": ("Inventory-v0", "Inventory", "order_up_to", 4, 7),
    "house_battery": ("HouseBattery-v0", "HouseBattery", "own_use", 8, 3),
    "motor_currents": ("MotorCurrents-v0", "MotorCurrents", "towards_the_error", 4, 8),
    "heated_room": ("HeatedRoom-v0", "HeatedRoom", "thermostat", 4, 3),
    "crossing": ("TrafficLight-v0", "TrafficLight", "longest_queue", 21, 4),
}


class AtRandom:
    reads_features = True

    def __init__(self, n_actions):
        self.generator, self.n_actions = np.random.default_rng(0), n_actions

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return self.generator.integers(self.n_actions, size=np.shape(observation)[:-1]), state


def parts(name):
    """Return the module of a task, its environment and its rule."""
    module = importlib.import_module(f"examples.{name}")
    env, _, rule, _, _ = TASKS[name]
    return module, gymnasium.make(env), getattr(module, rule)


def run(env, rule, seed, steps=10_000):
    """Return the observations, rewards and actions of an episode."""
    observation, _ = env.reset(seed=seed)
    seen, rewards, actions, over = [observation], [], [], False
    while not over and len(actions) < steps:
        actions.append(rule(observation))
        observation, reward, terminated, truncated, _ = env.step(actions[-1])
        over = terminated or truncated
        seen.append(observation)
        rewards.append(reward)
    return np.array(seen), np.array(rewards), np.array(actions)


@pytest.mark.parametrize("name", TASKS)
def test_a_task_is_short_and_needs_numpy_and_gymnasium_alone(name):
    source = (FOLDER / f"{name}.py").read_text()
    assert len(source.splitlines()) <= 80
    tree = ast.parse(source)
    imported = [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import)
                for alias in node.names]  # fmt: skip
    imported += [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert set(imported) == {"typing", "gymnasium", "numpy"}


@pytest.mark.parametrize("name", TASKS)
@pytest.mark.filterwarnings("ignore:.*render:UserWarning", "ignore:.*WARN.*:UserWarning")
def test_it_keeps_gymnasiums_contract_and_names_what_it_shows(name):
    module, env, _ = parts(name)
    _, kind, _, n_features, n_actions = TASKS[name]
    check_env(getattr(module, kind)(), skip_render_check=True)
    assert env.observation_space.shape == (n_features,)
    assert env.action_space.n == n_actions
    assert len(env.unwrapped.feature_names) == n_features
    assert len(env.unwrapped.action_names) == n_actions


@pytest.mark.parametrize("name", TASKS)
def test_the_same_seed_gives_the_same_episode_within_the_bounds(name):
    _, env, rule = parts(name)
    (seen, rewards, _), (again, same, _) = (run(env, rule, 8) for _ in range(2))
    assert np.array_equal(seen, again)
    assert np.array_equal(rewards, same)
    assert ((seen >= env.observation_space.low) & (seen <= env.observation_space.high)).all()
    if (limits := return_range(env)) is not None:
        assert limits[0] <= rewards.sum() <= limits[1]


@pytest.mark.parametrize("name", TASKS)
def test_the_rule_of_thumb_is_better_than_chance(name):
    _, env, rule = parts(name)
    demonstrations = eutree.record(env, rule, episodes=10, seed=0)
    shown = np.array([episode.undiscounted_return for episode in demonstrations])
    chance = eutree.evaluate(AtRandom(env.action_space.n), env, episodes=30, seed=1).returns
    error = np.hypot(shown.std() / np.sqrt(shown.size), chance.std() / np.sqrt(chance.size))
    assert shown.mean() - chance.mean() > 4.0 * error


def test_nothing_is_earned_by_ordering_for_the_end():
    """Who orders as much as possible in the last week earns less than who orders nothing then."""
    module, env, rule = parts("inventory")
    endings = {"much": len(module.ORDERS) - 1, "nothing": 0}
    returns = {}
    for name, last in endings.items():
        found = []
        for seed in range(20):
            env.reset(seed=seed)
            start, total = env.unwrapped._day, 0.0
            observation = env.unwrapped._observation()
            over = False
            while not over:
                late = env.unwrapped._day - start >= module.DAYS - 2
                observation, reward, _, over, _ = env.step(last if late else rule(observation))
                total += reward
            found.append(total)
        returns[name] = np.mean(found)
    assert returns["nothing"] > returns["much"]


def test_what_is_sold_leaves_the_shelf():
    module, env, rule = parts("inventory")
    seen, rewards, actions = run(env, rule, 3)
    stock, arriving = seen[:, 0], seen[:, 1]
    sold = np.minimum(stock[:-1] + arriving[:-1], module.SHELF) - stock[1:]
    assert (sold >= 0).all()
    assert (sold <= seen[1:, 2]).all()
    orders = np.array(module.ORDERS)[actions]
    assert np.array_equal(arriving[1:], orders)
    expected = module.MARGIN * sold - module.HOLDING * stock[1:] - module.FEE * (orders > 0)
    assert rewards == pytest.approx(expected)


def test_a_battery_gives_back_less_than_it_took():
    """Charged from the grid and emptied at once it is as full as before, and money is gone."""
    module, env, _ = parts("house_battery")
    inner = env.unwrapped
    env.reset(seed=1)
    inner._charge = 0.0
    inner._price[:] = 0.2
    inner._sun[:] = inner._load[:] = 0.0
    rewards = [env.step(action)[1] for action in (2, 2, 0, 0)]
    taken = 2 * module.POWER * module.HOURS
    assert inner._charge == pytest.approx(0.0)
    given = module.EFFICIENCY * taken
    cost = taken * 0.2 - given * module.FEED_IN + module.WEAR * (taken + given)
    assert sum(rewards) == pytest.approx(-cost)


def test_a_state_of_the_bridge_moves_the_current_its_way():
    """With the rotor at rest at angle 0 a direction is along d, the next 60 degrees on."""
    module, env, _ = parts("motor_currents")
    for action, wanted in ((1, 0.0), (2, 60.0), (4, 180.0)):
        env.reset(seed=0)
        inner = env.unwrapped
        inner._angle, inner._speed, inner._currents = 0.0, 0.0, np.zeros(2)
        env.step(action)
        d, q = inner._currents * np.array(module.INDUCTANCE)
        assert np.rad2deg(np.arctan2(q, d)) % 360.0 == pytest.approx(wanted, abs=1e-6)
    env.reset(seed=0)
    inner._currents = np.array([10.0, 5.0])
    inner._speed = 0.0
    env.step(0)
    assert (np.abs(inner._currents) < [10.0, 5.0]).all()


def test_eight_leaves_are_a_switching_table_with_what_is_declared_for_the_motor():
    _, env, rule = parts("motor_currents")
    declared = declarations(FOLDER / "motor_currents.txt")
    env = DerivedObservation(env, declared)
    policy = eutree.fit_expert_tree(eutree.record(env, rule, episodes=10, seed=0))
    assert policy.n_leaves <= 8
    seen = np.concatenate([run(env, rule, seed)[0] for seed in range(100, 105)])
    agree = np.mean(policy.predict(seen)[0] == [rule(observation) for observation in seen])
    assert agree > 0.99


def test_the_wall_of_the_room_is_warmed_by_its_air():
    _, env, _ = parts("heated_room")
    env.reset(seed=0)
    inner = env.unwrapped
    inner._air = inner._wall = 20.0
    inner._season, inner._weather = 20.0, 0.0
    inner._outside = lambda: 20.0
    env.step(0)
    assert (inner._air, inner._wall) == (20.0, 20.0)
    for _ in range(3):
        env.step(2)
    assert inner._air > inner._wall > 20.0


def test_amber_lets_nobody_go_and_green_two_of_each_lane():
    module, env, _ = parts("crossing")
    env.reset(seed=0)
    inner = env.unwrapped
    for action, leaves in ((0, True), (2, False), (2, True)):
        inner._waiting = np.full(8, 10)
        inner._coming = np.zeros(8, dtype=np.int64)
        env.step(action)
        served = list(module.PHASES[action])
        expected = 10 - module.DISCHARGE if leaves else 10
        assert (inner._waiting[served] == expected).all()
        assert inner._waiting.sum() == 80 - leaves * 2 * module.DISCHARGE
