"""Slow, obvious twins of the learner's kernels and of its history."""

import numpy as np


def rows_of(labels, leaf):
    """Return the rows that carry a label, ascending."""
    return [row for row, label in enumerate(labels) if label == leaf]


def labels_of(tree, history):
    """Return L(o) and L(o') of every stored transition, straight from the tree."""
    left = [tree.leaf_of(o.tolist()) for o in history.observations]
    entered = [tree.leaf_of(o.tolist()) for o in history.next_observations]
    ended = history.entered == -1
    return left, np.where(ended, -1, entered).tolist()


def one_step_target(history, row, values, discount):
    """Return r + discount * V(L(o')), with V = 0 after the end."""
    entered = history.entered[row]
    return history.rewards[row] + (0.0 if entered < 0 else discount * values[entered])


def lambda_target(history, row, values, greedy, discount, decay):
    """Return the lambda-return of a row by its recursive definition."""
    reward, entered = history.rewards[row], history.entered[row]
    if entered < 0:
        return reward
    following = row + 1
    goes_on = (
        following < history.size
        and history.continues[following]
        and history.actions[following] == greedy[history.left[following]]
    )
    if not goes_on:
        return reward + discount * values[entered]
    rest = lambda_target(history, following, values, greedy, discount, decay)
    return reward + discount * ((1 - decay) * values[entered] + decay * rest)
