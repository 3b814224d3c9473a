"""The world model that counts: its lotteries are those that were stored, whole."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from eutree.interaction.spaces import describe
from eutree.policy_search.cells import best_by_counts, curious_by_counts
from eutree.policy_search.improvement import Improvement
from eutree.policy_search.planner import Planned, Planner
from eutree.schema import Schema
from eutree.world_model import PairedRollouts, Transitions, countable, fit_counted_world
from eutree.world_model.action_trees import n_leaves, nested, packed
from eutree.world_model.counted import deviance, shortest_tree
from tests.naive_world_model import act

LAKE = gymnasium.make("FrozenLake-v1").unwrapped
OPTIMUM = 0.74  # of 100 steps on the slippery lake, which no policy exceeds


def of_rows(rows, n_actions, **columns):
    """Return transitions (o, a, r, o', ended), each an episode of one step."""
    o, a, r, after, ended = map(np.array, zip(*rows, strict=True))
    places = [np.asarray(x, dtype=float).reshape(len(rows), -1) for x in (o, after)]
    return Transitions(
        places[0], a, r.astype(float), places[1], ended, np.arange(len(rows)), n_actions,
        counted=True, **columns,
    )  # fmt: skip


def lake(times, seed=0):
    """Return transitions of every square and action of the slippery lake, drawn so many times."""
    generator, rows = np.random.default_rng(seed), []
    for square, actions in LAKE.P.items():
        for action, results in actions.items():
            chances = [one[0] for one in results]
            for which in generator.choice(len(results), times, p=chances):
                _, after, reward, ended = results[which]
                rows.append((square, action, reward, after, ended))
    return of_rows(rows, 4)


def imagined(data, policy, horizon=100, n=2000, start=None):
    model = replace(fit_counted_world(data), horizon=horizon)
    if start is not None:
        model = replace(model, starts=np.pad(np.array([start], dtype=float), ((0, 0), (0, 2))))
    rollouts = PairedRollouts(model, n, 1.0, np.random.default_rng(1))
    rollouts.redraw()
    rollouts.run(policy)
    return rollouts


def test_only_few_combinations_of_whole_numbers_are_counted():
    assert countable(describe(gymnasium.make("FrozenLake8x8-v1")))
    assert countable(describe(gymnasium.make("Blackjack-v1")))
    assert not countable(describe(gymnasium.make("CartPole-v1")))
    whole = Schema.anonymous(2, 2).with_kinds({"x0": "flag", "x1": "integer"})
    assert not countable(whole)  # without bounds


def test_imagined_returns_are_the_true_ones():
    """By dynamic programming on the lake's own table, for a policy that is not the best."""
    policy = packed((0, 3.5, 2, 1))  # right in the first row, else down
    values = np.zeros((101, 16))
    for left in range(1, 101):
        for square in range(16):
            values[left, square] = sum(
                chance * (reward + (0.0 if ended else values[left - 1, after]))
                for chance, after, reward, ended in LAKE.P[square][act(nested(policy), [square])]
            )
    found = imagined(lake(3000), policy, start=[0.0], n=5000)
    assert found.mean_return == pytest.approx(values[100, 0], abs=0.015)
    assert values[100, 0] > 0.02
    assert found.observations.shape[1] == 1  # what is hidden is not seen


def test_numbers_of_an_outcome_are_drawn_together():
    rows = [((0, 0), 0, 1.0, (1, 1), False), ((0, 0), 0, -1.0, (-1, -1), False)] * 50
    rows += [((s, s), 0, 0.0, (s, s), False) for s in (-1, 1)] * 50
    found = imagined(of_rows(rows, 1), packed(0), horizon=3, start=[0.0, 0.0])
    assert set(map(tuple, found.observations.tolist())) == {(0, 0), (1, 1), (-1, -1)}
    last = found.observations.reshape(-1, 3, 2)[:, 1, 0]
    assert found.returns.tolist() == last.tolist()  # the reward is that of the place
    assert abs(last.mean()) < 0.1


def test_the_same_place_may_end_an_episode_or_not():
    """A hand of Blackjack stays as it is when the player sticks, and the game is over."""
    rows = [(0, 0, 0.0, 1, False), (1, 0, 0.0, 1, True), (1, 1, 5.0, 0, False)] * 40
    found = imagined(of_rows(rows, 2), packed(0), horizon=50, start=[0.0])
    assert found.n_steps == 2 * found.n_episodes
    assert imagined(of_rows(rows, 2), packed((0, 0.5, 0, 1)), 50, start=[0.0]).mean_return == 125.0


def test_cells_of_the_same_lottery_are_counted_together_and_others_apart():
    cells = np.arange(12.0)[:, np.newaxis]
    share = np.where(cells < 6, [8, 2], [2, 8]) * 10
    tests, leaf = shortest_tree(cells, share.astype(float))
    assert len(tests) == 3
    assert tests[0, :2].tolist() == [0, 5.5]
    assert len(set(leaf[:6])) == len(set(leaf[6:])) == 1
    assert len(shortest_tree(cells, np.full((12, 2), 5.0))[0]) == 1
    assert deviance(np.array([5.0, 0.0])) == 0.0


def test_rewards_of_any_value_are_told_apart_and_drawn_as_they_were():
    generator = np.random.default_rng(0)
    rows = [(0, a, generator.normal(a, 0.5), 0, True) for a in (0, 1) for _ in range(300)]
    data = of_rows(rows, 2)
    for action in (0, 1):
        found = imagined(data, packed(action), horizon=3)
        assert set(found.returns) <= set(data.rewards[data.actions == action])
        assert found.mean_return == pytest.approx(action, abs=0.1)


def test_of_very_many_outcomes_the_rarest_count_as_one(monkeypatch):
    monkeypatch.setattr("eutree.world_model.counted.MOST_COUNTS", 12)
    rows = [(s, 0, 0.0, (3 * s + k) % 7, False) for s in range(4) for k in (1, 2, 2, 2)] * 20
    found = imagined(of_rows(rows, 1), packed(0), horizon=2, start=[1.0])
    after = found.observations.reshape(-1, 2)[:, 1]
    assert set(after) <= {1.0 + row[3] - row[0] for row in rows}  # whole displacements
    assert (after == 5.0).mean() > 0.4


def test_what_is_forbidden_does_nothing_and_is_not_tried():
    allowed = np.array([[True, True], [True, False]] * 20)
    rows = [(0, 1, -1.0, 1, False), (1, 0, -1.0, 0, False)] * 20
    data = of_rows(rows, 2, allowed=allowed)
    found = imagined(data, packed(1), horizon=10, start=[0.0])
    assert set(found.observations[:, 0]) == {0.0, 1.0}  # it does not walk on to 2
    assert act(nested(curious_by_counts(data)), [0.0]) == 0  # never tried there, and allowed
    assert act(nested(curious_by_counts(data)), [1.0]) == 0


def test_the_best_by_counts_is_the_best():
    tree = best_by_counts(lake(1000), 0.99)
    earned = imagined(lake(1000, seed=1), tree, start=[0.0], n=4000).mean_return
    assert earned == pytest.approx(OPTIMUM, abs=0.03)


def test_the_best_by_counts_does_not_put_off_for_ever_what_nothing_is_lost_by():
    """Undiscounted, to push against the wall is worth as much as to walk to the present."""
    rows = [(s, 0, 0.0, max(s - 1, 0), False) for s in range(8)]
    rows += [(s, 1, float(s == 7), min(s + 1, 7), s == 7) for s in range(8)]
    data = of_rows(rows * 5, 2)
    data = replace(data, episodes=np.arange(len(data.episodes)) // 16)
    policy = nested(best_by_counts(data, 1.0))
    assert [act(policy, [square]) for square in range(8)] == [1] * 8


def test_the_curious_go_to_what_was_seldom_tried():
    rows = [(s, 1, 0.0, min(s + 1, 3), False) for s in range(4) for _ in range(9)]
    rows += [(s, 0, 1.0, max(s - 1, 0), False) for s in range(4) for _ in range(9 if s < 3 else 2)]
    data = of_rows(rows, 2)
    curious, best = (nested(one) for one in (curious_by_counts(data), best_by_counts(data, 0.9)))
    assert [act(curious, [s]) for s in range(4)] == [1, 1, 1, 0]
    assert [act(best, [s]) for s in range(4)] == [0, 0, 0, 0]


def test_a_square_beside_others_is_not_counted_with_them_for_a_few_visits_alone():
    """A hole in the ice: nine visits are enough to know it."""
    n = np.full((12, 4), [3.0, 3.0, 3.0, 0.0])
    n[5] = 3, 0, 3, 3  # the hole
    _, leaf = shortest_tree(np.arange(12.0)[:, np.newaxis], n)
    assert (leaf == leaf[5]).sum() == 1


@pytest.mark.parametrize(("limit", "found"), [(None, 60), (20, 20)])
def test_a_tree_of_codes_has_as_many_leaves_as_it_needs_where_none_are_named(limit, found):
    """A taxi needs 79, and with 40 it leaves passengers standing."""
    walk = [(s, s % 2, 1.0, s + 1, s == 59) for s in range(60)]
    falls = [(s, 1 - s % 2, -1.0, s, True) for s in range(60)]
    own = np.append(np.zeros(60, dtype=int), np.arange(1, 61))  # the walk is one episode
    episodes = (own + 61 * np.arange(20)[:, np.newaxis]).ravel()
    data = replace(of_rows((walk + falls) * 20, 2), episodes=episodes)
    planner = Planner(improvement=Improvement(max_leaves=limit))
    plan = planner.plan(Planned(packed(0)), data, np.random.default_rng(0))
    assert n_leaves(plan.challenger) == found
