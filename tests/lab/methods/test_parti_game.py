"""Parti-game against slow twins, against what its authors prove, and in the thesis's mazes."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.trees import DecisionTree
from eutree_lab.parti_game import losing_cells
from eutree_lab.parti_game.cells import GOAL, Cells
from eutree_lab.parti_game.displacements import LearnedController
from eutree_lab.parti_game.game import CUT_SHORT, GOES_ON, GameRules, PartiGame
from eutree_lab.parti_game.outcomes import (
    EXPERT,
    LOST,
    Outcomes,
    aims,
    costs,
    expert_outcomes,
    wilson,
)
from tests.lab.methods.worlds import (
    MOVES,
    Ball,
    GivenController,
    maze_game,
    random_tree,
    trial,
    whole,
)

INF = math.inf
Hypergraph = tuple[np.ndarray, np.ndarray, Outcomes]


def hypergraph(generator: np.random.Generator, n_cells: int, most: int = 3) -> Hypergraph:
    """Return aims of every cell, at most so many, and what may come of each."""
    cell, aim, outcomes = [], [], Outcomes()
    for i in range(n_cells):
        for j in range(int(generator.integers(1, most + 1))):
            cell.append(i)
            aim.append(100 + j)
            for _ in range(int(generator.integers(1, 4))):
                arrived = int(generator.choice([*range(n_cells), GOAL, LOST]))
                outcomes.add((i, 100 + j, arrived), np.zeros(1))
    return np.array(cell), np.array(aim), outcomes


def fixed_point(n_cells: int, graph: Hypergraph) -> np.ndarray:
    """Iterate the definition of J from 0 upwards until nothing changes."""
    cell, aim, outcomes = graph
    values = np.zeros(n_cells)
    for _ in range(n_cells + 2):
        best = np.full(n_cells, INF)
        for i, j in zip(cell.tolist(), aim.tolist(), strict=True):
            worst = max(
                0.0 if k == GOAL else INF if k == LOST else values[k] for k in outcomes.of(i, j)
            )
            best[i] = min(best[i], 1.0 + worst)
        values = np.where(best > n_cells, INF, best)  # no proper way is longer
    return values


def brute_force(n_cells: int, graph: Hypergraph) -> np.ndarray:
    """Try every way to aim against every adversary that answers aims always alike."""
    cell, aim, outcomes = graph
    choices = [[int(j) for i, j in zip(cell, aim, strict=True) if i == k] for k in range(n_cells)]
    best = np.full(n_cells, INF)
    for chosen in itertools.product(*choices):
        answers = [outcomes.of(i, j) for i, j in enumerate(chosen)]
        worst = np.zeros(n_cells)
        for reply in itertools.product(*answers):
            for start in range(n_cells):
                steps, at = 0, start
                while at not in (GOAL, LOST) and steps <= n_cells:
                    at, steps = reply[at], steps + 1
                worst[start] = max(worst[start], steps if at == GOAL else INF)
        best = np.minimum(best, worst)
    return best


@pytest.mark.parametrize("seed", range(60))
def test_costs_are_those_of_the_definition_and_of_brute_force(seed: int) -> None:
    generator = np.random.default_rng(seed)
    n_cells = int(generator.integers(1, 6))
    graph = hypergraph(generator, n_cells)
    found = costs(n_cells, *graph).cost
    assert found[-1] == 0.0
    assert found[:-1].tolist() == fixed_point(n_cells, graph).tolist()
    assert found[:-1].tolist() == brute_force(n_cells, graph).tolist()


@pytest.mark.parametrize("seed", range(20))
def test_a_further_outcome_never_lowers_a_cost(seed: int) -> None:
    generator = np.random.default_rng(seed)
    cell, aim, outcomes = hypergraph(generator, 30)
    before = costs(30, cell, aim, outcomes).cost
    which = int(generator.integers(len(cell)))
    outcomes.add((int(cell[which]), int(aim[which]), int(generator.integers(30))), np.zeros(1))
    assert (costs(30, cell, aim, outcomes).cost >= before).all()


@pytest.mark.parametrize("seed", range(10))
def test_best_aims_reach_the_goal_in_as_many_steps_as_promised(seed: int) -> None:
    generator = np.random.default_rng(seed)
    graph = hypergraph(generator, 12, most=12)
    plan = costs(12, *graph)
    assert np.isfinite(plan.cost[:-1]).any()
    for start in np.flatnonzero(np.isfinite(plan.cost[:-1])).tolist():
        at, steps = start, 0
        while at != GOAL:
            at = int(generator.choice(graph[2].of(at, plan.best_aim(at))))
            steps += 1
        assert steps <= plan.cost[start]


@pytest.mark.parametrize(("d", "seed"), [(d, seed) for d in (1, 2, 3) for seed in range(5)])
def test_neighbours_share_a_face(d: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    cells = Cells.of(
        random_tree(generator, d, 40), np.zeros(d), np.ones(d), whole(d).goals
    )  # fmt: skip
    n = len(cells)
    shared, areas = np.zeros((n, n)), np.zeros(n)
    for i, j in itertools.permutations(range(n), 2):
        for axis in range(d):
            others = [k for k in range(d) if k != axis]
            overlap = [
                min(cells.high[i, k], cells.high[j, k]) - max(cells.low[i, k], cells.low[j, k])
                for k in others
            ]
            meets = cells.high[i, axis] == cells.low[j, axis]
            if (meets or cells.low[i, axis] == cells.high[j, axis]) and min(overlap, default=1) > 0:
                shared[i, j] += math.prod(overlap)
    for i in range(n):
        assert cells.neighbours[i].tolist() == np.flatnonzero(shared[i] > 0).tolist()
        for axis in range(d):
            sides = np.delete(cells.high[i] - cells.low[i], axis)
            ends = int(cells.low[i, axis] > 0.0) + int(cells.high[i, axis] < 1.0)
            areas[i] += float(sides.prod()) * ends
    assert (shared == shared.T).all()
    np.testing.assert_allclose(shared.sum(axis=1), areas)


def test_splitting_one_after_another_is_splitting_the_whole() -> None:
    generator = np.random.default_rng(3)
    tree = random_tree(generator, 2, 60)
    grown = whole(2)
    for _ in range(30):
        grown = grown.halve(generator.choice(len(grown), size=min(3, len(grown)), replace=False))
    made = Cells.of(grown.tree, np.zeros(2), np.ones(2), grown.goals)
    for one, other in zip(grown.neighbours, made.neighbours, strict=True):
        assert one.tolist() == other.tolist()
    assert grown.low.tolist() == made.low.tolist()
    assert grown.volumes.sum() == pytest.approx(1.0)
    assert tree.n_leaves == 61


def test_a_leaf_outside_of_the_box_is_nobodys_neighbour() -> None:
    tree = DecisionTree.single_leaf(2).split(0, 0, 2.0)  # x > 2 lies beyond the unit square
    cells = Cells.of(tree, np.zeros(2), np.ones(2), whole(2).goals)
    assert [row.tolist() for row in cells.neighbours] == [[], []]
    assert cells.beside_goal.tolist() == [True, False]


def random_play(seed: int, variant: str) -> PartiGame:
    """Return a game after random outcomes and splits of a partition of the square."""
    generator = np.random.default_rng(seed)
    cells = Cells.of(random_tree(generator, 2, 12), np.zeros(2), np.ones(2), whole(2).goals)
    game = PartiGame(
        cells, GivenController(lambda o: MOVES, np.ones(2)), GameRules(variant=variant)
    )
    start, aim = aims(cells, expert=False)
    for i, j in zip(start.tolist(), aim.tolist(), strict=True):
        if generator.random() < 0.8:
            game.own.add((i, j, int(generator.choice([i, *cells.neighbours[i]]))), np.zeros(2))
    game._recost()
    return game


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("variant", losing_cells.VARIANTS)
def test_a_split_is_at_the_border_and_leaves_no_dead_triples(variant: str, seed: int) -> None:
    game = random_play(seed, variant)
    before, plan = game.cells, game.plan()
    losing = plan.losing
    assert losing.any()
    edge = losing_cells.border(before, plan).tolist()
    assert edge  # cells are connected, and the goal is beside one of them
    chosen = losing_cells.cells_to_split(before, plan, variant).tolist()
    for cell in chosen:
        near = [*before.neighbours[cell].tolist()]
        assert (cell in edge) or (variant == "pg" and set(near) & set(edge) and not losing[cell])
    for cell in edge:
        beside = before.beside_goal[cell] or not losing[before.neighbours[cell]].all()
        assert losing[cell] and beside  # noqa: PT018 - one thing
    if variant == "llppg":
        largest = before.volumes[edge].max()
        expected = [c for c in edge if before.volumes[c] == pytest.approx(largest)]
        assert chosen == expected
    else:
        assert set(edge) <= set(chosen)
    assert game._split()
    assert len(game.cells) == len(before) + len(chosen)
    assert game.cells.volumes.sum() == pytest.approx(1.0)
    assert (game.cells.goals == before.goals).all()
    dead = {*chosen, *range(len(before), len(game.cells))}
    for (cell, aim), counts in game.own.arrivals.items():
        assert not dead & {cell, aim, *counts}


def ball_trial(
    game: PartiGame, ball: Ball, start: tuple[float, float], limit: int = 5000
) -> tuple[int, bool]:
    place, generator = np.array(start), np.random.default_rng(0)
    game.begin()
    for step in range(1, limit + 1):
        action = game.act(place, generator)
        after, inside = ball.step(place, action)
        game.observe(place, action, after, GOAL if inside else GOES_ON)
        place = after
        if inside or game.exhausted:
            return step, inside
    return limit, False


@pytest.mark.parametrize("variant", losing_cells.VARIANTS)
def test_nothing_in_the_way_nothing_to_split(variant: str) -> None:
    controller = GivenController(lambda o: 0.5 * MOVES, np.ones(2))
    game = PartiGame(whole(2), controller, GameRules(variant=variant))
    steps, there = ball_trial(game, Ball(), (0.1, 0.1))
    assert there
    assert len(game.cells) == 1
    assert steps <= math.ceil(0.85 * math.sqrt(2) / 0.05)
    assert game.own.arrivals == {(0, GOAL): {GOAL: 1}}
    ball_trial(game, Ball(), (0.1, 0.1))
    assert game.n_news == 0  # converged


def test_a_sealed_goal_ends_at_the_limit_of_cells() -> None:
    controller = GivenController(lambda o: 0.5 * MOVES, np.ones(2))
    game = PartiGame(whole(2), controller, GameRules(max_cells=50))
    _, there = ball_trial(game, Ball(wall=True), (0.1, 0.1), limit=100_000)
    assert not there
    assert game.exhausted
    assert len(game.cells) == 50


def test_maze_d_tells_the_variants_apart() -> None:
    """Published: 1,194 cells for PG, 21 for LLPPG (Al-Ansari 2001, table 2)."""
    generator = np.random.default_rng(0)
    env, game = maze_game("MazeD", GameRules(variant="llppg"))
    for n_trials in range(1, 10):  # noqa: B007 - used below
        steps = trial(env, game, generator)
        if game.n_news == 0:
            break
    assert n_trials < 9
    assert len(game.cells) < 50
    assert steps < 2 * 149
    env, game = maze_game("MazeD", GameRules(variant="pg", max_cells=301))
    trial(env, game, generator)
    assert game.exhausted  # before its first trial was over


def test_improvement_halves_the_largest_of_what_costs_too_much() -> None:
    env, game = maze_game("MazeB", GameRules(variant="llppg"))
    trial(env, game, np.random.default_rng(0))
    cells, cost = game.cells, game.plan().cost
    dear = []
    for cell in range(len(cells)):
        around = [cost[other] for other in cells.neighbours[cell].tolist()]
        around += [0.0] if cells.beside_goal[cell] else []
        if np.isfinite(cost[cell]) and cost[cell] > min(around) + 1:
            dear.append(cell)
    largest = max(cells.volumes[cell] for cell in dear)
    wanted = [cell for cell in dear if np.isclose(cells.volumes[cell], largest)]
    assert 0 < len(wanted) < len(cells)
    assert losing_cells.cells_to_improve(cells, game.plan()).tolist() == wanted
    assert game.improve()
    assert len(game.cells) == len(cells) + len(wanted)
    gone = {cell for pair in game.own.starts for cell in pair} & set(wanted)
    assert not gone


def test_improvement_finds_a_shorter_way() -> None:
    env, game = maze_game("MazeA", GameRules(variant="llppg", max_cells=400))
    generator = np.random.default_rng(0)
    steps = [trial(env, game, generator)]
    while game.n_news:
        steps.append(trial(env, game, generator))
    settled, later = steps[-1], []
    while len(later) < 8:
        assert game.n_news or game.improve()
        later.append(trial(env, game, generator))
    assert min(later) < 0.8 * settled  # 204 of 274 steps
    full = replace(game, rules=GameRules(max_cells=len(game.cells)))
    assert not full.improve()  # there is no room


def test_a_learned_controller_converges_in_maze_a() -> None:
    """Published: 9 trials, 34 cells, 3,536 steps (means of 40, table 5); within a factor of two."""
    rows = []
    for seed in range(5):
        env, game = maze_game("MazeA", GameRules(), learned=True)
        generator, total = np.random.default_rng(seed), 0
        for n_trials in range(1, 40):  # noqa: B007 - used below
            total += trial(env, game, generator)
            if game.n_news == 0:
                break
        rows.append((n_trials, len(game.cells), total))
    trials, n_cells, steps = np.mean(rows, axis=0)
    assert 9 / 2.5 <= trials <= 9 * 2
    assert 34 / 2 <= n_cells <= 34 * 2
    assert 3536 / 2 <= steps <= 3536 * 2


def test_without_noise_likely_outcomes_are_all_outcomes() -> None:
    generator = np.random.default_rng(2)
    faithful, relaxed = Outcomes(), Outcomes(floor=0.1)
    for _ in range(300):  # the world answers an aim always alike
        cell, aim = (int(x) for x in generator.integers(8, size=2))
        triple = (cell, aim, (3 * cell + aim) % 8)
        faithful.add(triple, np.zeros(1))
        relaxed.add(triple, np.zeros(1))
    start, aim_of = np.divmod(np.arange(64), 8)
    one, other = (costs(8, start, aim_of, x).cost.tolist() for x in (faithful, relaxed))
    assert one == other


def test_a_rare_outcome_is_no_threat_when_relaxed() -> None:
    outcomes = Outcomes(floor=0.1)
    for n in range(40):
        outcomes.add((0, 1, 0 if n == 7 else 1), np.zeros(1))
    assert outcomes.of(0, 1) == (1,)
    outcomes.floor = 0.0
    assert outcomes.of(0, 1) == (0, 1)
    assert wilson(1, 1) == pytest.approx(0.2065, abs=1e-4)  # tabulated
    assert wilson(81, 263) == pytest.approx(0.2553, abs=1e-4)  # Newcombe 1998, table I


def test_explained_cuts_lie_between_success_and_failure() -> None:
    generator = np.random.default_rng(4)
    cells = whole(2)
    outcomes = Outcomes()
    for _ in range(60):  # the goal is reached from the right of x = 0.62 only; y means nothing
        place = generator.random(2)
        outcomes.add((0, GOAL, GOAL if place[0] > 0.62 else 0), place)
    plan = costs(1, *aims(cells, expert=False), outcomes)
    ((cell, axis, threshold),) = losing_cells.explained_cuts(cells, plan, outcomes)
    assert (cell, axis) == (0, 0)
    assert threshold == pytest.approx(0.62, abs=0.05)
    halves, left = losing_cells.split(cells, outcomes, [(cell, axis, threshold)])
    assert len(halves) == 2
    assert not left.arrivals


def test_pure_noise_is_seldom_explained() -> None:
    found = 0
    for seed in range(300):
        generator = np.random.default_rng(seed)
        outcomes = Outcomes()
        for _ in range(40):
            outcomes.add((0, GOAL, GOAL if generator.random() < 0.5 else 0), generator.random(2))
        plan = costs(1, *aims(whole(2), expert=False), outcomes)
        found += len(losing_cells.explained_cuts(whole(2), plan, outcomes, level=0.05))
    # Bonferroni is conservative: 5 % of 300 are 15, three standard errors more are 26.
    assert found <= 26


def test_a_perfect_expert_is_followed_and_nothing_is_explored() -> None:
    def expert(place: np.ndarray) -> int:
        return 1  # northeast, along the diagonal into the goal

    path = [np.array([0.1, 0.1])]
    while True:
        after, inside = Ball().step(path[-1], 1)
        path.append(after)
        if inside:
            break
    controller = GivenController(lambda o: np.zeros((8, 2)), np.ones(2))  # it would get nowhere
    game = PartiGame(
        whole(2), controller, GameRules(), expert=expert, demonstrated=[(np.array(path), GOAL)]
    )
    assert game.plan().cost.tolist() == [1.0, 0.0]
    game.own.add((0, GOAL, 0), np.zeros(2))  # the straight way is known to fail
    game._recost()
    assert game.plan().best_aim(0) == EXPERT
    steps, there = ball_trial(game, Ball(), (0.1, 0.1))
    assert there
    assert steps == len(path) - 1
    assert len(game.cells) == 1


def test_an_expert_s_outcomes_are_counted_segment_by_segment() -> None:
    cells = whole(1).halve([0])  # x <= 0.5 is cell 0, the rest cell 1
    walk = np.array([[0.1], [0.4], [0.7], [0.8], [0.3], [0.6], [0.92]])
    found = expert_outcomes(cells, [(walk, GOAL), (walk[:3], LOST), (walk[:3], CUT_SHORT)])
    triples = [triple for triple, _ in found]
    ended = [(0, EXPERT, 1), (1, EXPERT, 0), (0, EXPERT, 1), (1, EXPERT, GOAL)]
    assert triples[:4] == ended
    assert triples[4:] == [(0, EXPERT, LOST), (0, EXPERT, 1)]  # cut short after it had crossed
    assert [float(start[0]) for _, start in found[:3]] == [0.1, 0.7, 0.3]


def test_a_learned_controller_learns_displacements() -> None:
    generator = np.random.default_rng(0)
    controller = LearnedController(np.zeros(2), np.ones(2), 8)
    place = np.array([0.5, 0.5])
    for step in range(3000):
        action = int(generator.integers(8))
        after, _ = Ball().step(place, action)
        controller.learn(place, action, after)
        place = after if step % 4 else np.array([0.5, 0.5])
    moves, doubt = controller.predict(np.array([0.5, 0.5]))
    np.testing.assert_allclose(moves, 0.5 * MOVES, atol=1e-3)
    assert doubt < 0.05
    target = np.array([0.5, 0.9])
    taken = [controller.act(np.array([0.5, 0.5]), target, generator) for _ in range(20)]
    assert taken.count(0) >= 17  # north


def test_tiles_learn_as_a_plain_loop_does() -> None:
    generator = np.random.default_rng(1)
    controller = LearnedController(np.array([-1.0, 0.0]), np.array([2.0, 3.0]), 2)
    means, visits = {}, {}
    for _ in range(500):
        place = generator.uniform([-1.2, 0.0], [1.0, 3.2])
        action, move = int(generator.integers(2)), generator.standard_normal(2)
        controller.learn(place, action, place + move)
        left = move / [2.0, 3.0]
        for n in (1, 4, 16):
            cell = np.clip(((place - [-1.0, 0.0]) / [2.0, 3.0] * n).astype(int), 0, n - 1)
            key = (action, n, *cell.tolist())
            visits[key] = visits.get(key, 0) + 1
            left = left - means.get(key, np.zeros(2))
            rate = max(0.1, 1.0 / visits[key])
            means[key] = means.get(key, np.zeros(2)) + rate * left
    for place in generator.uniform([-1.0, 0.0], [1.0, 3.0], (50, 2)):
        moves, doubt = controller.predict(place)
        for action in range(2):
            expected = np.zeros(2)
            for n in (1, 4, 16):
                cell = np.clip(((place - [-1.0, 0.0]) / [2.0, 3.0] * n).astype(int), 0, n - 1)
                expected = expected + means.get((action, n, *cell.tolist()), np.zeros(2))
            np.testing.assert_allclose(moves[action], expected * [2.0, 3.0], atol=1e-12)
        assert 0.0 < doubt <= 1.0


def test_mistakes_are_said() -> None:
    with pytest.raises(UnknownNameError, match="llppg"):
        GameRules(variant="lllppg")
    with pytest.raises(InvalidArgumentError, match="patience must be an integer >= 1, got 0"):
        GameRules(patience=0)
    with pytest.raises(InvalidArgumentError, match="low must be below high in every axis"):
        Cells.of(DecisionTree.single_leaf(1), [1.0], [1.0], [[[0.0], [1.0]]])
    with pytest.raises(
        InvalidArgumentError, match=r"goals must have shape \(G, 2, 1\) with G >= 1"
    ):
        Cells.of(DecisionTree.single_leaf(1), [0.0], [1.0], np.empty((0, 2, 1)))
    with pytest.raises(InvalidArgumentError, match="high must be finite"):
        Cells.of(DecisionTree.single_leaf(1), [0.0], [INF], [[[0.0], [1.0]]])
    with pytest.raises(InvalidArgumentError, match=r"a cut of cell 0 must lie between 0.0 and 1.0"):
        whole(1).split([(0, 0, 1.5)])
