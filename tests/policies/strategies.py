"""Hypothesis strategies for schemas, trees and policies."""

import math

import numpy as np
from hypothesis import strategies as st

from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.trees import DecisionTree

finite = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
ids = st.text(st.characters(exclude_categories=["Cs"], exclude_characters=":"), max_size=8)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | finite | names,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=5,
)


@st.composite
def trees(draw, max_splits=12, n_features=None):
    tree = DecisionTree.single_leaf(n_features or draw(st.integers(1, 4)))
    for _ in range(draw(st.integers(0, max_splits))):
        leaf = draw(st.integers(0, tree.n_leaves - 1))
        tree = tree.split(leaf, draw(st.integers(0, tree.n_features - 1)), draw(finite))
    return tree


@st.composite
def schemas(draw, n_features=None):
    count = n_features or draw(st.integers(1, 4))
    features = []
    for name in draw(st.lists(names, min_size=count, max_size=count, unique=True)):
        low, high = sorted((draw(finite | st.just(-math.inf)), draw(finite | st.just(math.inf))))
        features.append(Feature(name, draw(names), low, high))
    actions = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    return Schema(tuple(features), tuple(actions))


@st.composite
def policies(draw):
    tree = draw(trees())
    schema = draw(schemas(n_features=tree.n_features))
    shape = (tree.n_leaves, schema.n_actions)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    leaves = None
    if draw(st.booleans()):
        values = rng.standard_cauchy((2, *shape))
        values[rng.random(values.shape) < 0.3] = np.nan
        leaves = LeafStatistics(rng.integers(0, 2**40, shape), *values)
    return TreePolicy(
        tree,
        rng.integers(0, schema.n_actions, tree.n_leaves),
        schema,
        draw(
            st.none()
            | st.builds(EnvironmentSpec, ids, st.dictionaries(names, json_values, max_size=3))
        ),
        history=draw(st.sampled_from([k for k in range(4) if tree.n_features % (k + 1) == 0])),
        leaves=leaves,
    )
