"""Compiled loops on policy trees: where two of them differ, and how one is cut down.

Apart from ``_kernels.py`` because they run nothing: they look at trees and at recorded steps.
"""

import numpy as np

from eutree.arrays import Integers
from eutree.compiled import compiled_later
from eutree.world_model._kernels import ActionTree, Episodes, leaf_node


@compiled_later
def overlay(policy: ActionTree, rival: ActionTree, n_features: int, out: Integers) -> None:
    """Write, for each leaf node of the policy, the lowest node of the rival that holds its box."""
    n_nodes = policy.feature.size
    low = np.full((n_nodes, n_features), -np.inf)
    high = np.full((n_nodes, n_features), np.inf)
    # Preorder: the box of a node, low < x <= high, is known before its children get theirs.
    for node in range(n_nodes):
        feature = policy.feature[node]
        if feature >= 0:
            left, right = policy.left[node], policy.right[node]
            low[left], high[left] = low[node], high[node]
            low[right], high[right] = low[node], high[node]
            high[left, feature] = min(high[node, feature], policy.threshold[node])
            low[right, feature] = max(low[node, feature], policy.threshold[node])
            continue
        at = 0
        # The box of the leaf lies in that of ``at``; it stops where the rival would divide the box.
        while rival.feature[at] >= 0:
            if high[node, rival.feature[at]] <= rival.threshold[at]:
                at = rival.left[at]
            elif low[node, rival.feature[at]] >= rival.threshold[at]:
                at = rival.right[at]
            else:
                break
        out[node] = at


@compiled_later
def bucket(
    node: Integers,  # [K] leaf node of each step
    begin: Integers,  # [M + 1] out
    steps: Integers,  # [K] out
) -> None:
    """Sort the steps by node, keeping their order; those of node m start at ``begin[m]``."""
    begin[:] = 0
    # A counting sort, stable because steps are taken in order.
    for k in range(node.size):
        begin[node[k] + 1] += 1
    for m in range(1, begin.size):
        begin[m] += begin[m - 1]
    at = begin.copy()
    for k in range(node.size):
        steps[at[node[k]]] = k
        at[node[k]] += 1


@compiled_later
def departures(
    policy: ActionTree,
    rival: ActionTree,
    within: Integers,  # [M] overlay
    episodes: Episodes,
    begin: Integers,  # [M + 1]
    steps: Integers,  # [K] by leaf node of the policy
    out: Integers,  # [E]
) -> None:
    """Write the first step of each episode at which the rival acts differently; -1: none.

    Only steps in leaves that the rival treats in more than one way, or differently, are visited.
    """
    out[:] = -1
    for leaf in range(policy.feature.size):
        if policy.feature[leaf] >= 0:
            continue
        root, taken = within[leaf], policy.action[leaf]
        # One leaf of the rival holds the box and acts alike there: none of its steps can differ.
        if rival.feature[root] < 0 and rival.action[root] == taken:
            continue
        for i in range(begin[leaf], begin[leaf + 1]):
            k = steps[i]
            known = out[episodes.owner[k]]
            # Steps are numbered in time, so the smallest k of an episode is its first departure.
            if known >= 0 and known < k:
                continue
            if rival.action[leaf_node(rival, root, episodes.states[k])] != taken:
                out[episodes.owner[k]] = k


@compiled_later
def replace_by_child(
    tree: ActionTree,
    node: int,
    child: int,
    out: ActionTree,  # room for as many nodes
    source: Integers,  # [M] out: the node of ``tree`` that each node was
) -> int:
    """Write the tree with ``node`` replaced by one of its children; return its number of nodes.

    Sibling leaves of equal action are merged.
    """
    feature, left, right = tree.feature.copy(), tree.left.copy(), tree.right.copy()
    action = tree.action.copy()
    # Preorder: a parent comes before its children.
    for parent in range(node):
        if feature[parent] >= 0 and left[parent] == node:
            left[parent] = child
        if feature[parent] >= 0 and right[parent] == node:
            right[parent] = child
    # Backwards, so that children are merged before their parent looks at them.
    for parent in range(feature.size - 1, -1, -1):
        if feature[parent] < 0:
            continue
        one, other = left[parent], right[parent]
        if feature[one] < 0 and feature[other] < 0 and action[one] == action[other]:
            feature[parent] = -1
            action[parent] = action[one]
    waiting, parents = np.empty(feature.size, np.int64), np.empty(feature.size, np.int64)
    waiting[0], parents[0] = child if node == 0 else 0, -1
    n_waiting, n_nodes = 1, 0
    # Depth first with the left child on top: nodes come out in preorder, and one that follows its
    # parent directly is the left child.
    while n_waiting > 0:
        n_waiting -= 1
        at, parent = waiting[n_waiting], parents[n_waiting]
        if parent >= 0 and parent == n_nodes - 1:
            out.left[parent] = n_nodes
        elif parent >= 0:
            out.right[parent] = n_nodes
        source[n_nodes] = at
        out.feature[n_nodes] = feature[at]
        out.left[n_nodes], out.right[n_nodes] = 0, 0
        out.threshold[n_nodes] = tree.threshold[at] if feature[at] >= 0 else 0.0
        out.action[n_nodes] = action[at] if feature[at] < 0 else 0
        if feature[at] >= 0:
            waiting[n_waiting], parents[n_waiting] = right[at], n_nodes
            waiting[n_waiting + 1], parents[n_waiting + 1] = left[at], n_nodes
            n_waiting += 2
        n_nodes += 1
    return n_nodes
