"""Kuhn interpolation, the process over corners, influence and variance, by other ways."""

import itertools
import math
from typing import Any

import gymnasium
import numpy as np
import pytest

import eutree  # noqa: F401 - registers
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.trees import DecisionTree
from eutree_lab.vrd.corner_process import KnownWorld, Solved, rows, solved
from eutree_lab.vrd.influence import CRITERIA, influence, refined, variance
from eutree_lab.vrd.kuhn import Grid
from tests.lab.methods.worlds import mountain_car, random_tree


def random_grid(seed: int, d: int, n_splits: int = 12) -> tuple[np.random.Generator, Grid]:
    generator = np.random.default_rng(seed)
    return generator, Grid.of(random_tree(generator, d, n_splits), np.zeros(d), np.ones(d))


def hills(states: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A drift in a unit box that ends beyond its right side, the better the lower it is left."""
    push = np.where(actions == 0, -1.0, 1.0)
    moved = states.copy()
    moved[:, 0] += 0.03 + 0.05 * states[:, -1]
    moved[:, -1] += 0.06 * push
    out = moved[:, 0] > 1.0
    reward = np.where(out, 1.0 - 2.0 * np.abs(moved[:, -1] - 0.3), -0.01)
    return np.clip(moved, 0.0, 1.0), reward, 1.0 - out


HILLS = KnownWorld(hills, 2, 0.95)


@pytest.mark.parametrize(("d", "seed"), [(d, seed) for d in (1, 2, 3, 5) for seed in range(4)])
def test_weights_are_a_partition_of_unity_exact_on_affine_functions(d: int, seed: int) -> None:
    generator, grid = random_grid(seed, d)
    points = np.concatenate([generator.random((200, d)), grid.corners])
    corner, weight = grid.weights(points)
    assert (weight >= 0.0).all()
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, atol=1e-12)
    slope = generator.standard_normal(d)
    np.testing.assert_allclose(
        grid.interpolate(grid.corners @ slope + 0.7, points), points @ slope + 0.7, atol=1e-10
    )
    values = generator.standard_normal(grid.n_corners)
    leaf = grid.tree.leaf_index(points)
    for n in range(len(points)):  # a corner of the point's own box keeps its value
        same = [c for c in grid.corner_of[leaf[n]] if (grid.corners[c] == points[n]).all()]
        if same:
            assert grid.interpolate(values, points[[n]])[0] == values[same[0]]
    assert corner.shape == (len(points), d + 1)


def barycentric(grid: Grid, values: np.ndarray, point: np.ndarray) -> float:
    """Find the simplex by trying all orders of the axes, and solve for the weights."""
    d = point.size
    box = int(grid.tree.leaf_index(point[np.newaxis])[0])
    for order in itertools.permutations(range(d)):
        codes = np.cumsum([0, *(1 << axis for axis in order)])
        vertices = grid.corners[grid.corner_of[box, codes]]
        system = np.vstack([vertices.T, np.ones(d + 1)])
        weight = np.linalg.solve(system, np.append(point, 1.0))
        if (weight >= -1e-9).all():
            return float(weight @ values[grid.corner_of[box, codes]])
    raise AssertionError("no simplex holds the point")


@pytest.mark.parametrize(("d", "seed"), [(d, seed) for d in (2, 3, 4) for seed in range(3)])
def test_weights_are_those_of_the_barycentric_system(d: int, seed: int) -> None:
    generator, grid = random_grid(seed, d)
    values = generator.standard_normal(grid.n_corners)
    points = generator.random((30, d))
    expected = [barycentric(grid, values, point) for point in points]
    np.testing.assert_allclose(grid.interpolate(values, points), expected, atol=1e-9)


def test_the_triangulation_is_kuhn_s_and_not_multilinear() -> None:
    grid = Grid.of(DecisionTree.single_leaf(2), [0, 0], [1, 1])
    product = grid.corners.prod(axis=1)
    assert grid.interpolate(product, [[0.5, 0.5]])[0] == 0.5  # multilinear: 1/4
    assert grid.interpolate(product, [[0.3, 0.8]])[0] == pytest.approx(0.3)


def test_a_uniform_grid_is_continuous_and_hanging_corners_are_not() -> None:
    generator = np.random.default_rng(0)
    uniform = Grid.uniform([0, 0], [1, 1], (2, 2))
    assert uniform.n_corners == 25
    hanging = Grid.of(DecisionTree.single_leaf(2).split(0, 0, 0.5).split(1, 1, 0.5), [0, 0], [1, 1])
    jumps = []
    for grid in (uniform, hanging):
        values = generator.standard_normal(grid.n_corners)
        y = generator.random(500)
        sides = [np.stack([np.full(500, x), y], axis=1) for x in (0.5, np.nextafter(0.5, 1.0))]
        apart = grid.interpolate(values, sides[0]) - grid.interpolate(values, sides[1])
        jumps.append(np.abs(apart).max())
    assert jumps[0] < 1e-8
    assert jumps[1] > 0.1


def test_the_process_is_the_held_actions_of_the_world() -> None:
    """Against a loop that walks one corner at a time."""
    _, grid = random_grid(1, 2)
    process = rows(grid, HILLS, grid.corners)
    for c, u in itertools.product(range(grid.n_corners), range(2)):
        place, weight, earned, first = grid.corners[[c]], 1.0, 0.0, None
        for _ in range(HILLS.longest):
            place, reward, goes_on = hills(place, np.array([u]))
            earned += weight * reward[0]
            weight *= HILLS.discount * goes_on[0]
            box = grid.tree.leaf_index(place)[0]
            first = box if first is None else first
            if weight == 0.0 or box != first:
                break
        assert process.reward[c, u] == pytest.approx(earned)
        assert process.discount[c, u] == pytest.approx(weight)
        assert process.leaf[c, u] == grid.tree.leaf_index(place)[0]


def dense(solution: Solved) -> tuple[np.ndarray, np.ndarray]:
    """Return discounted P of the greedy policy, [C, C], and R, [C]."""
    successor, weight, discount, reward = solution.process.chosen(solution.policy)
    matrix = np.zeros((len(reward), len(reward)))
    for x in range(len(reward)):
        np.add.at(matrix[x], successor[x], discount[x] * weight[x])
    return matrix, reward


@pytest.mark.parametrize("seed", range(4))
def test_solved_values_are_those_of_value_iteration_with_discounts_per_pair(seed: int) -> None:
    _, grid = random_grid(seed, 2, 20)
    solution = solved(grid, HILLS, tolerance=1e-9)
    values = np.zeros(grid.n_corners)
    for _ in range(2000):
        values = solution.process.action_values(values).max(axis=1)
    np.testing.assert_allclose(solution.values, values, atol=1e-8)
    matrix, reward = dense(solution)
    np.testing.assert_allclose(
        np.linalg.solve(np.eye(len(reward)) - matrix, reward), values, atol=1e-8
    )
    assert solution.converged
    again = solved(grid, HILLS, before=solution, initial_policy=solution.policy, tolerance=1e-9)
    np.testing.assert_allclose(again.values, values, atol=1e-8)
    assert (solution.actions(HILLS, grid.corners) == solution.policy).mean() > 0.95  # ties


def test_influence_is_the_derivative_of_values_and_a_column_of_the_inverse() -> None:
    _, grid = random_grid(2, 2, 10)
    solution = solved(grid, HILLS)
    matrix, reward = dense(solution)
    n = len(reward)
    assert n <= 50
    inverse = np.linalg.inv(np.eye(n) - matrix)
    one = np.eye(n)
    on = [influence(solution, one[x]) for x in range(n)]
    np.testing.assert_allclose(on, inverse, atol=1e-8)
    for y in range(0, n, 5):  # dV / dR(y), for all x at once
        more = np.linalg.solve(np.eye(n) - matrix, reward + 1e-6 * one[y])
        less = np.linalg.solve(np.eye(n) - matrix, reward - 1e-6 * one[y])
        np.testing.assert_allclose((more - less) / 2e-6, np.array(on)[:, y], atol=1e-7)
    both = influence(solution, one[1] + one[4])
    np.testing.assert_allclose(both, on[1] + on[4], atol=1e-8)  # additive in the set
    steps = np.linalg.solve(np.eye(n) - matrix, np.ones(n))  # expected discounted steps
    np.testing.assert_allclose(np.sum(on, axis=1), steps, atol=1e-7)


def test_variance_is_that_of_simulated_chains() -> None:
    generator, grid = random_grid(4, 2, 10)
    solution = solved(grid, HILLS)
    found = variance(solution)
    assert found.max() > 1e-3
    start = int(found.argmax())
    successor, weight, discount, reward = solution.process.chosen(solution.policy)
    cumulative = weight.cumsum(axis=1)
    n = 20_000
    at, earned, worth = np.full(n, start), np.zeros(n), np.ones(n)
    for _ in range(400):
        earned += worth * reward[at]
        worth *= discount[at]
        draw = (generator.random(n)[:, np.newaxis] > cumulative[at]).sum(axis=1)
        at = successor[at, np.minimum(draw, weight.shape[1] - 1)]
    error = 3.0 * np.std((earned - earned.mean()) ** 2) / math.sqrt(n)
    assert earned.var() == pytest.approx(found[start], abs=error)


def test_no_interpolation_no_variance_and_it_scales_with_the_square() -> None:
    def chain(states: np.ndarray, actions: np.ndarray) -> Any:
        moved = np.minimum(states + 0.25, 1.0)  # from corner to corner
        return moved, moved[:, 0] ** 2, 1.0 - (moved[:, 0] >= 1.0)

    grid = Grid.uniform([0.0], [1.0], (2,))
    exact = solved(grid, KnownWorld(chain, 1, 0.9, longest=1))
    assert variance(exact).tolist() == [0.0] * 5
    _, grid = random_grid(4, 2, 10)

    def scaled(states: np.ndarray, actions: np.ndarray) -> Any:
        moved, reward, goes_on = hills(states, actions)
        return moved, 3.0 * reward, goes_on

    once, thrice = solved(grid, HILLS), solved(grid, KnownWorld(scaled, 2, 0.95))
    assert once.policy.tolist() == thrice.policy.tolist()
    np.testing.assert_allclose(variance(thrice), 9.0 * variance(once), rtol=1e-6, atol=1e-12)


def with_values(solution: Solved, values: np.ndarray) -> Solved:
    return Solved(solution.grid, solution.process, values, solution.policy, True)


def test_criteria_ignore_what_they_should() -> None:
    generator, grid = random_grid(5, 3, 20)
    base = solved(grid, HILLS)
    x = grid.corners
    additive = np.sin(3 * x[:, 0]) + x[:, 1] ** 3 + np.exp(x[:, 2])
    product = x[:, 0] * x[:, 1]
    none = np.empty((0, 3))
    assert CRITERIA["nonlinearity"](with_values(base, additive), none).max() < 1e-20
    assert CRITERIA["nonlinearity"](with_values(base, product), none).max() > 1e-3
    assert CRITERIA["average"](with_values(base, np.ones(len(x))), none).max() == 0.0
    values = generator.standard_normal(len(x))
    for name in ("average", "nonlinearity"):
        one = CRITERIA[name](with_values(base, values), none)
        other = CRITERIA[name](with_values(base, values + 5.0), none)
        np.testing.assert_allclose(one, other, atol=1e-12)
    ramp = CRITERIA["average"](with_values(base, 2.0 * x[:, 1]), none)
    np.testing.assert_allclose(ramp[:, 1], 2.0 * (grid.high - grid.low)[:, 1])
    assert (ramp.argmax(axis=1) == 1).all()


@pytest.mark.parametrize("criterion", CRITERIA)
def test_every_criterion_halves_what_scores_highest(criterion: str) -> None:
    grid = Grid.uniform([0, 0], [1, 1], (2, 2))
    solution = solved(grid, HILLS)
    starts = np.array([[0.05, 0.5], [0.1, 0.4]])
    scores = CRITERIA[criterion](solution, starts)
    assert scores.shape == (16, 2)
    assert (scores >= 0.0).all()
    finer = refined(solution, criterion, 0.25, starts)
    assert len(grid.low) < len(finer.low) <= len(grid.low) + 4
    volume = np.prod(finer.high - finer.low, axis=1)
    assert volume.sum() == pytest.approx(1.0)
    split = np.flatnonzero(volume[: len(grid.low)] < 1.0 / 16)
    rest = np.setdiff1d(np.arange(16), split)
    assert scores[split].max(axis=1).min() >= scores[rest].max(axis=1).max() - 1e-12


def test_starts_say_where_to_refine() -> None:
    """What starts at the bottom is not refined where only trajectories from the top pass."""

    def lanes(states: np.ndarray, actions: np.ndarray) -> Any:
        moved = states + np.array([0.04, 0.0])
        out = moved[:, 0] > 1.0
        kinks = np.abs(np.sin(9.0 * states[:, 1])) * 0.1
        return np.clip(moved, 0, 1), kinks + out * np.cos(7 * states[:, 1]), 1.0 - out

    grid = Grid.uniform([0, 0], [1, 1], (3, 3))
    solution = solved(grid, KnownWorld(lanes, 1, 0.97))
    finer = refined(solution, "starts", 0.2, np.array([[0.02, 0.05]]))
    changed = np.flatnonzero((finer.high - finer.low).prod(axis=1) < 1 / 64)
    assert changed.size
    assert finer.high[changed, 1].max() <= 0.25 + 1e-9


def test_finer_grids_come_nearer_to_a_known_solution() -> None:
    """1-D: x' = -x, reward x: V(x) = x / (1 - discount (1 - dt)), and linear values are exact."""

    def decay(states: np.ndarray, actions: np.ndarray) -> Any:
        return 0.9 * states, (states**2)[:, 0], np.ones(len(states))

    discount, errors = 0.9, []
    x = np.linspace(0.0, 1.0, 101)[:, np.newaxis]
    exact = x[:, 0] ** 2 / (1.0 - discount * 0.81)
    for halvings in (2, 3, 4, 5, 6):
        solution = solved(Grid.uniform([0.0], [1.0], (halvings,)), KnownWorld(decay, 1, discount))
        errors.append(np.abs(solution.grid.interpolate(solution.values, x) - exact).max())
    assert all(fine < 0.8 * coarse for coarse, fine in itertools.pairwise(errors)), errors
    assert errors[-1] < 0.1 * errors[0], errors


def car(n_steps: int = 400) -> tuple[Any, KnownWorld, Any]:
    env = gymnasium.make("eutree/CarOnHill-v0").unwrapped

    def dynamics(states: np.ndarray, actions: np.ndarray) -> Any:
        after, rewards, ends = env.model(states, actions)
        return after, rewards, 1.0 - ends

    world = KnownWorld(dynamics, 2, env.discount)

    def mean_return(solution: Solved) -> float:
        low, high = env.observation_space.low, env.observation_space.high
        states = np.random.default_rng(0).uniform(low, high, (128, 2))
        total, worth = np.zeros(128), np.ones(128)
        for _ in range(n_steps):
            going = np.flatnonzero(worth > 0.0)
            if not going.size:
                break
            actions = solution.actions(world, states[going])
            states[going], rewards, goes_on = dynamics(states[going], actions)
            total[going] += worth[going] * rewards
            worth[going] *= env.discount * goes_on
        return float(total.mean())

    return env, world, mean_return


def test_on_car_on_the_hill_refined_boxes_beat_uniform_ones_twice_as_many() -> None:
    env, world, mean_return = car()
    low, high = env.observation_space.low, env.observation_space.high
    solution = solved(Grid.uniform(low, high, (3, 3)), world)
    while solution.grid.n_corners < 200:
        finer = refined(solution, "average", 0.2, np.empty((0, 2)))
        solution = solved(finer, world, before=solution)
    assert solution.grid.n_corners < 230
    uniform = solved(Grid.uniform(low, high, (5, 4)), world)
    assert uniform.grid.n_corners > 2 * solution.grid.n_corners
    assert mean_return(solution) >= mean_return(uniform)


LOW, HIGH = np.array([-1.2, -0.07]), np.array([0.6, 0.07])  # of MountainCar
STARTS = np.column_stack([np.linspace(-0.6, -0.4, 40), np.zeros(40)])


def steps_needed(solution: Solved, world: KnownWorld) -> float:
    """Return the mean number of steps from the starts to the flag, 200 at most."""
    states, needed = STARTS.copy(), np.full(len(STARTS), 200.0)
    for step in range(1, 201):
        states, _, goes_on = mountain_car(states, solution.actions(world, states))
        needed[(goes_on == 0.0) & (needed == 200.0)] = step
    return float(needed.mean())


def test_mountain_car_here_is_that_of_gymnasium() -> None:
    env: Any = gymnasium.make("MountainCar-v0").unwrapped
    env.reset(seed=0)
    generator = np.random.default_rng(0)
    states = generator.uniform(LOW, HIGH, (200, 2))
    states[:20, 0] = LOW[0]
    actions = generator.integers(3, size=200)
    after, rewards, goes_on = mountain_car(states, actions)
    for i in range(200):
        env.state = states[i]
        observed, reward, terminated, _, _ = env.step(int(actions[i]))
        assert observed == pytest.approx(after[i], abs=1e-6)
        assert (reward, terminated) == (rewards[i], goes_on[i] == 0.0)


def test_on_mountain_car_refining_for_the_starts_comes_near_a_grid_of_129_x_129() -> None:
    world = KnownWorld(mountain_car, 3, 0.99)
    exact = solved(Grid.uniform(LOW, HIGH, (7, 7)), world)
    found = {}
    for criterion in ("starts", "average"):
        solution = solved(Grid.uniform(LOW, HIGH, (4, 4)), world)
        while solution.grid.n_corners < 900:
            finer = refined(solution, criterion, 0.2, STARTS)
            solution = solved(finer, world, before=solution)
        found[criterion] = steps_needed(solution, world)
        assert solution.grid.n_corners < 1100  # of 16,641
    best = steps_needed(exact, world)
    assert best == pytest.approx(98, abs=1.5)
    assert found["starts"] < 1.03 * best
    assert found["average"] > 1.05 * best  # value differs where no decision does


def test_mistakes_are_said() -> None:
    with pytest.raises(InvalidArgumentError, match=r"at most 6 features .* got 7"):
        Grid.of(DecisionTree.single_leaf(7), np.zeros(7), np.ones(7))
    with pytest.raises(InvalidArgumentError, match="high must be finite"):
        Grid.of(DecisionTree.single_leaf(1), [0.0], [np.inf])
    with pytest.raises(InvalidArgumentError, match="every leaf of the tree must meet the inside"):
        Grid.of(DecisionTree.single_leaf(1).split(0, 0, 2.0), [0.0], [1.0])
    solution = solved(Grid.uniform([0, 0], [1, 1], (1, 1)), HILLS)
    with pytest.raises(UnknownNameError, match="stdev_inf"):
        refined(solution, "stdev", 0.1, np.empty((0, 2)))
    with pytest.raises(InvalidArgumentError, match="'starts' must have demonstrated starts"):
        refined(solution, "starts", 0.1, np.empty((0, 2)))
    line = solved(Grid.uniform([0.0], [1.0], (2,)), HILLS)
    with pytest.raises(InvalidArgumentError, match="'nonlinearity' must have at least 2 features"):
        refined(line, "nonlinearity", 0.1, np.empty((0, 1)))
