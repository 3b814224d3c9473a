"""The small domains: the contract for every one, and what the papers say of each."""

import itertools
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import eutree  # noqa: F401 - registers
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree_lab.tasks import car_on_hill, cheese_maze, maze
from eutree_lab.tasks._domain import ModelledDomain
from eutree_lab.tasks._walls import walk
from eutree_lab.tasks.experts import EXPERTS
from eutree_lab.tasks.registration import TASKS
from tests.envs.cards import HEADINGS

MODELLED = [name for name in TASKS if name in EXPERTS]


def make(name: str, **arguments: Any) -> Any:
    return gymnasium.make(f"eutree/{name}-v0", **arguments).unwrapped


def section(env: Any, heading: str) -> str:
    return type(env).__doc__.split(f"## {heading}\n")[1].split("\n    ## ")[0]


@pytest.mark.parametrize("name", TASKS)
def test_every_domain_keeps_gymnasiums_contract(name: str) -> None:
    env = gymnasium.make(name).unwrapped
    check_env(env)
    seen = []
    for _ in range(2):
        env.action_space.seed(3)
        observations = [env.reset(seed=3)[0].tolist()]
        for _ in range(50):
            observation, _, terminated, truncated, info = env.step(env.action_space.sample())
            assert env.observation_space.contains(observation)
            assert ("ending" in info) == (terminated or truncated)
            observations.append(observation.tolist())
            if terminated or truncated:
                break
        seen.append(observations)
    assert seen[0] == seen[1]


@pytest.mark.parametrize("name", TASKS)
def test_every_card_has_the_headings_and_agrees_with_the_spaces(name: str) -> None:
    env = gymnasium.make(name).unwrapped
    assert re.findall(r"^ *## (.*)$", str(type(env).__doc__), re.MULTILINE) == HEADINGS
    rows = re.findall(r"\| `(\w+)` \| [^|]*\| (-?\d+) \| (-?\d+) \|", section(env, "Observation"
                      " Space"))  # fmt: skip
    assert tuple(row[0] for row in rows) == env.feature_names
    assert [float(row[1]) for row in rows] == env.observation_space.low.tolist()
    assert [float(row[2]) for row in rows] == env.observation_space.high.tolist()
    assert len(env.feature_units) == len(env.feature_names)
    named = re.findall(r"`([a-z ]+)`(?: \(|[,.])", section(env, "Action Space"))
    assert set(named) <= set(env.action_names)
    assert named


@pytest.mark.parametrize("name", TASKS)
def test_every_domain_ends_and_says_what_is_wrong(name: str) -> None:
    env = gymnasium.make(name, trial_limit=1, disable_env_checker=True).unwrapped
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(0)
    env.reset(seed=0)
    with pytest.raises(InvalidArgumentError, match=r"action must be one of 0 \("):
        env.step(len(env.action_names))
    *_, terminated, truncated, info = env.step(0)
    assert truncated or terminated
    assert info["ending"] == "time limit" or terminated
    with pytest.raises(ResetNeeded, match="the episode has ended"):
        env.step(0)
    with pytest.raises(InvalidArgumentError, match="trial_limit must be an integer >= 1, got 0"):
        gymnasium.make(name, trial_limit=0)


