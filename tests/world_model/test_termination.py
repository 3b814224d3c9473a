"""Where a task ends: logistic leaves, the tests between them, pessimism."""

import numpy as np
import pytest
from scipy.optimize import minimize

from eutree.world_model import _kernels_chances, dynamics
from eutree.world_model.dynamics import FEW, MOST_ROWS, PRICE, fit_termination
from tests import naive_world_model


def chances(ends, X):
    """The fitted chance of an end at each row."""
    d = X.shape[1]
    leaves = [naive_world_model.leaf(ends, x) for x in X]
    lines = ends.lines[leaves]
    odds = (lines[:, :d] * X).sum(axis=1) + (lines[:, d : 2 * d] * X**2).sum(axis=1) + lines[:, -1]
    return 1 / (1 + np.exp(np.minimum(-odds, 40.0)))


def n_leaves(ends):
    reached, todo = 0, [0]
    while todo:
        node = todo.pop()
        if ends.feature[node] < 0:
            reached += 1
        else:
            todo += [ends.left[node], ends.right[node]]
    return reached


def two_balls(n, seed):
    """Places in a box, and whether they lie within 2 of one of two centres; feature 2 is idle."""
    X = np.random.default_rng(seed).uniform([0, -11, -11], [30, 11, 11], size=(n, 3))
    near = [np.hypot(X[:, 0] - 10, X[:, 1]) < 2, np.hypot(X[:, 0] - 20, X[:, 2]) < 2]
    return X, near[0] | near[1]


@pytest.mark.parametrize("squares", [False, True])
def test_the_fit_is_the_least_penalised_deviance(squares):
    generator = np.random.default_rng(4)
    X = generator.normal(size=(300, 2)) * [3.0, 0.2] + [5.0, -1.0]
    y = generator.random(300) < 1 / (1 + np.exp(-(X[:, 0] - 5.0) - 4.0 * (X[:, 1] + 1.0)))
    out = np.empty(5)
    ours = _kernels_chances.fit_log_odds(X, y, squares, out)
    Z = (X - X.mean(axis=0)) / X.std(axis=0)
    columns = [np.ones(300), *Z.T, *(Z.T**2 if squares else ())]
    Z = np.stack(columns, axis=1)

    def deviance(weights):
        odds = Z @ weights
        ridge = 0.5 * _kernels_chances.RIDGE * (weights[1:] ** 2).sum()
        return 2 * (np.logaddexp(0, odds).sum() - odds[y].sum() + ridge)

    best = minimize(deviance, np.zeros(Z.shape[1]), tol=1e-10)
    assert ours == pytest.approx(best.fun, abs=2e-3)
    odds = X @ out[:2] + X**2 @ out[2:4] + out[4]
    assert odds == pytest.approx(Z @ best.x, abs=0.1)


def test_the_step_is_newtons():
    generator = np.random.default_rng(6)
    Z = np.column_stack([np.ones(200), generator.normal(size=(200, 3)) * 4.0])
    y = generator.random(200) < 0.3
    weights = generator.normal(size=4)
    H, step = np.zeros((4, 4)), np.zeros(4)
    ours = _kernels_chances.newton_step(Z, y, weights, H, step)
    odds = Z @ weights
    p = 1 / (1 + np.exp(-odds))
    ridge = np.diag([0.0, *[_kernels_chances.RIDGE] * 3])
    assert ours == pytest.approx(
        2 * (np.logaddexp(0, odds) - odds * y).sum() + weights @ ridge @ weights, rel=1e-6
    )
    hessian = Z.T @ (Z * (p * (1 - p))[:, None]) + ridge
    gradient = Z.T @ (p - y) + ridge @ weights
    assert step == pytest.approx(np.linalg.solve(hessian, gradient), rel=1e-4)


def test_what_is_not_described_could_not_have_been_shorter(monkeypatch):
    """The naive twin describes both sides of every test, by every boundary."""

    def described(X, y, rows):
        d, mine = X.shape[1], y[rows]
        constant = dynamics._described(X, y, rows)
        if not FEW <= mine.sum() <= mine.size - FEW:
            return constant
        found = [(constant.cost, constant.line)]
        for squares, parameters in ((False, d + 1), (True, 2 * d + 1)):
            line = np.empty(2 * d + 1)
            fit = _kernels_chances.fit_log_odds(X[rows], mine, squares, line)
            found.append((fit + PRICE * parameters, line))
        cost, line = min(found, key=lambda item: item[0])
        return dynamics._Leaf(rows, float(cost), line)

    def best_test(X, y, leaf):
        found = []
        for feature, threshold in dynamics._tests(X, y, leaf.rows):
            below = X[leaf.rows, feature] <= threshold
            if below.any() and not below.all():
                sides = described(X, y, leaf.rows[below]), described(X, y, leaf.rows[~below])
                found.append((feature, threshold, *sides))
        return min(found, key=lambda item: item[2].cost + item[3].cost, default=None)

    for seed in range(6):
        X, y = two_balls(700, seed)
        fast = fit_termination(X, y)
        with monkeypatch.context() as patch:
            patch.setattr(dynamics, "_best_test", best_test)
            slow = fit_termination(X, y)
        assert fast.feature.tolist() == slow.feature.tolist()
        assert np.array_equal(fast.threshold, slow.threshold)
        assert np.array_equal(fast.lines, slow.lines)


