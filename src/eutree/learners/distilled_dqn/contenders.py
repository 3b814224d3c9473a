"""Trees that race for a policy's place, what was imagined of them and what they earned."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.world_model import ActionTree
from eutree.world_model.action_trees import n_leaves

ORIGINS = ("start", "cart", "pruned", "pruned-weighted")
UNKNOWN = float("nan")


@dataclass
class Contender:
    """A tree that is, was or may become the policy.

    Attributes:
        tree: The tree.
        origin: How it was made: the start, CART as it is, or pruned by imagined returns from a
            plain or from a weighted CART.
        imagined: Its score in the latest world model; NaN before the first.
        returns: Its returns in all races so far.
    """

    tree: ActionTree
    origin: str
    imagined: float = UNKNOWN
    returns: list[float] = field(default_factory=list)

    @property
    def mean_return(self) -> float:
        """Mean of its returns; NaN where there is none."""
        return float(np.mean(self.returns)) if self.returns else UNKNOWN

    def worth(self, price: float) -> float:
        """Return its mean return less what its leaves have to earn; NaN where there is none."""
        return self.mean_return - price * n_leaves(self.tree)

    def sure_worth(self, price: float) -> float:
        """Return its worth less a standard error; -inf for fewer than two returns."""
        n = len(self.returns)
        if n < 2:
            return -math.inf
        return self.worth(price) - float(np.std(self.returns, ddof=1)) / math.sqrt(n)


def packed_contenders(contenders: Sequence[Contender]) -> dict[str, NDArray[Any]]:
    """Return contenders as arrays."""
    trees = packed_trees([one.tree for one in contenders])
    return trees | {
        "origin": np.array([ORIGINS.index(one.origin) for one in contenders], dtype=np.int64),
        "imagined": np.array([one.imagined for one in contenders]),
        "n_returns": np.array([len(one.returns) for one in contenders], dtype=np.int64),
        "returns": np.array([r for one in contenders for r in one.returns], dtype=np.float64),
    }


def unpacked_contenders(state: Mapping[str, NDArray[Any]]) -> list[Contender]:
    """Return the contenders that ``packed_contenders`` made arrays of."""
    ends = np.cumsum(state["n_returns"])[:-1]
    returns = np.split(state["returns"], ends)
    return [
        Contender(tree, ORIGINS[origin], imagined, earned.tolist())
        for tree, origin, imagined, earned in zip(
            unpacked_trees(state),
            state["origin"].tolist(),
            state["imagined"].tolist(),
            returns,
            strict=True,
        )
    ]


def packed_trees(trees: Sequence[ActionTree]) -> dict[str, NDArray[Any]]:
    """Return trees as arrays, one after the other."""
    columns = {
        name: np.concatenate([getattr(tree, name) for tree in trees]) for name in ActionTree._fields
    }
    return columns | {"n_nodes": np.array([tree.feature.size for tree in trees], dtype=np.int64)}


def unpacked_trees(state: Mapping[str, NDArray[Any]]) -> list[ActionTree]:
    """Return the trees that ``packed_trees`` made arrays of."""
    ends = np.cumsum(state["n_nodes"])[:-1]
    columns = [np.split(np.array(state[name]), ends) for name in ActionTree._fields]
    return [
        ActionTree._make(np.ascontiguousarray(column) for column in columns_of_tree)
        for columns_of_tree in zip(*columns, strict=True)
    ]
