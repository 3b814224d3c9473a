"""The grid that the learner's results are held against is a sound one."""

import numpy as np
from benchmarks import grid_value_iteration as grids

from eutree.envs import _dynamics as dynamics
from eutree.envs._dynamics import EvasionParameters
from eutree.mdp import TERMINAL


def grid():
    return grids.Grid(*dynamics.bounds(EvasionParameters()), cells=grids.CELLS)


def test_every_observation_has_a_cell_of_its_own_place():
    assert grid()(np.array([0.0, -11.0, -11.0])) == 0
    assert grid()(np.array([30.0, 11.0, 11.0])) == np.prod(grids.CELLS) - 1
    assert grid()(np.array([1.5, -11.0, -10.5])) == 22 * 22
    both = np.array([[0.2, -10.2, 10.9], [0.2, -9.8, 10.9]])
    assert np.diff(grid()(both)) == 22


def test_transitions_end_where_episodes_end_and_never_bridge_two():
    cells, actions, rewards, reached = grids.sample(3.2, grid(), 30_000, seed=0)
    assert cells.size == actions.size == rewards.size == reached.size == 30_000
    ended = reached == TERMINAL
    assert (ended == (np.abs(rewards) > 2.0)).all()
    moved = reached[~ended] // 22**2 - cells[~ended] // 22**2  # rows of the main path
    assert set(moved[actions[~ended] == dynamics.STOP]) == {0}
    assert set(moved[actions[~ended] == dynamics.GO]) <= {1, 2, 3}


def test_a_small_sample_gives_a_policy_that_beats_going_without_a_look():
    found = grids.measure(3.2, transitions=100_000, episodes=100)
    assert found.success_interval.high > 0.8  # 100 episodes tell it to within ten points
    assert found.return_interval.high > 60.0
