"""Codebooks and grids as one sees them: their regions tile the plane."""

import numpy as np
import pytest

from eutree.learners.looking import partition_of, plane_of
from eutree.learners.partition import Plane
from eutree_lab.vqql.codebook import codebook_in_leaves
from eutree_lab.vqql.regions import codewords_seen
from eutree_lab.vrd.kuhn import Grid
from eutree_lab.vrd.regions import corners_seen
from tests.learners.battery import case_of
from tests.learners.planes import area, check_regions, random_tree, unit_plane


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("d", [2, 3])
def test_codewords_are_nearest_inside_their_leaf(d, seed):
    generator = np.random.default_rng(seed)
    scale = generator.uniform(0.1, 3.0, d)
    book = codebook_in_leaves(
        random_tree(generator, d, cuts=2), generator.random((300, d)), 24, scale=scale
    )
    plane, numbers = unit_plane(generator, d), np.arange(book.n_regions)
    regions = codewords_seen(book, numbers % 2, numbers.astype(float), plane)
    check_regions(regions, plane, lambda p: int(book.regions(p[None])[0]), generator)


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
    plane = plane_of(learner, schema, *schema.feature_names[:2])
    partition = partition_of(learner, plane)
    costs = learner.game.plan().cost
    assert {region.value for region in partition.regions} <= set(costs.tolist())
    assert partition.values == "aims to the goal"
    assert len(partition.goals) == len(learner.game.cells.goals)
