"""What a world model expects of held actions, against its trees read one by one."""

from dataclasses import replace

import numpy as np

from eutree.features import Derivation
from eutree.schema import Schema
from eutree.world_model import Transitions, fit_world_models
from eutree.world_model.transitions import seen_as
from eutree_lab.vrd.corner_process import KnownWorld, ModelledWorld, rows
from eutree_lab.vrd.kuhn import Grid


def walk(generator, n_episodes=60):
    """Return transitions of random walks in a square: a good end on the right, a bad one above."""
    table = {name: [] for name in "oarpte"}
    for episode in range(n_episodes):
        o = generator.uniform(0.1, 0.6, 2)
        for _ in range(40):
            a = int(generator.integers(3))
            after = o + np.array([[0.08, 0.0], [0.0, 0.07], [-0.03, -0.06]])[a] * (0.5 + o[0])
            good, bad = after[0] > 0.95, after[1] > 0.9
            reward = 5.0 if good else -5.0 if bad else -0.1 - 0.2 * o[1]
            for name, value in zip(
                "oarpte", (o, a, reward, after, good or bad, episode), strict=True
            ):
                table[name].append(value)
            o = after
            if good or bad:
                break
    o, a, r, p, t, e = (np.array(table[name]) for name in "oarpte")
    return Transitions(o, a, r, p, t, e, 3, memory=False)


def expected(model, states, actions):
    """Read the model's trees: displacement, three rewards, two log-odds."""
    d = states.shape[1]
    one = np.eye(model.n_actions)[actions]
    inputs = np.hstack([states, np.zeros_like(states), one])
    moved = states + np.stack([tree.predict(inputs) for tree in model.trees[:d]], axis=1)
    after = np.hstack([moved, np.zeros_like(states), one])
    rewards = [tree.predict(after) for tree in model.trees[d : d + 3]]
    chances = []
    for tree in model.trees[d + 3 :]:
        odds = []
        for x in moved:
            node = 0
            while tree.feature[node] >= 0:
                below = x[tree.feature[node]] <= tree.threshold[node]
                node = tree.left[node] if below else tree.right[node]
            line = tree.coefficients[node]
            odds.append(line[:d] @ x + line[d : 2 * d] @ x**2 + line[-1])
        chances.append(1.0 / (1.0 + np.exp(-np.array(odds))))
    bad, good = chances[0], np.minimum(chances[1], 1.0 - chances[0])
    goes_on = np.maximum(1.0 - bad - good, 0.0)
    reward = goes_on * rewards[0] + bad * rewards[1] + good * rewards[2]
    return moved, reward, goes_on


def test_held_actions_are_those_of_the_trees():
    generator = np.random.default_rng(0)
    (model,) = fit_world_models(walk(generator), [0.5])
    grid = Grid.uniform([0.0, 0.0], [1.0, 1.0], (2, 3))
    known = KnownWorld(lambda s, a: expected(model, s, a), 3, 0.9, longest=20)
    learned = ModelledWorld(model.without_noise(), 3, 0.9, longest=20)
    points = np.vstack([grid.corners, generator.random((30, 2))])
    one, two = rows(grid, known, points), rows(grid, learned, points)
    np.testing.assert_allclose(two.discount, one.discount, atol=1e-9)
    np.testing.assert_allclose(two.reward, one.reward, atol=1e-9)
    assert (two.leaf == one.leaf).mean() > 0.98  # rounding at a border
    assert learned.n_steps_taken == known.n_steps_taken > points.shape[0] * 3
    assert (one.discount < 0.3).any()
    assert (one.discount > 0.5).any()


def test_held_actions_lead_to_computed_features():
    derivation = Derivation.of(
        Schema.anonymous(2, 3).derive(["both = x0 * x1", "moved = x0 - last(x0)"])
    )
    data = walk(np.random.default_rng(1))
    before = derivation.rows(data.observations)
    after = derivation.rows(data.next_observations, before)
    told = replace(data, observations=before, next_observations=after)
    (model,) = fit_world_models(seen_as(derivation, told), [0.5])
    grid = Grid.uniform(np.full(4, -9.0), np.full(4, 9.0), (1,) * 4)
    world = ModelledWorld(model, 3, 0.9, longest=1)
    starts = before[:50]
    ended, *_ = world.hold(grid, starts, data.actions[:50])
    assert (ended[:, :2] != starts[:, :2]).any(axis=1).all()
    assert derivation.rows(ended[:, :2], starts).tolist() == ended.tolist()
