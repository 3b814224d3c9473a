"""Measure the methods besides the default against figures that were published for them.

Run: python benchmarks/discretizers.py [mazes] [variants] [car] [mountain-car]
     [mountain-car-learned] [history] [evasion] [vqql] [--runs 40] [--first 0]
     [--steps 50000] [--tasks Puck]

Parti-game: trials, cells and steps until a trial brings nothing new, and the steps of that trial.
Car on the Hill: mean discounted return of 256 states drawn uniformly, under one look-ahead a step.
MountainCar: mean return of 100 starts with the true dynamics; with a learned model, that of the
tree and of the method's own policy. U-Tree with a memory: average reward of the learned tree for
each step. VQQL: success of its tree on Evasion2.
"""

import argparse
import itertools
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.envs.experts import EXPERTS
from eutree.learners.registry import method, with_choices
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree_lab.parti_game.cells import GOAL, Cells
from eutree_lab.parti_game.displacements import LearnedController
from eutree_lab.parti_game.game import GOES_ON, TAKEN_BACK, GameRules, PartiGame
from eutree_lab.tasks.maze import MOVES
from eutree_lab.vrd.corner_process import KnownWorld, Solved, solved
from eutree_lab.vrd.influence import CRITERIA, refined
from eutree_lab.vrd.kuhn import Grid

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.lab.methods.worlds import GivenController

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
# Choices, episodes of 200 steps, optimum (exact), published (Veness et al. 2011).
MEMORY: dict[str, tuple[dict[str, Any], int, float, float]] = {
    "Maze1D": ({"history": 2, "past_actions": 3, "discount": 0.95}, 100, 0.5, 0.50),
    "CheeseMaze": ({"history": 1, "past_actions": 1, "discount": 0.95}, 150, 6.7 / 5.3, 1.28),
    "Tiger": (
        {
            "history": 4,
            "past_actions": 0,
            "discount": 0.9,
            "exploration": 0.3,
            "retest_growth": 1.2,
        },
        1000,
        1.084,
        1.12,
    ),
}
EVASION = "eutree/Evasion2-v0"
REMEMBERING: dict[str, Any] = {  # on 2-Evasion; chosen on seeds 100 and 101
    "past_actions": 0,
    "fringe": 1,
    "exploration": 0.3,
    "significance": {"type": "Maximal", "alpha": 1e-5},
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
    game = PartiGame(cells, controller, GameRules(variant=variant))
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


def mazes(tasks: list[str], seeds: range) -> None:
    """Print the learned controller's table."""
    print("| task | trials | cells | steps | final path | published | seconds a run |")
    print("|---|---|---|---|---|---|---|")
    for name in [name for name in tasks if name in PUBLISHED]:
        published = PUBLISHED[name]
        before = time.process_time()
        rows = np.array([run(name, "llppg", seed) for seed in seeds])
        seconds = (time.process_time() - before) / len(seeds)
        errors = rows.std(axis=0, ddof=1) / np.sqrt(len(seeds))
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


class MountainCar:
    """MountainCar-v0 with its true dynamics."""

    def __init__(self) -> None:
        self.low, self.high = np.array([-1.2, -0.07]), np.array([0.6, 0.07])
        self.world = KnownWorld(self.dynamics, 3, 0.99)
        self.starts = np.column_stack([np.linspace(-0.6, -0.4, 100), np.zeros(100)])

    def dynamics(self, states: Any, actions: Any) -> Any:
        """Return where actions lead, what they earn, and the chance to go on."""
        push = 0.001 * (actions - 1) - 0.0025 * np.cos(3 * states[:, 0])
        velocity = np.clip(states[:, 1] + push, -0.07, 0.07)
        position = np.clip(states[:, 0] + velocity, -1.2, 0.6)
        velocity = np.where((position <= -1.2) & (velocity < 0), 0.0, velocity)
        over = (position >= 0.5) & (velocity >= 0)
        rewards = np.full(len(states), -1.0)
        return np.column_stack([position, velocity]), rewards, np.where(over, 0.0, 1.0)

    def mean_return(self, solution: Solved) -> float:
        """Return the mean return of the starts, in at most 200 steps."""
        states, total = self.starts.copy(), np.zeros(100)
        going = np.arange(100)
        for _ in range(200):
            actions = solution.actions(self.world, states[going])
            states[going], rewards, goes_on = self.dynamics(states[going], actions)
            total[going] += rewards
            going = going[goes_on > 0.0]
            if not going.size:
                break
        return float(total.mean())


def mountain_car() -> None:
    """Print returns of uniform grids and of every criterion on MountainCar, with its dynamics."""
    task = MountainCar()
    print("| uniform grid | corners | mean return |\n|---|---|---|")
    for k in (3, 4, 5, 6, 8):
        solution = solved(Grid.uniform(task.low, task.high, (k, k)), task.world)
        side, found = 2**k + 1, task.mean_return(solution)
        print(f"| {side} x {side} | {solution.grid.n_corners:,} | {found:.1f} |", flush=True)
    print("\n| begins with | criterion | " + " | ".join(f"{n:,} corners" for n in SIZES) + " |")
    print("|---|---|" + "---|" * len(SIZES))
    for first in ((3, 3), (4, 4)):
        for criterion in CRITERIA:
            solution, found_by = solved(Grid.uniform(task.low, task.high, first), task.world), []
            for n in SIZES:
                while solution.grid.n_corners < n:
                    finer = refined(solution, criterion, 0.2, task.starts[::6])
                    if len(finer.low) == len(solution.grid.low):
                        break
                    solution = solved(finer, task.world, before=solution)
                value = task.mean_return(solution)
                found_by.append(f"{value:.1f} ({solution.grid.n_corners:,})")
            sides = " x ".join(str(2**k + 1) for k in first)
            print(f"| {sides} | {criterion} | {' | '.join(found_by)} |", flush=True)


class OwnPolicy:
    """Evaluates the policy that a method decides by itself, at the end."""

    def __init__(self, env: Any) -> None:
        self.env = env

    def init_callback(self, model: Any) -> None:
        self.model = model

    def on_training_end(self) -> None:
        own = self.model.run.learner.own_policy()
        self.found = eutree.evaluate(own, self.env, episodes=100, seed=10**6)


def mountain_car_learned(seeds: range, steps: int) -> None:
    """Print what `vrd` reaches in a learned model, from 15 demonstrations."""
    print("| seed | steps | return of the tree | its own policy | leaves | seconds |")
    print("|---|---|---|---|---|---|")
    env = gymnasium.make("MountainCar-v0")
    for seed in seeds:
        before = time.process_time()
        expert = EXPERTS["MountainCar-v0"]["rock"](env)
        shown = eutree.record(env, expert, episodes=15, seed=seed)
        own = OwnPolicy(env)
        learned = eutree.learn(
            env, demonstrations=shown, method="vrd", steps=steps, seed=seed, callback=own,
            evaluate_every=10**6, evaluation_episodes=1,
        )  # fmt: skip
        tree = eutree.evaluate(learned.policy, env, episodes=100, seed=10**6)
        print(
            f"| {seed} | {learned.steps:,} | {tree.mean_return:.1f} | {own.found.mean_return:.1f} "
            f"| {learned.policy.n_leaves} | {time.process_time() - before:.0f} |",
            flush=True,
        )


def history(tasks: list[str], seeds: range) -> None:
    """Print the average reward that trees with a memory earn for each step."""
    print("| task | steps | reward a step | lowest | leaves | optimum | published | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    for name in [name for name in tasks if name in MEMORY]:
        choices, episodes, optimum, published = MEMORY[name]
        rows, before = [], time.process_time()
        chosen = with_choices(method("history-u-tree"), choices)
        for seed in seeds:
            made = f"eutree/{name}-v0"
            env = gymnasium.make(made, trial_limit=200, disable_env_checker=True)
            learned = eutree.learn(
                env, method=chosen, start="nothing", episodes=episodes, seed=seed,
                evaluate_every=10**6, evaluation_episodes=1,
            )  # fmt: skip
            rows.append((reward_a_step(name, learned.policy, seed), learned.policy.n_leaves))
            print(f"{name}, seed {seed}: {rows[-1][0]:.4f}", file=sys.stderr, flush=True)
        rewards, leaves = np.array(rows).T
        error = rewards.std(ddof=1) / np.sqrt(len(seeds))
        spent = (time.process_time() - before) / len(seeds)
        print(
            f"| {name} | {episodes * 200:,} | {rewards.mean():.3f} ± {error:.3f} | "
            f"{rewards.min():.3f} | {leaves.mean():.0f} | {optimum:.3f} | {published:.2f} | "
            f"{spent:.0f} |",
            flush=True,
        )


def reward_a_step(name: str, policy: TreePolicy, seed: int) -> float:
    """Return the average reward of a policy for each step; exact for Tiger, which varies much."""
    if name == "Tiger":
        return tiger_reward(policy)
    test = gymnasium.make(f"eutree/{name}-v0", trial_limit=1000, disable_env_checker=True)
    return eutree.evaluate(policy, test, episodes=50, seed=10**6 + seed).mean_return / 1000


def tiger_reward(policy: TreePolicy, accuracy: float = 0.85, most: int = 12) -> float:
    """Return the long-run reward for each step of a tree of what was heard lately.

    The state is what the policy sees, and how many times more the tiger was heard on the right
    than on the left since the doors were closed, which says where it is; at most ``most``.
    """
    n = policy.tree.n_features
    seen = np.array(list(itertools.product((0.0, -1.0, 1.0), repeat=n)))  # the latest first
    actions = policy.actions[policy.tree.leaf_index(seen)]
    place = {tuple(row): i for i, row in enumerate(seen.tolist())}
    after = np.array([[place[(h, *row[:-1])] for h in (0.0, -1.0, 1.0)] for row in seen.tolist()])
    odds = (accuracy / (1 - accuracy)) ** np.arange(-most, most + 1)
    right = odds / (1 + odds)  # [K]
    hear_right = right * accuracy + (1 - right) * (1 - accuracy)
    share = np.zeros((len(seen), 2 * most + 1))
    share[0, most] = 1.0
    earned = []
    for _ in range(1000):
        listens, opens_left, opens_right = (share * (actions == a)[:, np.newaxis] for a in range(3))
        tiger = (opens_right * right).sum() + (opens_left * (1 - right)).sum()
        gold = opens_left.sum() + opens_right.sum() - tiger
        earned.append(10.0 * gold - 100.0 * tiger - listens.sum())
        share = np.zeros_like(share)
        np.add.at(share[:, most], after[:, 0], (opens_left + opens_right).sum(axis=1))
        up, down = listens * hear_right, listens * (1 - hear_right)
        up[:, -2] += up[:, -1]
        down[:, 1] += down[:, 0]
        np.add.at(share[:, 1:], after[:, 2], up[:, :-1])
        np.add.at(share[:, :-1], after[:, 1], down[:, 1:])
    return float(np.mean(earned[500:]))


def evasion(seeds: range) -> None:
    """Print what `history-u-tree` earns on Evasion2, with kept actions and with greedy ones."""
    print("| leaves act by | seed | expert tree | return | success | leaves | cuts in the past |"
          " seconds |\n|---|---|---|---|---|---|---|---|")  # fmt: skip
    env = gymnasium.make(EVASION)
    for name, evidence in (("evidence", 2.0), ("Eq. 1", None)):
        chosen = with_choices(method("history-u-tree"), REMEMBERING | {"evidence": evidence})
        for seed in seeds:
            before = time.process_time()
            shown = eutree.record(env, EXPERTS[EVASION]["gate"](env), episodes=15, seed=seed)
            learned = eutree.learn(
                env, demonstrations=shown, method=chosen, episodes=1000, seed=seed,
                evaluate_every=10**6, evaluation_episodes=1,
            )  # fmt: skip
            spent = time.process_time() - before
            assert learned.expert is not None
            expert, tree = (
                eutree.evaluate(policy, env, episodes=300, seed=10**6)
                for policy in (learned.expert, learned.policy)
            )
            past = int((learned.policy.tree.feature >= 3).sum())
            print(
                f"| {name} | {seed} | {expert.mean_return:.1f} | {tree.mean_return:.1f} "
                f"| {tree.success_rate or 0.0:.1%} | {learned.policy.n_leaves} | {past} "
                f"| {spent:.0f} |",
                flush=True,
            )


def vqql(seeds: range, episodes: int) -> None:
    """Print the success of the trees of `vqql` on Evasion2, from tree and demonstrations."""
    print(
        "| seed | expert tree | tree | own regions | leaves | seconds |\n|---|---|---|---|---|---|"
    )
    env = gymnasium.make(EVASION)
    for seed in seeds:
        before = time.process_time()
        shown = eutree.record(env, EXPERTS[EVASION]["gate"](env), episodes=15, seed=seed)
        own = OwnPolicy(env)
        learned = eutree.learn(
            env, demonstrations=shown, method="vqql", episodes=episodes, seed=seed, callback=own,
            evaluate_every=10**6, evaluation_episodes=1,
        )  # fmt: skip
        assert learned.expert is not None
        rates = [
            eutree.evaluate(policy, env, episodes=300, seed=10**6).success_rate or 0.0
            for policy in (learned.expert, learned.policy)
        ]
        print(
            f"| {seed} | {rates[0]:.1%} | {rates[1]:.1%} | {own.found.success_rate or 0.0:.1%} | "
            f"{learned.policy.n_leaves} | {time.process_time() - before:.0f} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", default=["mazes", "variants", "car"])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="the first run's seed")
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--episodes", type=int, default=400)
    known_tasks = [*PUBLISHED, *MEMORY]
    parser.add_argument("--tasks", nargs="+", choices=known_tasks, default=known_tasks)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.runs)
    known: dict[str, Callable[[], None]] = {
        "mazes": lambda: mazes(arguments.tasks, seeds),
        "variants": variants,
        "car": car,
        "mountain-car": mountain_car,
        "mountain-car-learned": lambda: mountain_car_learned(seeds, arguments.steps),
        "history": lambda: history(arguments.tasks, seeds),
        "vqql": lambda: vqql(seeds, arguments.episodes),
        "evasion": lambda: evasion(seeds),
    }
    for part in arguments.parts:
        print(f"\n{part}\n", flush=True)
        known[part]()


if __name__ == "__main__":
    main()
