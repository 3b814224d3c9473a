"""Compiled loops of imagination: a step of the world model, episodes under a policy tree.

All chance comes from a table of uniform draws: step t of episode e reads the same entries whatever
the policy is, so two policies meet the same luck (common random numbers).
"""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.compiled import compiled

EPISODE_STRIDE = 7919


class Forest(NamedTuple):
    """Model trees in common arrays: one of each feature's displacement, then reward and end.

    Roots 0 to d - 1 are of the displacements, then those of the reward of a step that goes on, of
    the reward of a last step, and of the probability that the step is the last.
    """

    roots: Integers  # [d + 3]
    feature: Integers  # [M]
    threshold: Floats  # [M]
    left: Integers  # [M]
    right: Integers  # [M]
    coefficients: Floats  # [M, p + 1]
    low: Floats  # [M]
    high: Floats  # [M]
    first: Integers  # [M]
    n_rows: Integers  # [M]
    residuals: Floats  # [K]


class ActionTree(NamedTuple):
    """A policy tree with one action at each leaf node; feature -1 marks a leaf."""

    feature: Integers  # [M]
    threshold: Floats  # [M]
    left: Integers  # [M]
    right: Integers  # [M]
    action: Integers  # [M]


class Episodes(NamedTuple):
    """Imagined episodes of one policy, step after step."""

    observations: Floats  # [K, d]
    displacements: Floats  # [K, d] that led to each observation
    earned: Floats  # [K] return before each step
    first: Integers  # [E + 1] first step of each episode
    returns: Floats  # [E]


@compiled
def leaf_node(
    feature: Integers,
    threshold: Floats,
    left: Integers,
    right: Integers,
    root: int,
    x: Floats,
) -> int:
    """Return the leaf node below ``root`` that x falls into."""
    node = root
    while feature[node] >= 0:
        node = left[node] if x[feature[node]] <= threshold[node] else right[node]
    return node


@compiled
def fitted(forest: Forest, node: int, x: Floats) -> float:
    """Return the leaf's fit at x, within the range of what the leaf has seen."""
    p = x.size
    value = forest.coefficients[node, p]
    for j in range(p):
        value += forest.coefficients[node, j] * x[j]
    clipped: float = min(max(value, forest.low[node]), forest.high[node])
    return clipped


@compiled
def model_step(
    forest: Forest,
    draws: Floats,  # [size], a power of two
    at: int,
    action: int,
    observation: Floats,  # [d], in and out
    displacement: Floats,  # [d], in and out
    x: Floats,  # [p] scratch
    y: Floats,  # [p] scratch
) -> tuple[float, bool]:
    """Move one step; return the reward and whether it was the last."""
    d = observation.size
    mask = draws.size - 1
    for i in range(d):
        x[i] = observation[i]
        x[d + i] = displacement[i]
    for i in range(2 * d, x.size):
        x[i] = 0.0
        y[i] = 0.0
    x[2 * d + action] = 1.0
    y[2 * d + action] = 1.0
    trees = (forest.feature, forest.threshold, forest.left, forest.right)
    for i in range(d):
        node = leaf_node(trees[0], trees[1], trees[2], trees[3], forest.roots[i], x)
        pick = int(draws[(at + i) & mask] * forest.n_rows[node])
        move = fitted(forest, node, x) + forest.residuals[forest.first[node] + pick]
        displacement[i] = move
        observation[i] += move
        y[i] = observation[i]
        y[d + i] = move
    node = leaf_node(trees[0], trees[1], trees[2], trees[3], forest.roots[d + 2], y)
    ends = draws[(at + d) & mask] < forest.coefficients[node, y.size]
    root = forest.roots[d + 1] if ends else forest.roots[d]
    node = leaf_node(trees[0], trees[1], trees[2], trees[3], root, y)
    return fitted(forest, node, y), ends


@compiled
def go_on(
    forest: Forest,
    draws: Floats,
    episode: int,
    step: int,
    horizon: int,
    discount: float,
    policy: ActionTree,
    first_action: int,
    observation: Floats,  # [d], changed
    displacement: Floats,  # [d], changed
    x: Floats,  # [p] scratch
    y: Floats,  # [p] scratch
) -> float:
    """Return what the policy earns from here to the end; a first action >= 0 is taken instead."""
    total = 0.0
    weight = discount**step
    action = first_action
    while step < horizon:
        if action < 0:
            node = leaf_node(
                policy.feature, policy.threshold, policy.left, policy.right, 0, observation
            )
            action = policy.action[node]
        at = episode * EPISODE_STRIDE + step * (observation.size + 1)
        reward, ends = model_step(forest, draws, at, action, observation, displacement, x, y)
        total += weight * reward
        weight *= discount
        step += 1
        action = -1
        if ends:
            break
    return total


