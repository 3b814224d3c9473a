"""Which leaves decide otherwise than an earlier policy did, on what was recorded."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.policies import TreePolicy
from eutree.validation import check_observations


@dataclass(frozen=True)
class LeafChange:
    """What an earlier policy did where a leaf decides now.

    Attributes:
        was: The earlier action, the most frequent of those that differ.
        share: The share of the leaf's recorded steps that were decided otherwise.
    """

    was: int
    share: float

    def facts(self) -> dict[str, Any]:
        """Return the change in JSON's types."""
        return {"was": self.was, "share": round(self.share, 4)}


def changed_leaves(
    before: TreePolicy, after: TreePolicy, observations: ArrayLike
) -> dict[int, LeafChange]:
    """Return the leaves of ``after`` that decide recorded steps otherwise than ``before``.

    Args:
        before: The earlier policy.
        after: The later policy, of the same features and actions.
        observations: Recorded observations, shape [N, d], in the features of both trees.
    """
    before.schema.check_same(after.schema, "the later policy", of="the earlier")
    rows = check_observations("observations", observations, n_features=after.tree.n_features)
    earlier = before.actions[before.tree.leaf_index(rows)]
    leaves = after.tree.leaf_index(rows)
    found = {}
    for leaf in range(after.n_leaves):
        mine = earlier[leaves == leaf]
        others = mine[mine != after.actions[leaf]]
        if others.size:
            was = int(np.bincount(others).argmax())
            found[leaf] = LeafChange(was, others.size / mine.size)
    return found
