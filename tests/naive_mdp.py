"""Slow, obvious twins of the kernels of eutree.mdp."""

import itertools
from collections import Counter

import numpy as np

TERMINAL = -1


class NaiveMDP:
    """Keeps the transitions themselves and counts them whenever it is asked."""

    def __init__(self, n_states, n_actions, discount):
        self.n_states, self.n_actions, self.discount = n_states, n_actions, discount
        self.transitions = []

    def observe(self, state, action, reward, next_state):
        self.transitions.append((state, action, reward, next_state))

    def forget(self, transition):
        self.transitions.remove(transition)

    def add_state(self):
        self.n_states += 1

    def visits(self):
        counts = np.zeros((self.n_states, self.n_actions), int)
        for state, action, _, _ in self.transitions:
            counts[state, action] += 1
        return counts

    def reward_sums(self):
        sums = np.zeros((self.n_states, self.n_actions))
        for state, action, reward, _ in self.transitions:
            sums[state, action] += reward
        return sums

    def successors(self, state, action):
        found = Counter(t[3] for t in self.transitions if t[:2] == (state, action))
        return sorted(found.items())

    def predecessors(self, state):
        found = Counter(t[:2] for t in self.transitions if t[3] == state)
        return sorted((s, a, count) for (s, a), count in found.items())

    def model(self):
        """Return Pr [S, A, S] and R [S, A]; NaN where nothing was tried."""
        probabilities = np.full((self.n_states, self.n_actions, self.n_states), np.nan)
        rewards = np.full((self.n_states, self.n_actions), np.nan)
        for s, a in itertools.product(range(self.n_states), range(self.n_actions)):
            rows = [t for t in self.transitions if t[:2] == (s, a)]
            if rows:
                rewards[s, a] = sum(t[2] for t in rows) / len(rows)
                for end in range(self.n_states):
                    probabilities[s, a, end] = sum(t[3] == end for t in rows) / len(rows)
        return probabilities, rewards


def back_up(probabilities, rewards, discount, values):
    """Return Q (Eq. 5); NaN where an action was never tried."""
    return rewards + discount * np.einsum("ijk,k->ij", probabilities, values)


def value_iteration(probabilities, rewards, discount, values=None):
    """Return V by backing up all states until nothing moves; untried actions are left out."""
    values = np.zeros(len(rewards)) if values is None else np.array(values, float)
    touched = ~np.isnan(rewards).all(axis=1)
    for _ in range(200_000):
        q = back_up(probabilities, rewards, discount, values)
        new = values.copy()
        new[touched] = np.nanmax(q[touched], axis=1)
        if np.abs(new - values).max() <= 1e-14 * (1.0 + np.abs(new).max()):
            return new
        values = new
    raise AssertionError("value iteration did not converge")


def policy_values(probabilities, rewards, discount, policy):
    """Return V of one policy by a dense linear solve; None where it has no finite value."""
    states = np.arange(len(policy))
    matrix = np.eye(len(policy)) - discount * probabilities[states, policy]
    if np.linalg.cond(matrix) > 1e12:
        return None
    return np.linalg.solve(matrix, rewards[states, policy])


def best_of_all_policies(probabilities, rewards, discount):
    """Return the largest value of each state over all policies that have values."""
    best = np.full(len(rewards), -np.inf)
    choices = [np.flatnonzero(~np.isnan(row)) for row in rewards]
    for policy in itertools.product(*choices):
        values = policy_values(probabilities, rewards, discount, np.array(policy))
        if values is not None:
            best = np.maximum(best, values)
    return best


class NaiveQueue:
    """A priority queue that keeps the larger of two priorities; ties go to the lower state."""

    def __init__(self):
        self.priorities = {}

    def push(self, state, priority):
        self.priorities[state] = max(priority, self.priorities.get(state, -np.inf))

    def pop(self):
        state = min(self.priorities, key=lambda s: (-self.priorities[s], s))
        del self.priorities[state]
        return state


def sweep(mdp, queue, back_up, budget, threshold):
    """Back up as prioritized sweeping says, with a plain queue; return how many backups."""
    backups = 0
    while backups < budget and queue.priorities:
        state = queue.pop()
        change = back_up(state)
        backups += 1
        if change <= threshold:
            continue
        for before, action, count in zip(*mdp.counts.predecessors(state), strict=True):
            value = count / mdp.counts.visits[before, action] * change
            if before != state and value > threshold:
                queue.push(int(before), value)
    return backups