@compiled
def record(
    forest: Forest,
    draws: Floats,
    starts: Floats,  # [S, d]
    policy: ActionTree,
    horizon: int,
    discount: float,
    out: Episodes,
) -> int:
    """Imagine episodes from the starts in turn, as many as there is room for; return the steps."""
    d = starts.shape[1]
    p = forest.coefficients.shape[1] - 1
    x, y = np.zeros(p), np.zeros(p)
    observation, displacement = np.zeros(d), np.zeros(d)
    k = 0
    for e in range(out.returns.size):
        observation[:] = starts[e % starts.shape[0]]
        displacement[:] = 0.0
        total, weight = 0.0, 1.0
        out.first[e] = k
        for t in range(horizon):
            out.observations[k] = observation
            out.displacements[k] = displacement
            out.earned[k] = total
            k += 1
            node = leaf_node(
                policy.feature, policy.threshold, policy.left, policy.right, 0, observation
            )
            at = e * EPISODE_STRIDE + t * (d + 1)
            reward, ends = model_step(
                forest, draws, at, policy.action[node], observation, displacement, x, y
            )
            total += weight * reward
            weight *= discount
            if ends:
                break
        out.returns[e] = total
    out.first[out.returns.size] = k
    return k


@compiled
def difference(
    forest: Forest,
    draws: Floats,
    episodes: Episodes,
    taken: Integers,  # [K] action of the recorded policy at each step
    rival: ActionTree,
    horizon: int,
    discount: float,
    hopeless: float,
    out: Floats,  # [E] return of the rival minus the recorded one
) -> int:
    """Compare a rival with the recorded policy episode by episode; return how many were compared.

    Only episodes in which the rival acts differently somewhere are imagined anew, from there. The
    comparison stops early when the rival's gain is two standard errors below ``hopeless``.
    """
    d = episodes.observations.shape[1]
    p = forest.coefficients.shape[1] - 1
    x, y = np.zeros(p), np.zeros(p)
    observation, displacement = np.zeros(d), np.zeros(d)
    n = episodes.returns.size
    total, squares = 0.0, 0.0
    for e in range(n):
        out[e] = 0.0
        for k in range(episodes.first[e], episodes.first[e + 1]):
            node = leaf_node(
                rival.feature,
                rival.threshold,
                rival.left,
                rival.right,
                0,
                episodes.observations[k],
            )
            if rival.action[node] != taken[k]:
                observation[:] = episodes.observations[k]
                displacement[:] = episodes.displacements[k]
                step = k - episodes.first[e]
                rest = go_on(
                    forest, draws, e, step, horizon, discount, rival, -1,
                    observation, displacement, x, y,
                )  # fmt: skip
                out[e] = episodes.earned[k] + rest - episodes.returns[e]
                break
        total += out[e]
        squares += out[e] * out[e]
        if e in (n // 8, n // 3):
            mean = total / (e + 1.0)
            deviation = np.sqrt(max(squares / (e + 1.0) - mean * mean, 0.0) / (e + 1.0))
            if mean + 2.0 * deviation < hopeless:
                return e + 1
    return n


@compiled
def deviations(
    forest: Forest,
    draws: Floats,
    episodes: Episodes,
    policy: ActionTree,
    steps: Integers,  # [n]
    owners: Integers,  # [n] episode of each step
    taken: Integers,  # [n] action of the policy at each step
    horizon: int,
    discount: float,
    out: Floats,  # [n, A]
) -> None:
    """Write what one other action at a step, and the policy after it, earn more than the policy."""
    d = episodes.observations.shape[1]
    p = forest.coefficients.shape[1] - 1
    x, y = np.zeros(p), np.zeros(p)
    observation, displacement = np.zeros(d), np.zeros(d)
    for i in range(steps.size):
        k, e = steps[i], owners[i]
        for action in range(out.shape[1]):
            out[i, action] = 0.0
            if action == taken[i]:
                continue
            observation[:] = episodes.observations[k]
            displacement[:] = episodes.displacements[k]
            rest = go_on(
                forest, draws, e, k - episodes.first[e], horizon, discount, policy, action,
                observation, displacement, x, y,
            )  # fmt: skip
            out[i, action] = episodes.earned[k] + rest - episodes.returns[e]


@compiled
def locate(policy: ActionTree, observations: Floats, out: Integers) -> None:
    """Write the leaf node of each observation."""
    for i in range(out.size):
        out[i] = leaf_node(
            policy.feature, policy.threshold, policy.left, policy.right, 0, observations[i]
        )


@compiled
def passes(policy: ActionTree, node: int, observations: Floats, out: Integers) -> int:
    """Write the indices of the observations whose path visits ``node``; return how many."""
    count = 0
    for i in range(observations.shape[0]):
        at = 0
        while at != node and policy.feature[at] >= 0:
            below = observations[i, policy.feature[at]] <= policy.threshold[at]
            at = policy.left[at] if below else policy.right[at]
        if at == node:
            out[count] = i
            count += 1
    return count