@pytest.mark.parametrize("name", TASKS)
def test_every_picture_shows_the_state(name: str) -> None:
    pytest.importorskip("pygame", reason="needs the extra record")
    env = gymnasium.make(name, render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    first = env.render()
    assert first.shape == (400, 400, 3)
    assert (first == env.render()).all()
    state = env.state.copy()
    env.action_space.seed(0)
    while np.abs(env.state[0] - state[0]) < 0.3:
        if not env.step(env.action_space.sample())[2]:
            continue
        env.reset()
    assert (first != env.render()).any()
    with pytest.raises(UnknownNameError, match="rgb_array"):
        type(env)(render_mode="rgb")


def test_a_window_needs_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = pytest.importorskip("pygame", reason="needs the extra record")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make("eutree/MazeA-v0", render_mode="human")
    env.reset(seed=0)
    env.step(0)
    assert pygame.display.get_init()
    env.close()
    assert not pygame.display.get_init()


@pytest.mark.parametrize("name", MODELLED)
def test_a_model_says_what_the_environment_does(name: str) -> None:
    env = gymnasium.make(name).unwrapped
    generator = np.random.default_rng(0)
    for _ in range(20):
        start = generator.uniform(env.observation_space.low, env.observation_space.high)
        action = int(generator.integers(len(env.action_names)))
        env.reset(seed=0, options={"state": start})
        observation, reward, terminated, *_ = env.step(action)
        after, rewards, ends = env.model(start[np.newaxis], np.array([action]))
        assert (after[0].tolist(), rewards[0], ends[0]) == (
            observation.tolist(),
            reward,
            terminated,
        )
    with pytest.raises(InvalidArgumentError, match=r"options\['state'\] must have 2 entries"):
        env.reset(options={"state": [0.0]})


@pytest.mark.parametrize("name", MODELLED)
def test_experts_reach_the_goal(name: str) -> None:
    env: ModelledDomain = gymnasium.make(name).unwrapped
    for expert in EXPERTS[name].values():
        policy, endings = expert(env), []
        for seed in range(20):
            observation, _ = env.reset(seed=seed)
            while True:
                action, _ = policy.predict(observation)
                observation, _, terminated, truncated, info = env.step(int(action))
                if terminated or truncated:
                    endings.append(info["ending"])
                    break
        least = 8 if "Car" in name else 20  # from half of its states the car cannot be stopped
        assert endings.count("goal") >= least, endings
        with pytest.raises(InvalidArgumentError, match="for this expert, got"):
            expert(gymnasium.make("CartPole-v1"))


def test_a_step_in_a_maze_is_halted_at_the_wall() -> None:
    env = make("MazeD", maze="d")
    north, east, south = 0, 2, 4
    env.reset(options={"state": [5.0, 2.04]})
    halted = [env.step(south)[0] for _ in range(3)]
    for observation in halted:  # pushing on does not help
        np.testing.assert_allclose(observation, [5.0, 2.0], atol=2e-6)
        assert observation[1] > 2.0
    assert env.step(east)[0][0] == pytest.approx(5.1)  # one can go along it
    assert env.step(north)[0][1] == pytest.approx(2.1, abs=1e-5)
    env.reset(options={"state": [1.9, 2.04]})
    assert env.step(south)[0].tolist() == pytest.approx([1.9, 1.94])  # beside its end


def test_no_walk_leads_through_a_wall() -> None:
    """No step crosses a wall, by the signs of areas instead of by solving for the point."""
    generator = np.random.default_rng(1)
    for name in "abcd":
        env = make(f"Maze{name.upper()}")
        walls = env._walls
        place = np.full((200, 2), env.reset(seed=0)[0])
        for _ in range(300):
            after = walk(walls, place, maze.MOVES[generator.integers(8, size=200)])
            assert not crossed(walls, place, after).any()
            place = after
        assert place.std(axis=0).min() > 0.5  # they got somewhere


def crossed(walls: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    def side(p: Any, q: Any, r: Any) -> Any:
        return np.sign(
            (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1])
            - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])
        )

    a, b = walls[np.newaxis, :, :2], walls[np.newaxis, :, 2:]
    p, q = start[:, np.newaxis], end[:, np.newaxis]
    return (side(a, b, p) * side(a, b, q) < 0) & (side(p, q, a) * side(p, q, b) < 0)


def test_noise_moves_a_maze_s_steps_by_its_share() -> None:
    env = make("MazeC", noise=0.2)
    env.reset(seed=5)
    ends = []
    for seed in range(400):
        env.reset(seed=seed, options={"state": [3.0, 8.0]})
        ends.append(env.step(2)[0] - [3.1, 8.0])
    error = 3.0 * 0.02 / np.sqrt(2 * 800)  # three standard errors of a standard deviation
    assert np.std(ends) == pytest.approx(0.02, abs=error)


def test_the_puck_has_to_take_a_run_up() -> None:
    env = make("Puck")
    env.reset()
    places = [float(env.step(2)[0][0]) for _ in range(200)]
    assert 3.0 < max(places) < 12.0  # thrust alone does not carry it up
    assert places[-1] < max(places)
    env.reset(options={"state": [16.0, 0.0]})
    assert env.step(1)[2]
    env.reset(options={"state": [-19.9, -5.0]})
    assert env.step(1)[4]["ending"] == "crash"


def test_car_on_hill_has_the_acceleration_of_the_paper() -> None:
    env = make("CarOnHill", time_step=1e-3)
    for y, v, u in itertools.product((-0.9, -0.5, 0.3, 0.8), (-1.0, 0.5), (0, 1)):
        slope = 2 * y + 1 if y < 0 else 1 / np.sqrt(1 + 5 * y**2) - 5 * y**2 / (
            1 + 5 * y**2) ** 1.5  # fmt: skip
        pull = 4.0 * (2 * u - 1) / np.sqrt(1 + slope**2) - 9.81 * slope / (1 + slope**2)
        after, _, _ = env.model(np.array([[y, v]]), np.array([u]))
        assert (after[0, 1] - v) / 1e-3 == pytest.approx(pull, rel=1e-9)


def test_car_on_hill_pays_for_arriving_slowly() -> None:
    env = make("CarOnHill")
    assert env.discount == pytest.approx(0.6**0.02)
    states = np.array([[0.999, 0.1], [0.999, 3.9], [-0.999, -1.0], [-0.45, 3.99]])
    _, rewards, ends = env.model(states, np.array([1, 1, 0, 1]))
    assert rewards[0] == pytest.approx(1 - 0.1 / 2, abs=0.05)
    assert rewards[1] == pytest.approx(1 - 3.9 / 2, abs=0.05)
    assert rewards[2:].tolist() == [-1.0, -1.0]
    assert ends.all()
    assert car_on_hill.DISCOUNT_PER_SECOND == 0.6


