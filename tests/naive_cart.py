"""A slow, obvious CART: every cut of every leaf, weighed by the definition of the Gini impurity."""

import numpy as np


def impurity(labels, weights, n_classes):
    """Return the weight of the rows times their Gini impurity."""
    total = weights.sum()
    if total <= 0.0:
        return 0.0
    shares = np.bincount(labels, weights, n_classes) / total
    return total * (1.0 - (shares**2).sum())


def best_gain(observations, labels, weights, n_classes):
    """Return the largest fall of the impurity by any cut, 0 if there is none."""
    own, most = impurity(labels, weights, n_classes), 0.0
    for column in observations.T:
        for threshold in np.unique(column)[:-1]:
            left = column <= threshold
            parts = [
                impurity(labels[side], weights[side], n_classes)
                for side in (left, ~left)
                if weights[side].sum() > 0.0
            ]
            if len(parts) == 2:
                most = max(most, own - sum(parts))
    return most


def total_impurity(tree, observations, labels, weights, n_classes):
    """Return the sum of the impurities of a tree's leaves."""
    leaves = tree.leaf_index(observations)
    return sum(
        impurity(labels[leaves == leaf], weights[leaves == leaf], n_classes)
        for leaf in range(tree.n_leaves)
    )


def best_first(observations, labels, weights, n_classes, max_leaves):
    """Return the total impurity after each cut of growing best leaf first."""
    parts = [np.arange(labels.size)]
    path = [impurity(labels, weights, n_classes)]
    while len(parts) < max_leaves:
        gains = [best_gain(observations[p], labels[p], weights[p], n_classes) for p in parts]
        chosen = int(np.argmax(gains))
        if gains[chosen] <= 1e-9:
            break
        rows = parts.pop(chosen)
        parts += cut_by(observations, labels, weights, n_classes, rows, gains[chosen])
        path.append(path[-1] - gains[chosen])
    return path


def cut_by(observations, labels, weights, n_classes, rows, gain):
    """Return both parts of the first cut of some rows with a gain."""
    own = impurity(labels[rows], weights[rows], n_classes)
    for column in observations.T:
        for threshold in np.unique(column[rows])[:-1]:
            left, right = rows[column[rows] <= threshold], rows[column[rows] > threshold]
            if min(weights[left].sum(), weights[right].sum()) <= 0.0:
                continue
            after = sum(impurity(labels[p], weights[p], n_classes) for p in (left, right))
            if abs(own - after - gain) < 1e-9:
                return [left, right]
    raise AssertionError("no cut has this gain")
