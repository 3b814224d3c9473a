"""Trees of very many leaves, made at once and not split by split."""

import numpy as np

from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree


def large_policy(n_leaves, *, n_features=3, seed=0):
    """Return a balanced tree over the unit cube, its cuts and its two actions drawn."""
    rng = np.random.default_rng(seed)
    nodes, n_made = [], 0
    work = [(n_leaves, np.zeros(n_features), np.ones(n_features), None, "")]
    while work:
        size, low, high, parent, side = work.pop()
        node = len(nodes)
        if parent is not None:
            nodes[parent][side] = node
        if size == 1:
            nodes.append(
                {"feature": -1, "threshold": np.nan, "left": -1, "right": -1, "leaf": n_made}
            )
            n_made += 1
            continue
        feature = int(rng.integers(n_features))
        cut = low[feature] + (high[feature] - low[feature]) * rng.uniform(0.3, 0.7)
        nodes.append({"feature": feature, "threshold": cut, "left": 0, "right": 0, "leaf": -1})
        below, beyond = high.copy(), low.copy()
        below[feature] = beyond[feature] = cut
        work += [
            (size - size // 2, beyond, high, node, "right"),
            (size // 2, low, below, node, "left"),
        ]
    columns = {
        name: np.array(
            [node[name] for node in nodes], np.float64 if name == "threshold" else np.intp
        )
        for name in nodes[0]
    }
    features = tuple(Feature(f"x{j}", "", 0.0, 1.0) for j in range(n_features))
    tree = DecisionTree(n_features, **columns)
    return TreePolicy(tree, rng.integers(0, 2, n_leaves), Schema(features, ("stop", "go")))