def test_cheese_maze_has_seven_views_of_eleven_cells() -> None:
    views = [tuple(view) for view in cheese_maze.VIEWS.tolist()]
    named = [views.index(view) for view in views]
    rows = "12324555676"
    for i, j in itertools.product(range(11), repeat=2):
        assert (named[i] == named[j]) == (rows[i] == rows[j])


def test_cheese_maze_s_best_policy_earns_what_its_card_says() -> None:
    """Relative value iteration over what can be known of the cell; from beliefs as sets."""
    views = [tuple(view) for view in cheese_maze.VIEWS.tolist()]
    others = frozenset(range(11)) - {cheese_maze.CHEESE}

    def seen(cells: frozenset) -> list[tuple[float, frozenset]]:
        groups: dict = {}
        for cell in cells:
            groups.setdefault(views[cell], set()).add(cell)
        return [(len(group) / len(cells), frozenset(group)) for group in groups.values()]

    def outcomes(belief: frozenset, action: int) -> list[tuple[float, float, frozenset]]:
        if belief == {cheese_maze.CHEESE}:
            return [(share, 0.0, group) for share, group in seen(others)]
        # All cells of a belief look alike, so none or all of them run into a wall.
        to = {int(cheese_maze.WAYS[cell, action]) for cell in belief}
        if to == set(belief) and cheese_maze.VIEWS[next(iter(belief)), action]:
            return [(1.0, -10.0, belief)]
        return [
            (share, 10.0 if group == {cheese_maze.CHEESE} else -1.0, group)
            for share, group in seen(frozenset(to))
        ]

    assert best_gain([group for _, group in seen(others)], outcomes, 4) == pytest.approx(
        6.7 / 5.3, abs=1e-6
    )


def test_the_best_of_the_1d_maze_and_of_tiger_is_what_their_cards_say() -> None:
    def corridor(belief: frozenset, action: int) -> list[tuple[float, float, frozenset]]:
        to = [min(max(cell + (1 if action else -1), 0), 3) for cell in belief]
        missed = frozenset(cell for cell in to if cell != 2)
        found = to.count(2) / len(to)
        rest = [(1.0 - found, 0.0, missed)] if missed else []
        return [(found, 1.0, frozenset({0, 1, 3})), *rest]

    # The beliefs that occur are sets of equally likely cells: no two cells meet but at an end.
    assert best_gain([frozenset({0, 1, 3})], corridor, 2) == pytest.approx(0.5, abs=1e-6)

    def tiger(surplus: int, action: int) -> list[tuple[float, float, int]]:
        right = 1.0 / (1.0 + (0.15 / 0.85) ** surplus)  # chance that the tiger is right
        if action == 0:
            heard = right * 0.85 + (1 - right) * 0.15
            return [(heard, -1.0, min(surplus + 1, 8)), (1 - heard, -1.0, max(surplus - 1, -8))]
        hit = right if action == 2 else 1.0 - right
        return [(1.0, 10.0 - 110.0 * hit, 0)]

    gain = best_gain([0], tiger, 3)
    assert gain == pytest.approx(1.0837, abs=1e-4)


def best_gain(starts: list, outcomes: Any, n_actions: int) -> float:
    """Return the best average reward per step, by damped relative value iteration."""
    states, queue = list(dict.fromkeys(starts)), list(starts)
    while queue:
        belief = queue.pop()
        for action in range(n_actions):
            for _, _, after in outcomes(belief, action):
                if after not in states:
                    states.append(after)
                    queue.append(after)
    number = {state: i for i, state in enumerate(states)}
    table = [
        [[(p, r, number[s]) for p, r, s in outcomes(state, a)] for a in range(n_actions)]
        for state in states
    ]
    values = np.zeros(len(states))
    for _ in range(3000):
        best = [max(sum(p * (r + values[s]) for p, r, s in out) for out in row) for row in table]
        change = np.array(best) - values
        values = values + 0.5 * change
        values -= values[0]
        if np.ptp(change) < 1e-9:
            break
    return float(change.mean())


def test_the_simulated_tiger_and_corridor_earn_it_too() -> None:
    env = make("Tiger", trial_limit=60_000)
    heard, total = 0, 0.0
    env.reset(seed=0)
    for _ in range(60_000):
        action = 0 if abs(heard) < 2 else (1 if heard > 0 else 2)
        observation, reward, *_ = env.step(action)
        heard = heard + int(observation[0]) if action == 0 else 0
        total += reward
    assert total / 60_000 == pytest.approx(1.084, abs=0.2)  # three standard errors: 17 / sqrt(6e4)
    env = make("Maze1D", trial_limit=20_000)
    env.reset(seed=0)
    total, place = 0.0, 0
    for _ in range(20_000):
        observation, reward, *_ = env.step((1, 1, 0)[place])
        total, place = total + reward, 0 if observation[0] else (place + 1) % 3
    assert total / 20_000 == pytest.approx(0.5, abs=0.011)
