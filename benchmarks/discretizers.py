"""Measure parti-game in the thesis's mazes and on its puck, and grids on Car on the Hill.

Run: python benchmarks/discretizers.py [mazes] [variants] [car] [--runs 40] [--tasks Puck]

Parti-game: trials, cells and steps until a trial brings nothing new, and the steps of that trial.
Car on the Hill: mean discounted return of 256 states drawn uniformly, under one look-ahead a step.
"""

import argparse
import time
from typing import Any

import gymnasium
import numpy as np

import eutree  # noqa: F401 - registers
from eutree.discretization.cells import GOAL, Cells
from eutree.discretization.corner_process import KnownWorld, Solved, solved
from eutree.discretization.displacements import GivenController, LearnedController
from eutree.discretization.influence import CRITERIA, refined
from eutree.discretization.kuhn import Grid
from eutree.discretization.parti_game import GOES_ON, TAKEN_BACK, PartiGame, Rules
from eutree.envs.maze import MOVES
from eutree.trees import DecisionTree

PUBLISHED = {  # Al-Ansari 2001, table 5: trials, cells, steps, final path; means of 40
    "MazeA": (9, 34, 3536, 298),
    "MazeB": (6, 52, 3256, 193),
    "MazeC": (6, 117, 10693, 443),
    "MazeD": (7, 23, 1693, 186),
    "Puck": (13, 97, 20173, 229),
}
PUBLISHED_VARIANTS = {  # table 2: cells of PG, LPPG, LLPPG with a given controller
    "MazeA": (444, 239, 27),
    "MazeB": (98, 76, 76),
    "MazeC": (176, 120, 96),
    "MazeD": (1194, 350, 21),
}
MOST_TRIALS, MOST_STEPS = 60, 100_000
SIZES = (200, 400, 800, 2000)  # corners


def run(name: str, variant: str, seed: int | None) -> tuple[int, int, int, int]:
    """Play until a trial brings nothing new; a seed means a learned controller."""
    env: Any = gymnasium.make(
        f"eutree/{name}-v0", trial_limit=MOST_STEPS, disable_env_checker=True
    ).unwrapped
    low, high = env.observation_space.low, env.observation_space.high
    cells = Cells.of(DecisionTree.single_leaf(2), low, high, env.goal[np.newaxis])
    controller: Any = GivenController(lambda o: MOVES, high - low)
    if seed is not None:
        controller = LearnedController(low, high - low, int(env.action_space.n))
    game = PartiGame(cells, controller, Rules(variant=variant))
    generator, total, n_trials = np.random.default_rng(seed or 0), 0, 0
    while n_trials < MOST_TRIALS:
        n_trials += 1
        last = trial(env, game, generator, MOST_STEPS - total)
        total += last
        if game.n_news == 0 or total >= MOST_STEPS:
            break
    return n_trials, len(game.cells), total, last


def trial(env: Any, game: PartiGame, generator: np.random.Generator, limit: int) -> int:
    """Run to the goal; who crashes is put back to the start, as in the thesis."""
    observation, _ = env.reset()
    game.begin()
    for step in range(1, limit + 1):
        action = game.act(observation, generator)
        after, _, terminated, _, info = env.step(action)
        ending = GOES_ON
        if terminated:
            ending = GOAL if info["is_success"] else TAKEN_BACK
        if ending == TAKEN_BACK:
            after, _ = env.reset()
        game.observe(observation, action, after, ending)
        observation = after
        if ending == GOAL:
            return step
    return limit


def mazes(tasks: list[str], runs: int) -> None:
    """Print the learned controller's table."""
    print("| task | trials | cells | steps | final path | published | seconds a run |")
    print("|---|---|---|---|---|---|---|")
    for name in tasks:
        published = PUBLISHED[name]
        before = time.process_time()
        rows = np.array([run(name, "llppg", seed) for seed in range(runs)])
        seconds = (time.process_time() - before) / runs
        errors = rows.std(axis=0, ddof=1) / np.sqrt(runs)
        found = " | ".join(
            f"{m:,.0f} ± {e:,.0f}" for m, e in zip(rows.mean(0), errors, strict=True)
        )
        print(
            f"| {name} | {found} | {' / '.join(map(str, published))} | {seconds:.1f} |", flush=True
        )


