"""Partitions as one sees them: the regions tile the plane, and are what the learner decides by."""

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.learners import METHODS
from eutree.learners.learner import HasPartition
from eutree.learners.looking import partition_of, plane_of
from eutree.learners.partition import Plane, leaves_seen, rectangles
from tests.learners.battery import case_of
from tests.learners.planes import area, check_regions, random_tree, unit_plane


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("d", [2, 4])
def test_leaves_are_the_leaves(d, seed):
    generator = np.random.default_rng(seed)
    tree, plane = random_tree(generator, d), unit_plane(generator, d)
    numbers = np.arange(tree.n_leaves)
    regions = leaves_seen(tree, numbers % 3, numbers.astype(float), plane)
    assert all(region.action == region.value % 3 for region in regions)
    check_regions(regions, plane, lambda p: tree.leaf_of(p.tolist()), generator)


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


def test_a_plane_needs_two_features_that_there_are():
    case = case_of("u-tree", "nothing")
    learner, problem = case.begun(), case.problem
    names = problem.schema.feature_names
    with pytest.raises(UnknownNameError, match="nowhere"):
        plane_of(learner, problem.schema, names[0], "nowhere")
    with pytest.raises(InvalidArgumentError, match="two of the features"):
        plane_of(learner, problem.schema, names[0], names[0])
