"""Random partitions and small worlds for the discretizers."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import eutree  # noqa: F401 - registers
from eutree.arrays import Floats
from eutree.trees import DecisionTree
from eutree_lab.parti_game.cells import GOAL, Cells
from eutree_lab.parti_game.displacements import LearnedController, nearest
from eutree_lab.parti_game.game import CUT_SHORT, GOES_ON, GameRules, PartiGame
from eutree_lab.parti_game.outcomes import LOST
from eutree_lab.tasks.maze import MOVES


def random_tree(generator: np.random.Generator, d: int, n_splits: int) -> DecisionTree:
    """Return a tree over the unit cube whose thresholds lie inside their leaves."""
    cells = whole(d)
    for _ in range(n_splits):
        cell, axis = int(generator.integers(len(cells))), int(generator.integers(d))
        share = generator.choice([0.25, 0.5, 0.75])
        low, high = cells.low[cell, axis], cells.high[cell, axis]
        cells = cells.split([(cell, axis, float(low + share * (high - low)))])
    return cells.tree


def whole(d: int) -> Cells:
    """Return one cell, the unit cube, with a goal in its upper corner."""
    goal = np.stack([np.full(d, 0.9), np.full(d, 0.95)])
    return Cells.of(DecisionTree.single_leaf(d), np.zeros(d), np.ones(d), goal[np.newaxis])


class GivenController:
    """A controller with a known model of displacements.

    Args:
        displacements: From an observation [d] to what each action adds to it, [A, d].
        span: Sides of the box, the unit of lengths, shape [d].
    """

    def __init__(self, displacements: Callable[[Floats], Floats], span: Floats) -> None:
        self._displacements = displacements
        self._span = span

    def act(self, observation: Floats, target: Floats, generator: np.random.Generator) -> int:
        """Return the action that leads nearest to the target; the first on ties."""
        moves = np.ascontiguousarray(self._displacements(observation) / self._span)
        return nearest(observation, target, moves, self._span)[0]

    def best(self, observation: Floats, target: Floats) -> int:
        """Return the same."""
        return self.act(observation, target, np.random.default_rng(0))

    def learn(self, observation: Floats, action: int, after: Floats) -> None:
        """Learn nothing: the model is known."""


class Ball:
    """A point in a square box that moves by 0.05 in eight directions and is halted nowhere."""

    def __init__(self, wall: bool = False) -> None:
        self.wall = wall  # around the goal: it cannot be entered

    def step(self, place: np.ndarray, action: int) -> tuple[np.ndarray, bool]:
        after = np.clip(place + 0.5 * MOVES[action], 0.0, 1.0)
        inside = bool(((after >= 0.9) & (after <= 0.95)).all())
        if self.wall and bool(((after >= 0.85) & (after <= 1.0)).all()):
            return place, False
        return after, inside


def maze_game(
    name: str, rules: GameRules, *, learned: bool = False, seed: int = 0
) -> tuple[Any, Any]:
    """Return a maze and a parti-game learner of it."""
    env = gymnasium.make(f"eutree/{name}-v0", trial_limit=10**6, disable_env_checker=True).unwrapped
    low, high = env.observation_space.low, env.observation_space.high
    cells = Cells.of(DecisionTree.single_leaf(2), low, high, env.goal[np.newaxis])
    controller: Any = GivenController(lambda o: MOVES, high - low)
    if learned:
        controller = LearnedController(low, high - low, int(env.action_space.n))
    return env, PartiGame(cells, controller, rules)


def trial(env: Any, game: PartiGame, generator: np.random.Generator, limit: int = 10**6) -> int:
    """Run one episode; return its steps."""
    observation, _ = env.reset()
    game.begin()
    step, ending = 0, GOES_ON
    while ending == GOES_ON and step < limit and not game.exhausted:
        step += 1
        action = game.act(observation, generator)
        after, _, terminated, truncated, info = env.step(action)
        ending = GOES_ON if not truncated else CUT_SHORT
        if terminated:
            ending = GOAL if info["is_success"] else LOST
        game.observe(observation, action, after, ending)
        observation = after
    return step


def mountain_car(states: np.ndarray, actions: np.ndarray) -> tuple[Any, Any, Any]:
    """MountainCar-v0: next states, rewards and the chance to go on."""
    push = 0.001 * (actions - 1) - 0.0025 * np.cos(3 * states[:, 0])
    velocity = np.clip(states[:, 1] + push, -0.07, 0.07)
    position = np.clip(states[:, 0] + velocity, -1.2, 0.6)
    velocity = np.where((position <= -1.2) & (velocity < 0), 0.0, velocity)
    over = (position >= 0.5) & (velocity >= 0)
    after = np.column_stack([position, velocity])
    return after, np.full(len(states), -1.0), np.where(over, 0.0, 1.0)
