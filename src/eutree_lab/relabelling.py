"""From a policy that is no tree to a tree: C4.5 on its actions.

A codebook's cells are no boxes, and a look-ahead decides by a model. A tree is shown, exported and
signed all the same: C4.5 learns the method's own actions at the observations that it came to. How
often both agree there, the *fidelity*, is reported beside both returns.
"""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.learners import Decisions
from eutree.trees.edit import merge

RELEASE_8 = C45Settings()


def relabelled(
    observations: Floats, actions: Integers, n_actions: int, *, settings: C45Settings = RELEASE_8
) -> Decisions:
    """Return the tree that C4.5 makes of observations and the actions chosen there.

    Args:
        observations: Where the method has been, shape [N, d], at least one row.
        actions: Its action at each, shape [N].
        n_actions: Number of actions A.
        settings: The choices of C4.5; release 8 by default.
    """
    grown = grow(observations, actions, n_classes=n_actions, settings=settings)
    tree, labels = merge(*grown.to_decision_tree())
    same = labels[tree.leaf_index(observations)] == actions
    return Decisions(tree=tree, actions=labels, fidelity=float(np.mean(same)))
