"""Partitions as one sees them: the regions tile the plane, and are what the learner decides by."""

import numpy as np
import pytest

from eutree.discretization.codebook import codebook_in_leaves
from eutree.discretization.kuhn import Grid
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.learners import METHODS
from eutree.learners.learner import HasPartition
from eutree.learners.looking import partition_of, plane_of
from eutree.learners.partition import (
    Plane,
    codewords_seen,
    corners_seen,
    leaves_seen,
    rectangles,
)
from eutree.trees import DecisionTree
from tests.learners.battery import case_of


def area(outline):
    """Return the area of a polygon, by the shoelace formula."""
    x, y = outline.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def holds(outline, point):
    """Return whether a convex polygon holds a point."""
    along, to = np.roll(outline, -1, axis=0) - outline, point - outline
    turns = along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0]
    return bool((turns >= -1e-12).all() or (turns <= 1e-12).all())


def random_tree(generator, d, cuts=12):
    tree = DecisionTree.single_leaf(d)
    for _ in range(cuts):
        leaf = int(generator.integers(tree.n_leaves))
        tree = tree.split(leaf, int(generator.integers(d)), float(generator.random()))
    return tree


def unit_plane(generator, d):
    x, y = generator.permutation(d)[:2].tolist()
    return Plane(x, y, generator.random(d), np.zeros(2), np.ones(2))


def check_regions(regions, plane, number_of, generator):
    """Tiling by area, and the region of each of some points of the plane by what it says."""
    assert sum(area(region.outline) for region in regions) == pytest.approx(1.0)
    for _ in range(60):
        point = plane.at.copy()
        point[plane.axes] = generator.random(2)
        mine = [region for region in regions if holds(region.outline, point[plane.axes])]
        assert number_of(point) in [region.value for region in mine]
        assert len(mine) == 1  # a point on a cut has no chance


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("d", [2, 4])
def test_leaves_are_the_leaves(d, seed):
    generator = np.random.default_rng(seed)
    tree, plane = random_tree(generator, d), unit_plane(generator, d)
    numbers = np.arange(tree.n_leaves)
    regions = leaves_seen(tree, numbers % 3, numbers.astype(float), plane)
    assert all(region.action == region.value % 3 for region in regions)
    check_regions(regions, plane, lambda p: tree.leaf_of(p.tolist()), generator)


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


def test_a_box_beside_the_plane_is_not_seen():
    low, high = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5]]), np.array([[1.0, 1.0, 0.5], [1.0] * 3])
    plane = Plane(0, 1, np.array([9.0, 9.0, 0.5]), np.zeros(2), np.full(2, 0.4))
    found, outlines = rectangles(low, high, plane)
    assert found.tolist() == [0]  # 0.5 is the upper end of the first
    assert outlines[0].max() == 0.4


@pytest.mark.parametrize("name", [name for name in METHODS if name != "distilled-dqn"])  # slow
def test_every_method_shows_a_partition_that_tiles_the_plane(name):
    case = case_of(name, "tree+demos")
    reason = case.method.needs.refusal(case.problem, case.start)
    if reason:
        pytest.skip(reason)
    learner = case.lived(episodes=4)
    schema = learner.decisions().policy(case.problem).schema
    x, y = schema.feature_names[:2]
    plane = plane_of(learner, schema, x, y)
    before = {k: v.tobytes() for k, v in learner.state().items()}
    partition = partition_of(learner, plane)
    assert {k: v.tobytes() for k, v in learner.state().items()} == before
    whole = float(np.prod(plane.high - plane.low))
    assert sum(area(r.outline) for r in partition.regions) == pytest.approx(whole, rel=1e-6)
    if not isinstance(learner, HasPartition):
        decisions = learner.decisions()
        for region in partition.regions:
            point = plane.at.copy()
            point[plane.axes] = region.outline.mean(axis=0)
            assert decisions.actions[decisions.tree.leaf_of(point.tolist())] == region.action


def test_the_cells_of_parti_game_have_costs_and_a_goal():
    case = case_of("parti-game", "demos")
    learner, schema = case.lived(episodes=3), case.problem.schema
    plane = plane_of(learner, schema, *schema.feature_names[:2])
    partition = partition_of(learner, plane)
    costs = learner.game.plan().cost
    assert {region.value for region in partition.regions} <= set(costs.tolist())
    assert partition.values == "aims to the goal"
    assert len(partition.goals) == len(learner.game.cells.goals)


def test_a_plane_needs_two_features_that_there_are():
    case = case_of("u-tree", "nothing")
    learner, problem = case.begun(), case.problem
    names = problem.schema.feature_names
    with pytest.raises(UnknownNameError, match="nowhere"):
        plane_of(learner, problem.schema, names[0], "nowhere")
    with pytest.raises(InvalidArgumentError, match="two of the features"):
        plane_of(learner, problem.schema, names[0], names[0])
