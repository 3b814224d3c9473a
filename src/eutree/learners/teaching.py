"""What a tree makes of demonstrations that come while it learns: distinctions, leaf by leaf.

C4.5 turned the first demonstrations into the expert tree. A leaf in which somebody has since shown
different actions for different observations is refined in the same way: C4.5 is fitted to what was
shown in it, and the leaf becomes that subtree. So a state tree of one leaf becomes the expert tree,
and what reinforcement has learned elsewhere stays.
"""

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.trees import DecisionTree


def refined(
    tree: DecisionTree,
    actions: Integers,
    observations: Floats,
    shown: Integers,
    n_actions: int,
    *,
    leaves: Integers,
) -> tuple[DecisionTree, Integers]:
    """Return the tree with ``leaves`` refined by what was shown, and the action of each leaf.

    Args:
        tree: The tree.
        actions: Action of each of its leaves, shape [L].
        observations: Observations at which somebody showed what to do, shape [N, d].
        shown: The action shown at each, shape [N].
        n_actions: Number of actions A.
        leaves: Leaves to refine; new leaves get the numbers that follow.
    """
    labels = tree.leaf_index(observations)
    chosen = actions.tolist()
    for leaf in leaves.tolist():
        rows = labels == leaf
        grown = grow(observations[rows], shown[rows], n_classes=n_actions, settings=C45Settings())
        part, part_actions = grown.to_decision_tree()
        places = [(0, leaf)]
        while places:
            node, place = places.pop()
            if part.leaf[node] >= 0:
                chosen[place] = int(part_actions[part.leaf[node]])
                continue
            tree = tree.split(place, int(part.feature[node]), float(part.threshold[node]))
            chosen.append(chosen[place])
            places += [
                (int(part.left[node]), place),
                (int(part.right[node]), tree.n_leaves - 1),
            ]
    return tree, np.array(chosen, dtype=np.int64)