def variants() -> None:
    """Print cells and steps of the three variants with a given controller."""
    print("| task | variant | trials | cells | steps | final path | published cells |")
    print("|---|---|---|---|---|---|---|")
    for name, published in PUBLISHED_VARIANTS.items():
        for variant, cells in zip(("pg", "lppg", "llppg"), published, strict=True):
            found = " | ".join(f"{x:,}" for x in run(name, variant, None))
            print(f"| {name} | {variant} | {found} | {cells:,} |", flush=True)


class Car:
    """Car on the Hill with its true model."""

    def __init__(self) -> None:
        self.env: Any = gymnasium.make("eutree/CarOnHill-v0").unwrapped
        self.low, self.high = self.env.observation_space.low, self.env.observation_space.high
        self.world = KnownWorld(self._dynamics, 2, self.env.discount)
        self.starts = np.random.default_rng(0).uniform(self.low, self.high, (256, 2))

    def mean_return(self, solution: Solved) -> float:
        """Return the mean discounted return of the starts."""
        states, total, worth = self.starts.copy(), np.zeros(256), np.ones(256)
        for _ in range(500):
            going = np.flatnonzero(worth > 0.0)
            if not going.size:
                break
            actions = solution.actions(self.world, states[going])
            states[going], rewards, goes_on = self._dynamics(states[going], actions)
            total[going] += worth[going] * rewards
            worth[going] *= self.world.discount * goes_on
        return float(total.mean())

    def uniform(self, halvings: tuple[int, int]) -> Solved:
        """Return a uniform grid, solved."""
        return solved(Grid.uniform(self.low, self.high, halvings), self.world)

    def _dynamics(self, states: Any, actions: Any) -> Any:
        after, rewards, ends = self.env.model(states, actions)
        return after, rewards, 1.0 - ends


def car() -> None:
    """Print returns of uniform grids, of every criterion, and of 257 x 257 corners."""
    task = Car()
    print("| corners | of y and velocity | uniform grid |\n|---|---|---|")
    shapes = [(k, j) for k in range(3, 7) for j in range(3, 7) if abs(k - j) < 2]
    shapes = [*sorted(shapes, key=sum), (8, 8)]
    for shape in shapes:
        solution = task.uniform(shape)
        sides = " x ".join(str(2**k + 1) for k in shape)
        found = f"{task.mean_return(solution):.4f}"
        print(f"| {solution.grid.n_corners:,} | {sides} | {found} |", flush=True)
    print("\n| begins with | share | criterion | " + " | ".join(f"{n:,} corners" for n in SIZES)
          + " | seconds |")  # fmt: skip
    print("|---|---|---|" + "---|" * (len(SIZES) + 1))
    for first, share in (((3, 3), 0.2), ((4, 4), 0.3)):
        for criterion in CRITERIA:
            refinement(task, first, share, criterion)


def refinement(task: Car, first: tuple[int, int], share: float, criterion: str) -> None:
    """Print the returns of one criterion from a first uniform grid on."""
    solution, found, spent = task.uniform(first), [], 0.0
    for n in SIZES:
        before, began = time.process_time(), solution.grid.n_corners
        while solution.grid.n_corners < n:
            most = (n - solution.grid.n_corners) / len(solution.grid.low)
            finer = refined(solution, criterion, min(share, most), task.starts[:64])
            if len(finer.low) == len(solution.grid.low):
                break  # nothing scores above 0
            solution = solved(finer, task.world, before=solution)
        spent += time.process_time() - before
        grown = began < solution.grid.n_corners
        value = f"{task.mean_return(solution):.4f} ({solution.grid.n_corners:,})"
        found.append(value if grown else "")
    sides = " x ".join(str(2**k + 1) for k in first)
    print(f"| {sides} | {share} | {criterion} | {' | '.join(found)} | {spent:.1f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", default=["mazes", "variants", "car"])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--tasks", nargs="+", choices=PUBLISHED, default=[*PUBLISHED])
    arguments = parser.parse_args()
    for part in arguments.parts:
        print(f"\n{part}\n", flush=True)
        {"mazes": lambda: mazes(arguments.tasks, arguments.runs), "variants": variants, "car": car}[
            part
        ]()


if __name__ == "__main__":
    main()
