"""Slow, obvious twins of the kernels of eutree.world_model."""

import math

import numpy as np


def best_interval(values, gains, min_rows, open_below, open_above):
    """Every interval of the sorted values, cut between distinct ones; the largest sum."""
    order = np.argsort(values, kind="stable")
    x, g = values[order], gains[order]
    n, best = len(x), -np.inf
    for i in range(n):
        if i > 0 and (open_below or x[i - 1] == x[i]):
            continue
        for j in range(i + min_rows - 1, n):
            if j < n - 1 and (open_above or x[j] == x[j + 1]):
                continue
            best = max(best, g[i : j + 1].sum())
    return best


def best_cut(X, y, rows, min_leaf):
    """The squared error after each cut between distinct values; the least."""
    least = np.inf
    for j in range(X.shape[1]):
        x = X[rows, j]
        for value in np.unique(x)[:-1]:
            below, above = y[rows][x <= value], y[rows][x > value]
            if min(len(below), len(above)) >= min_leaf:
                error = ((below - below.mean()) ** 2).sum() + ((above - above.mean()) ** 2).sum()
                least = min(least, error)
    return least


def act(tree, observation):
    """The action of a nested tree."""
    while isinstance(tree, tuple):
        tree = tree[2] if observation[tree[0]] <= tree[1] else tree[3]
    return tree


def leaf(tree, x):
    """The leaf node of a regression tree."""
    node = 0
    while tree.feature[node] >= 0:
        below = x[tree.feature[node]] <= tree.threshold[node]
        node = tree.left[node] if below else tree.right[node]
    return node


def fit(tree, node, x):
    """What the line of a leaf says at x, within what the leaf has seen."""
    value = tree.coefficients[node, -1]
    for coefficient, feature in zip(tree.coefficients[node, :-1], x, strict=True):
        value += coefficient * feature
    return min(max(value, tree.low[node]), tree.high[node])


def chance(tree, state):
    """The probability of an end at a state, by the log-odds of its observation and squares."""
    d = len(state) // 2
    coefficients = tree.coefficients[leaf(tree, state)]
    odds = coefficients[-1]
    for i in range(d):
        odds += (coefficients[i] + coefficients[d + i] * state[i]) * state[i]
    return 1.0 / (1.0 + math.exp(min(-odds, 40.0)))


def episode(model, nested, start, luck, *, step=0, displacement=None, first=None):
    """The states, actions and rewards of one imagined episode; ``luck(step, i)`` is a draw.

    It may begin at a later step, after a displacement, with a given first action.
    """
    d = len(start)
    observation = np.array(start)
    displacement = np.zeros(d) if displacement is None else np.array(displacement)
    states, actions, rewards = [], [], []
    for t in range(step, model.horizon):
        action = act(nested, observation) if first is None or t > step else first
        chosen = np.eye(model.n_actions)[action]
        x = np.concatenate([observation, displacement, chosen])
        states.append(x[: 2 * d])
        actions.append(action)
        for i, tree in enumerate(model.trees[:d]):
            node = leaf(tree, x)
            pick = int(luck(t, i) * tree.n_rows[node])
            displacement[i] = fit(tree, node, x) + tree.residuals[tree.first[node] + pick]
        observation = observation + displacement
        y = np.concatenate([observation, displacement, chosen])
        goes_on, badly, well, bad_end, good_end = model.trees[d:]
        draw, reward = luck(t, d), goes_on
        if draw < chance(bad_end, y[: 2 * d]):
            reward = badly
        elif 1.0 - draw <= chance(good_end, y[: 2 * d]):
            reward = well
        rewards.append(fit(reward, leaf(reward, y), y))
        if reward is not goes_on:
            break
    return np.array(states), actions, rewards


def rest(rewards, step, discount):
    """What the steps from ``step`` on earn, summed in their order."""
    total, weight = 0.0, discount**step
    for reward in rewards:
        total += weight * reward
        weight *= discount
    return total


def difference(gains, spread, enough, first_look):
    """How many gains are added one by one, their sums, and whether that is all of them."""
    n_departing, look = len(gains), first_look
    n, total, squares = 0, 0.0, 0.0
    for gain in gains:
        n += 1
        total += gain
        squares += gain * gain
        if n == look and n < n_departing:
            look += look // 2
            mean, unknown = total / n, 1.0 - n / n_departing
            error = math.sqrt(max(squares / n - mean * mean, 0.0) * unknown / n)
            bound = mean + 2.0 * error + 0.5 * spread * unknown / n
            if bound * n_departing < enough:
                return n, total, squares, False
    return n, total, squares, True


def with_child(nested, path, keeps_left):
    """A nested tree with the node at a path of sides replaced by one of its children."""
    if not path:
        return nested[2] if keeps_left else nested[3]
    children = list(nested[2:])
    children[path[0]] = with_child(children[path[0]], path[1:], keeps_left)
    return (*nested[:2], *children)
