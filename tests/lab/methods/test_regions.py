"""Cells and grids as one sees them: their regions tile the plane."""

import numpy as np
import pytest
from docs.pictures.partitions import Plane, cells_seen, corners_seen

from eutree.trees import DecisionTree
from eutree_lab.root_box import root_box
from eutree_lab.vrd.kuhn import Grid
from tests.learners.battery import case_of


def area(outline):
    """Return the area of a polygon, by the shoelace formula."""
    x, y = outline.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


@pytest.mark.parametrize("seed", range(3))
def test_two_features_are_seen_in_kuhn_triangles(seed):
    generator = np.random.default_rng(seed)
    grid = Grid.uniform([0.0, 0.0], [1.0, 1.0], (2, 1)).halve([(1, 0), (3, 1)])
    values = generator.normal(size=grid.n_corners)
    plane = Plane(1, 0, np.zeros(2), np.zeros(2), np.ones(2))
    regions = corners_seen(grid, np.zeros(grid.n_corners, dtype=np.int64), values, plane)
    assert len(regions) == 2 * grid.tree.n_leaves
    assert sum(area(region.outline) for region in regions) == pytest.approx(1.0)
    for region in regions:  # linear in a triangle: its mean is the value in its middle
        middle = region.outline.mean(axis=0)[::-1]
        assert region.value == pytest.approx(float(grid.interpolate(values, middle[None])[0]))


def test_more_features_are_seen_in_boxes():
    grid = Grid.uniform([0.0] * 3, [1.0] * 3, (1, 1, 1))
    plane = Plane(0, 2, np.full(3, 0.2), np.zeros(2), np.ones(2))
    actions = (grid.corners[:, 0] > 0.7).astype(np.int64)
    regions = corners_seen(grid, actions, grid.corners[:, 1], plane)
    assert len(regions) == 4
    assert [region.value for region in regions] == [0.25] * 4  # the mean of 0 and 0.5
    assert sorted(region.action for region in regions) == [0, 0, 0, 0]


def test_the_cells_of_parti_game_have_costs_and_a_goal():
    case = case_of("parti-game", "demos")
    learner, schema = case.lived(episodes=3), case.problem.schema
    low, high = root_box(
        case.problem, DecisionTree.single_leaf(schema.n_features), learner.history.observations
    )
    plane = Plane(0, 1, (low + high) / 2, low[:2], high[:2])
    partition = cells_seen(learner.game, plane)
    costs = learner.game.plan().cost
    assert {region.value for region in partition.regions} <= set(costs.tolist())
    assert len(partition.goals) == len(learner.game.cells.goals)
