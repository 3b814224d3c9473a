"""Contests of made-up returns, held step by step beside their naive twin."""

import math

import numpy as np
from hypothesis import strategies as st

from eutree.contests import Verdict, missing, new_table

seeds = st.integers(0, 2**32)


def lists(table):
    return [[None if math.isnan(value) else value for value in row] for row in table.tolist()]


def as_said(found):
    if isinstance(found, Verdict):
        return ("verdict", found.winner)
    return ("run", found.trees, found.starts.stop)


def follow(rule, twin, n_trees, draw):
    """Hold a contest step by step; the rule and its twin say the same at each."""
    table = new_table(n_trees, rule.most)
    for _ in range(200):
        found = rule.next(table)
        assert as_said(found) == twin(lists(table))
        if isinstance(found, Verdict):
            return found
        asked = missing(table, found)
        assert asked  # nothing that is known already
        for tree, starts in asked:
            table[tree, starts] = draw(tree, starts)
    raise AssertionError("the contest does not end")


def world(seed, n_trees, spread, step):
    """Return a runner of episodes: noise in common and of each tree, on a grid, with ties."""
    generator = np.random.default_rng(seed)
    gains = generator.normal(0.0, spread, n_trees)

    def draw(tree, starts):
        values = [
            np.random.default_rng((seed, start)).normal()
            + np.random.default_rng((seed, start, tree)).normal()
            for start in starts
        ]
        return np.round((gains[tree] + np.array(values)) / step) * step

    return draw
