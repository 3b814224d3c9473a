"""Scripted controllers of the mazes and of the two hills, to demonstrate with."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.envs.experts import Expert, RulePolicy
from eutree.errors import InvalidArgumentError
from eutree_lab.tasks import puck
from eutree_lab.tasks._domain import ModelledDomain
from eutree_lab.tasks._walls import GAP, walk
from eutree_lab.tasks.car_on_hill import CarOnHillEnv
from eutree_lab.tasks.maze import MOVES, MazeEnv
from eutree_lab.tasks.puck import PuckEnv

BERTH = 0.25  # how far a wall's end is passed by
CORNERS = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)])


def round_the_walls(env: Any) -> RulePolicy:
    """Return a rule for a maze: go to the next bend of the shortest way to the goal."""
    maze = _domain(env, MazeEnv, "a maze")
    ends = maze._walls[:-4].reshape(-1, 2)  # [2 W, 2] those of the outer walls are no bends
    bends = (ends[:, np.newaxis] + BERTH * CORNERS).reshape(-1, 2)
    bends = bends[((bends > 0.0) & (bends < 10.0)).all(axis=1)]
    bends = np.concatenate([[maze.goal.mean(axis=0)], bends])  # [B, 2]
    left = np.full(len(bends), np.inf)  # [B] length of the way that is left
    left[0] = 0.0
    apart = np.array([_seen(maze._walls, bend, bends) for bend in bends])  # [B, B]
    for _ in bends:  # Bellman and Ford: no shortest way has more bends
        left = np.minimum(left, (apart + left).min(axis=1))

    def rule(o: Floats) -> Integers:
        flat = np.atleast_2d(o)
        ways = np.array([_seen(maze._walls, place, bends) for place in flat])
        targets = bends[(ways + left).argmin(axis=1)]
        missed = np.linalg.norm(targets[:, np.newaxis] - flat[:, np.newaxis] - MOVES, axis=2)
        nearest: Integers = missed.argmin(axis=1).reshape(o.shape[:-1])
        return nearest

    return RulePolicy(rule)


def run_up(env: Any) -> RulePolicy:
    """Return a rule for the puck: take a run-up, and arrive slowly."""
    _domain(env, PuckEnv, "the puck")
    left, right, slope = 0, 2, 8.0  # actions, and where the hill becomes steep

    def rule(o: Floats) -> Integers:
        x, v = o[..., 0], o[..., 1]
        backwards = (v <= 0.0) & (x > -8.0) & (x < slope)
        allowed = np.sqrt(np.maximum(0.3 * (puck.GOAL_PLACE[0] - x), 0.0)) + 0.2
        return np.where(backwards | ((x > slope) & (v > allowed)), left, right)

    return RulePolicy(rule)


def swing_up(env: Any) -> RulePolicy:
    """Return a rule for the car: accelerate the way it rolls, and leave slowly."""
    _domain(env, CarOnHillEnv, "Car on the Hill")

    def rule(o: Floats) -> Integers:
        y, v = o[..., 0], o[..., 1]
        rolling = (v > 0.0) | (y < -0.6)
        return np.where(rolling & ~((y > 0.3) & (v > 1.2)), 1, 0)

    return RulePolicy(rule)


_MAZE: Mapping[str, Expert] = {"round": round_the_walls}
EXPERTS: Mapping[str, Mapping[str, Expert]] = {
    "eutree/CarOnHill-v0": {"swing": swing_up},
    "eutree/MazeA-v0": _MAZE,
    "eutree/MazeB-v0": _MAZE,
    "eutree/MazeC-v0": _MAZE,
    "eutree/MazeD-v0": _MAZE,
    "eutree/Puck-v0": {"run-up": run_up},
}


def _seen(walls: Floats, place: Floats, others: Floats) -> Floats:
    """Return the distances from a place to others, infinite behind a wall."""
    there = others - place
    reached = np.abs(walk(walls, np.tile(place, (len(others), 1)), there) - others).max(axis=1)
    return np.where(reached <= 2.0 * GAP, np.linalg.norm(there, axis=1), np.inf)


def _domain(env: Any, kind: type[ModelledDomain], name: str) -> Any:
    if not isinstance(env.unwrapped, kind):
        raise InvalidArgumentError(f"env must be {name} for this expert, got {env.unwrapped}")
    return env.unwrapped
