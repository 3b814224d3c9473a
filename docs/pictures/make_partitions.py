"""Draw docs/images/partition-*.png: Car on the Hill, and parti-game in a maze, as they grow.

Run: python docs/pictures/make_partitions.py
"""

from pathlib import Path
from typing import Any

import gymnasium
import matplotlib as mpl

mpl.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from partitions import Partition, Plane, cells_seen, corners_seen

import eutree  # noqa: F401 - registers
from eutree.trees import DecisionTree
from eutree_lab.parti_game.cells import GOAL, Cells
from eutree_lab.parti_game.displacements import LearnedController
from eutree_lab.parti_game.game import GOES_ON, GameRules, PartiGame
from eutree_lab.tasks._walls import PLANS
from eutree_lab.vrd.corner_process import KnownWorld, Solved, solved
from eutree_lab.vrd.influence import refined
from eutree_lab.vrd.kuhn import Grid

IMAGES = Path(__file__).parents[1] / "images"
ACTIONS = ("#0b62a8", "#a84300")  # push left, push right
MAZE, SEED = "eutree/MazeB-v0", 3


def plane_of(env: Any) -> Plane:
    """Return the whole plane of a domain of two features."""
    low, high = env.observation_space.low, env.observation_space.high
    return Plane(0, 1, 0.5 * (low + high), np.array(low, float), np.array(high, float))


def outlined(axes: Any, partition: Partition, **style: Any) -> PolyCollection:
    """Draw the regions of a partition."""
    regions = PolyCollection([region.outline for region in partition.regions], **style)
    axes.add_collection(regions)
    plane = partition.plane
    axes.set(xlim=(plane.low[0], plane.high[0]), ylim=(plane.low[1], plane.high[1]))
    return regions


def car_on_the_hill() -> None:
    """Draw V and the best action, as the triangles get smaller where a criterion says so."""
    env: Any = gymnasium.make("eutree/CarOnHill-v0").unwrapped
    plane = plane_of(env)

    def dynamics(states: Any, actions: Any) -> Any:
        after, rewards, ends = env.model(states, actions)
        return after, rewards, 1.0 - ends

    world = KnownWorld(dynamics, 2, env.discount)
    figure, rows = plt.subplots(2, 4, figsize=(13, 6.4), layout="constrained", sharex=True,
                                sharey=True)  # fmt: skip
    solution = solved(Grid.uniform(plane.low, plane.high, (4, 4)), world)
    for column, n_corners in enumerate((289, 700, 2000)):
        while solution.grid.n_corners < n_corners:
            finer = refined(solution, "stdev_inf", 0.2, np.empty((0, 2)))
            solution = solved(finer, world, before=solution)
        name = f"{solution.grid.n_corners:,} corners"
        shaded = drawn(rows[:, column], plane, solution, name, edges=True)
    exact = solved(Grid.uniform(plane.low, plane.high, (8, 8)), world)
    drawn(rows[:, 3], plane, exact, "257 x 257 corners", edges=False)
    for axes in rows[:, 0]:
        axes.set_ylabel("velocity")
    for axes in rows[1]:
        axes.set_xlabel("position y")
    figure.colorbar(shaded, ax=rows[0], label="V", shrink=0.9)
    figure.legend(
        handles=[plt.Rectangle((0, 0), 1, 1, color=colour) for colour in ACTIONS],
        labels=["thrust to the left", "thrust to the right"], loc="outside lower center", ncols=2,
    )  # fmt: skip
    figure.savefig(IMAGES / "partition-car-on-hill.png", dpi=110)
    plt.close(figure)


def drawn(places: Any, plane: Plane, solution: Solved, title: str, *, edges: bool) -> Any:
    """Draw V above and the best action below; return what has the colours of V."""
    partition = corners_seen(solution.grid, solution.policy, solution.values, plane)
    whole = Partition(plane, partition)
    lines: dict[str, Any] = {"antialiased": False}
    if edges:
        lines = {"edgecolors": "#00000055", "linewidths": 0.3}
    values = np.array([region.value for region in partition])
    shaded = outlined(places[0], whole, array=values, cmap="viridis", clim=(-1, 1), **lines)
    colours = [ACTIONS[region.action or 0] for region in partition]
    outlined(places[1], whole, facecolors=colours, **lines)
    places[0].set_title(title)
    for axes in places:
        axes.set_rasterized(True)
    return shaded


def maze() -> None:
    """Draw the cells of parti-game with their costs, and the way of the trial, trial by trial."""
    env: Any = gymnasium.make(MAZE, trial_limit=100_000).unwrapped
    plane = plane_of(env)
    low, high = env.observation_space.low, env.observation_space.high
    cells = Cells.of(DecisionTree.single_leaf(2), low, high, env.goal[np.newaxis])
    controller = LearnedController(low, high - low, int(env.action_space.n))
    game = PartiGame(cells, controller, GameRules(variant="llppg"))
    generator = np.random.default_rng(SEED)
    ways, seen = [], []
    while not ways or game.n_news:
        ways.append(trial(env, game, generator))
        seen.append(cells_seen(game, plane))
    shown = [0, len(ways) // 2, len(ways) - 1]
    figure, places = plt.subplots(1, 3, figsize=(12.6, 4.6), layout="constrained")
    for axes, number in zip(places, shown, strict=True):
        partition, way = seen[number], ways[number]
        costs = np.array([region.value for region in partition.regions])
        colours = [plt.cm.Blues(0.08 + 0.6 * c / costs[np.isfinite(costs)].max())
                   if np.isfinite(c) else (0.6, 0.6, 0.6, 1.0) for c in costs]  # fmt: skip
        outlined(axes, partition, facecolors=colours, edgecolors="#4a5866", linewidths=0.6)
        for region in partition.regions:
            if np.isfinite(region.value) and (np.ptp(region.outline, axis=0) > 0.55).all():
                x, y = region.outline.mean(axis=0)
                axes.text(x, y, f"{region.value:.0f}", ha="center", va="center", fontsize=8)
        axes.plot(*way.T, color="#b02a00", linewidth=0.9)
        for wall in PLANS["b"].walls:
            axes.plot(*np.reshape(wall, (2, 2)).T, color="black", linewidth=3)
        for goal in partition.goals:
            axes.fill(*goal.T, facecolor="#0a7048", edgecolor="black")
        axes.set(aspect="equal", xticks=[], yticks=[])
        n_cells = len(partition.regions)
        axes.set_title(f"trial {number + 1}: {len(way) - 1:,} steps, {n_cells} cells")
    figure.savefig(IMAGES / "partition-maze.png", dpi=110)
    plt.close(figure)


def trial(env: Any, game: PartiGame, generator: np.random.Generator) -> Any:
    """Run to the goal and return the way, shape [T + 1, 2]."""
    observation, _ = env.reset()
    game.begin()
    way, ended = [observation], False
    while not ended:
        action = game.act(observation, generator)
        after, _, ended, _, _ = env.step(action)
        game.observe(observation, action, after, GOAL if ended else GOES_ON)
        way.append(after)
        observation = after
    return np.array(way)


if __name__ == "__main__":
    car_on_the_hill()
    maze()
