"""Compiled twin of ``_dynamics``: one step of every copy of the environment."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.compiled import compiled
from eutree.envs._dynamics import COLLISION, GOAL, RUNNING, STOP, TIME_LIMIT

# Order of the constants that ``advance_all`` is given.
CONSTANTS = (
    "noise", "agent_step", "opponent_step", "half_path", "main_path_length", "collision_square",
    "goal_reward", "collision_reward", "stop_reward", "start_number", "bounce_number",
)  # fmt: skip


class Copies(NamedTuple):
    """The constants of all copies, the chance of their episodes, and their states."""

    constants: Floats  # [11], in the order of ``CONSTANTS``
    crossing: Floats  # [N]
    uniforms: Floats  # [E, 2 N]
    noise: Floats  # [E, T, N + 1]
    positions: Floats  # [E]
    opponents: Floats  # [E, N]
    directions: Floats  # [E, N]
    steps: Integers  # [E]


@compiled
def begin(
    e: int,
    constants: Floats,
    uniforms: Floats,  # [E, 2 N]
    positions: Floats,  # [E]
    opponents: Floats,  # [E, N]
    directions: Floats,  # [E, N]
    steps: Integers,  # [E]
) -> None:
    """Put copy ``e`` at the start of the episode that ``uniforms`` describes."""
    count = opponents.shape[1]
    half_path, start = constants[3], constants[9]
    positions[e] = 0.0
    steps[e] = 0
    for i in range(count):
        # uniforms[e] holds a place on the path for each opponent, then a direction for each.
        opponents[e, i] = (2.0 * uniforms[e, i] - 1.0) * half_path
        directions[e, i] = -1.0 if uniforms[e, count + i] < 0.5 else 1.0
        if start != 0:  # at an end, heading inwards: either one, or the upper for all
            directions[e, i] = directions[e, i] if start == 1 else -1.0
            opponents[e, i] = -directions[e, i] * half_path


@compiled
def move(
    e: int,
    action: int,
    constants: Floats,
    noise: Floats,  # [E, T, N + 1]
    positions: Floats,  # [E]
    opponents: Floats,  # [E, N]
    directions: Floats,  # [E, N]
    steps: Integers,  # [E]
) -> None:
    """Move copy ``e`` one step, operation by operation as ``_dynamics.advance``."""
    share, half_path = constants[0], constants[3]
    path = 2.0 * half_path
    # The draws of this step: the agent's first, then those of the opponents in their order.
    row = noise[e, steps[e]]
    # A factor below 0 would be a step backwards.
    factor = max(1.0 + share * row[0], 0.0)
    positions[e] = min(positions[e] + action * (constants[1] * factor), constants[4])
    for i in range(opponents.shape[1]):
        factor = max(1.0 + share * row[i + 1], 0.0)
        target = opponents[e, i] + directions[e, i] * (constants[2] * factor)
        beyond = target + half_path
        if not 0.0 <= beyond < path:  # else no end is passed and the lines below change nothing
            if constants[10] == 0:
                # Folded back into the path: it turns at each end passed, so an odd number of them
                # reverses it. The parity is taken by floor, for passes may be negative.
                passes = np.floor(beyond / path)
                turns = 1.0 - 2.0 * (passes - 2.0 * np.floor(passes / 2.0))
                target = turns * (target - path * passes)
                directions[e, i] *= turns
            elif target < -half_path or target >= half_path:  # as _dynamics.turn compares
                directions[e, i] *= -1.0
        # Folding rounds, and the other rule has passed the end: neither leaves the path.
        opponents[e, i] = min(max(target, -half_path), half_path)
    steps[e] += 1


@compiled
def judge(
    e: int,
    max_steps: int,
    constants: Floats,
    crossing: Floats,  # [N]
    positions: Floats,  # [E]
    opponents: Floats,  # [E, N]
    steps: Integers,  # [E]
) -> int:
    """Return how the episode of copy ``e`` has ended, as ``_dynamics.ending``."""
    # Squares are compared as in the single environment: a root could round to the other side. A
    # collision comes first, where both happen in one step.
    for i in range(opponents.shape[1]):
        along = positions[e] - crossing[i]
        if along * along + opponents[e, i] * opponents[e, i] <= constants[5]:
            return COLLISION
    if positions[e] >= constants[4]:
        return GOAL
    return TIME_LIMIT if steps[e] >= max_steps else RUNNING


@compiled
def show(
    e: int,
    positions: Floats,  # [E]
    opponents: Floats,  # [E, N]
    directions: Floats,  # [E, N]
    observations: Floats,  # [E, d]
) -> None:
    """Write the observation of copy ``e``; directions only where there is room for them."""
    count = opponents.shape[1]
    observations[e, 0] = positions[e]
    for i in range(count):
        observations[e, 1 + i] = opponents[e, i]
    for i in range(observations.shape[1] - 1 - count):
        observations[e, 1 + count + i] = directions[e, i]


@compiled
def advance_all(
    actions: Integers,  # [E]
    begins: Booleans,  # [E] begin an episode instead of moving
    max_steps: int,
    copies: Copies,
    observations: Floats,  # [E, d] out
    rewards: Floats,  # [E] out
    endings: Int32s,  # [E] out
) -> None:
    """Move every copy one step, or begin its next episode, and show them all."""
    constants, uniforms, positions = copies.constants, copies.uniforms, copies.positions
    opponents, directions, steps = copies.opponents, copies.directions, copies.steps
    crossing, noise = copies.crossing, copies.noise
    for e in range(actions.size):
        if begins[e]:
            begin(e, constants, uniforms, positions, opponents, directions, steps)
            rewards[e], endings[e] = 0.0, RUNNING
        else:
            move(e, actions[e], constants, noise, positions, opponents, directions, steps)
            how = judge(e, max_steps, constants, crossing, positions, opponents, steps)
            # Added in the order of the single environment, so that rewards are equal to the bit.
            price = constants[8] if actions[e] == STOP else 0.0
            if how == GOAL:
                price += constants[6]
            elif how == COLLISION:
                price += constants[7]
            rewards[e], endings[e] = price, how
        show(e, positions, opponents, directions, observations)