def test_a_few_ends_describe_two_balls():
    X, y = two_balls(1000, 0)
    assert y.sum() < 60
    ends = fit_termination(X, y)
    assert n_leaves(ends) == 2
    assert ends.feature[0] == 0
    assert 12 < ends.threshold[0] < 18
    fresh, truth = two_balls(20_000, 1)
    assert ((chances(ends, fresh) > 0.5) != truth).mean() < 0.01


def test_a_threshold_is_a_test_or_a_line():
    X = np.random.default_rng(2).uniform(-3, 3, size=(1000, 2))
    ends = fit_termination(X, X[:, 0] > 2.4)
    fresh = np.random.default_rng(3).uniform(-3, 3, size=(2000, 2))
    assert ((chances(ends, fresh) > 0.5) != (fresh[:, 0] > 2.4)).mean() < 0.005


def test_corners_that_no_ball_describes_are_paved():
    X = np.random.default_rng(5).uniform(-1, 1, size=(3000, 2))
    y = (X[:, 0] > 0.5) & (X[:, 1] > 0.5)
    ends = fit_termination(X, y)
    assert ((chances(ends, X) > 0.5) != y).mean() < 0.01


def test_chance_without_a_place_is_one_share():
    generator = np.random.default_rng(6)
    ends = fit_termination(generator.normal(size=(1000, 3)), generator.random(1000) < 0.2)
    assert n_leaves(ends) == 1
    assert chances(ends, np.zeros((1, 3))) == pytest.approx(0.2, abs=0.05)


@pytest.mark.parametrize("always", [False, True])
def test_one_kind_of_rows_leaves_no_doubt(always):
    ends = fit_termination(np.arange(8.0).reshape(4, 2), np.full(4, always))
    assert chances(ends, np.zeros((1, 2))) == pytest.approx(float(always), abs=1e-5)


def test_thinned_rows_keep_the_chance():
    generator = np.random.default_rng(7)
    X = generator.normal(size=(5 * MOST_ROWS, 1))
    ends = fit_termination(X, generator.random(len(X)) < 0.1 / (1 + np.exp(-4 * X[:, 0])))
    assert chances(ends, np.array([[2.0]])) == pytest.approx(0.1, abs=0.03)
    assert chances(ends, np.array([[-2.0]])) == pytest.approx(0.0, abs=0.01)


def test_pessimism_makes_bad_ends_likelier_and_good_ones_less_likely():
    X, y = two_balls(2000, 0)
    edge = np.array([[12.0, 0.1, 5.0]])
    outcome = np.where(y, 1.0, 0.0)
    bad = [
        chances(fit_termination(X, y).seen(X, outcome, g, 1.0), edge)[0] for g in (0.1, 0.5, 0.9)
    ]
    good = [
        chances(fit_termination(X, y).seen(X, -outcome, g, -1.0), edge)[0] for g in (0.1, 0.5, 0.9)
    ]
    assert bad == sorted(bad)
    assert good == sorted(good, reverse=True)
    assert bad[0] < bad[2]
    assert good[2] < good[0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_end_that_comes_by_chance_is_as_likely_as_it_was(sign):
    """A share that many rows tell is no unknown place; of a few ends nobody knows."""
    generator = np.random.default_rng(8)
    X, y = generator.normal(size=(3000, 2)), generator.random(3000) < 0.01
    ends, places = fit_termination(X, y), np.zeros((1, 2))
    assert n_leaves(ends) == 1
    for gap in (0.4, 0.99):
        assert chances(ends.seen(X, sign * y, gap, sign), places) == pytest.approx(y.mean())
    few = generator.permutation(np.arange(1000) < 2)
    rare = fit_termination(X[:1000], few)
    feared = chances(rare.seen(X[:1000], sign * few, 0.99, sign), places)
    assert feared > 0.1 if sign > 0.0 else feared < 1e-4
