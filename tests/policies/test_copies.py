"""Values stay frozen where they are copied or sent to another process."""

import copy
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

import eutree
from eutree.inspection.regions import domain
from eutree.policies import LeafStatistics
from eutree.trees import _kernels
from tests.worlds import recorded

COPIES = {
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


def arrays_in(value, name="it"):
    """Yield the arrays in a value and in the values that it is made of, by name."""
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, tuple):
        for entry in value:
            yield from arrays_in(entry, name)
    elif hasattr(value, "__dataclass_fields__"):
        for one in fields(value):
            yield from arrays_in(getattr(value, one.name), f"{name}.{one.name}")


@pytest.fixture(scope="module")
def values():
    demos = recorded()
    policy = eutree.fit_expert_tree(demos)
    numbers = np.ones((policy.n_leaves, policy.schema.n_actions))
    leaves = LeafStatistics(numbers, numbers, numbers)
    grown = eutree.C45Classifier().fit(demos.observations, demos.actions).tree_
    return replace(policy, leaves=leaves), demos, domain(policy.schema), grown


@pytest.mark.parametrize("how", COPIES)
def test_arrays_of_a_copy_are_read_only(values, how):
    for value in values:
        mine, theirs = dict(arrays_in(value)), dict(arrays_in(COPIES[how](value)))
        assert len(mine) == len(theirs) > 0
        for name, array in theirs.items():
            np.testing.assert_array_equal(array, mine[name])
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0


@pytest.mark.parametrize("how", COPIES)
def test_a_copy_decides_by_kernels_that_are_compiled_already(values, how):
    """They were compiled again in every process that a policy was sent to."""
    policy, demos, *_ = values
    decided = policy.predict(demos.observations)[0]
    known = list(_kernels.locate.signatures)
    np.testing.assert_array_equal(COPIES[how](policy).predict(demos.observations)[0], decided)
    assert _kernels.locate.signatures == known


@pytest.mark.parametrize("how", COPIES)
def test_equal_policies_are_one_entry_of_a_set(values, how):
    policy, *_ = values
    other = replace(policy, actions=(policy.actions + 1) % policy.schema.n_actions)
    assert {policy, COPIES[how](policy), other} == {policy, other}
    assert len({policy, COPIES[how](policy), other}) == 2
