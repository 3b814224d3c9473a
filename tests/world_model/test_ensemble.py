"""The neural world model: its loss, its steps, what it learns of a small world, paired rollouts."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.world_model import Transitions
from eutree.world_model import _kernels_ensemble as kernels
from eutree.world_model import _kernels_ensemble_lanes as lanes
from eutree.world_model.action_trees import packed
from eutree.world_model.ensemble import (
    EnsembleSettings,
    circles_of,
    fit_ensemble,
    kinds,
)
from eutree.world_model.ensemble_rollouts import EnsembleRollouts
from tests import naive_neural
from tests.world_model.wheel import WHEEL, spins, wheel_seen

STAY, GO = 0, 1
PIT, GOAL = -50.0, 100.0
NOISE = 0.1
SMALL = EnsembleSettings(members=2, hidden=24, batch=64, updates=1200, more_updates=100, rate=3e-3)


def walks(n_episodes, seed):
    """A walk to the goal at 6 past a light that is on or off: going on while it is on, at 3, ends.

    Features: place, whether the light is on (half of the time, by chance), a constant.
    """
    generator = np.random.default_rng(seed)
    rows = []
    for episode in range(n_episodes):
        place, light = 0.0, float(generator.integers(2))
        for _ in range(25):
            action = int(generator.random() < 0.7)
            there = place + action + NOISE * generator.standard_normal()
            fell = bool(place < 3.0 <= there and light == 1.0)
            ended = fell or there >= 6.0
            reward = PIT if fell else (GOAL if there >= 6.0 else -1.0)
            then = float(generator.integers(2))
            rows.append(((place, light, 7.0), action, reward, (there, then, 7.0), ended, episode))
            place, light = there, then
            if ended:
                break
    o, a, r, later, ended, episodes = (np.array(c) for c in zip(*rows, strict=True))
    return Transitions(o, a, r, later, ended, episodes, 2)


@pytest.fixture(scope="module")
def data():
    return walks(400, 0)


@pytest.fixture(scope="module")
def ensemble(data):
    return fit_ensemble(data, SMALL, np.random.default_rng(1))


def test_binary_features_and_kinds_of_end_are_found(data, ensemble):
    assert ensemble.scales.binary.tolist() == [False, True, False]
    kind = kinds(data)
    assert set(data.rewards[kind == kernels.BAD]) == {PIT}
    assert set(data.rewards[kind == kernels.GOOD]) == {GOAL}
    assert set(data.rewards[kind == kernels.GOES_ON]) == {-1.0}


def test_error_is_the_gradient_of_the_loss():
    """Central differences; a variance does not pull at its mean."""
    generator = np.random.default_rng(3)
    binary, n = np.array([False, True]), 40
    kind = generator.integers(0, 3, n)
    targets = 3.0 * generator.standard_normal((n, 2))
    targets[:, 1] = targets[:, 1] > 0
    steps = kernels.Steps(
        np.zeros((n, 1)), targets, 3.0 * generator.standard_normal(n), kind, binary
    )
    out = generator.standard_normal((n, 9))
    error = np.empty_like(out)
    kernels.write_error(steps, np.arange(n), 0.3, out, error)
    for i in range(n):
        row = targets[i], steps.rewards[i], kind[i], binary, 0.3
        for j in range(9):
            if j == 3:  # no variance of a binary feature: drawn back a little towards 1
                continue
            ends = []
            for step in (1e-6, -1e-6):
                moved = out[i].copy()
                moved[j] += step
                ends.append(naive_neural.ensemble_loss(moved, *row)[int(j in (2, 3))])
            expected = (ends[0] - ends[1]) / 2e-6
            assert n * error[i, j] == pytest.approx(expected, abs=1e-5)


def stepped(world, draws, at, member, action, state):
    """Move a state by one step, in the only lane under way; return reward and whether it ends."""
    under_way = lanes.empty_lanes(world)
    under_way.states[0] = state
    lanes.look(world, member, packed(action), under_way, 1)
    out = under_way.out.reshape(-1, lanes.LANES)[:, 0].copy()
    return lanes.move(world, draws, at, out, state)


def test_a_step_is_the_naive_step(ensemble):
    world, generator = ensemble.world, np.random.default_rng(4)
    draws = lanes.Draws(generator.random(64), generator.standard_normal(64))
    for at in range(0, 400, 3):
        state = np.array([generator.uniform(-1, 6), generator.integers(2), 7.0, 0.1, 0.0, 0.0])
        member, action = int(generator.integers(2)), int(generator.integers(2))
        expected = naive_neural.ensemble_step(world, draws, at, member, action, state)
        reward, ends = stepped(world, draws, at, member, action, state)
        np.testing.assert_allclose(state, expected[0], atol=1e-4)
        assert reward == pytest.approx(expected[1], abs=1e-3)
        assert ends == expected[2]


def imagined(ensemble, state, action, n=4000):
    world, generator = ensemble.world, np.random.default_rng(5)
    draws, found = lanes.Draws(generator.random(2**14), generator.standard_normal(2**14)), []
    for k in range(n):
        moved = np.array([*state, 0.0, 0.0, 0.0])
        reward, ends = stepped(world, draws, 4 * k, k % 2, action, moved)
        found.append((*moved[:3], reward, ends))
    return np.array(found)


def test_every_row_of_a_tile_begins_at_a_line_of_the_cache(ensemble):
    """Else each vector that is loaded lies in two lines, and steps take a fifth longer."""
    tiles = ensemble.world.tiles
    for matrices in (tiles.w1, tiles.w2, tiles.w3):
        for member in matrices:
            assert member.ctypes.data % 64 == 0
            assert member.size % lanes.TILE == 0


def test_displacements_noise_and_binary_features_are_learned(ensemble):
    steps = imagined(ensemble, (1.5, 0.0, 7.0), GO)
    assert steps[:, 0].mean() == pytest.approx(2.5, abs=0.05)
    assert steps[:, 0].std() == pytest.approx(NOISE, rel=0.3)
    assert set(steps[:, 1]) == {0.0, 1.0}
    assert steps[:, 1].mean() == pytest.approx(0.5, abs=0.1)
    assert set(steps[:, 2]) == {7.0}


def test_good_and_bad_ends_are_told_apart(ensemble):
    """No imagined end earns what lies between the pit and the goal."""
    for place, light, earned in ((2.6, 1, PIT), (2.6, 0, -1.0), (5.5, 0, GOAL)):
        steps = imagined(ensemble, (place, light, 7.0), GO)
        assert (np.abs(steps[:, 3] - earned) < 1.0).mean() > 0.6
        assert all(min(abs(r - e) for e in (PIT, GOAL, -1.0)) < 1.0 for r in steps[:, 3])


def test_ends_are_as_frequent_as_they_were_although_batches_hold_more():
    """One step in ten ends, anywhere; unweighted, a third of each batch would."""
    generator = np.random.default_rng(11)
    n = 3000
    ended = generator.random(n) < 0.1
    o = generator.standard_normal((n, 3))
    episodes = np.concatenate([[0], np.cumsum(ended)[:-1]])
    rewards = np.where(ended, GOAL, -1.0)
    data = Transitions(o, np.zeros(n, int), rewards, o + 1.0, ended, episodes, 2)
    fitted = fit_ensemble(data, replace(SMALL, updates=400), generator)
    shares = [imagined(fitted, state, 0, 500)[:, 4].mean() for state in o[:40]]
    assert np.mean(shares) == pytest.approx(0.1, abs=0.05)


def test_an_end_that_a_rollout_overlooks_comes_where_it_led():
    """One step in ten ends, far away: nobody ever took a step there."""
    generator = np.random.default_rng(12)
    n = 3000
    ended = generator.random(n) < 0.1
    o = generator.standard_normal((n, 3))
    episodes = np.concatenate([[0], np.cumsum(ended)[:-1]])
    there = o + np.where(ended, 10.0, 1.0)[:, np.newaxis]
    data = Transitions(o, np.zeros(n, int), np.where(ended, PIT, -1.0), there, ended, episodes, 2)
    fitted = fit_ensemble(data, SMALL, generator)
    shares = [imagined(fitted, state, 0, 500)[:, 4].mean() for state in there[ended][:40]]
    assert np.mean(shares) > 0.9
    shares = [imagined(fitted, state, 0, 500)[:, 4].mean() for state in o[:40]]
    assert np.mean(shares) == pytest.approx(0.1, abs=0.05)


@pytest.fixture(scope="module")
def wheel():
    return fit_ensemble(spins(100, 0), replace(SMALL, updates=300), np.random.default_rng(1))


def test_circles_are_found(ensemble, wheel):
    assert wheel.scales.circles.tolist() == [[1, 2]]
    assert ensemble.scales.circles.tolist() == []
    o = spins(100, 0).observations
    assert circles_of(o + 0.01, [0, 1, 2]).tolist() == []
    assert circles_of(o, [0, 1]).tolist() == []
    # Two wheels, and their features among one another.
    two = np.stack([o[:-1, 2], o[1:, 2], o[:-1, 1], o[1:, 1]], axis=1)
    assert circles_of(two, range(4)).tolist() == [[0, 2], [1, 3]]
    assert circles_of(two, [1, 3]).tolist() == [[1, 3]]
    # One row of many is off it.
    many = np.tile(two, (20_000 // len(two) + 1, 1))
    many[1, 0] += 1.0
    assert circles_of(many, range(4)).tolist() == [[1, 3]]


def test_angles_stay_angles_and_what_is_derived_is_computed(wheel):
    rollouts = EnsembleRollouts(wheel, 30, np.random.default_rng(3))
    rollouts.run(packed((1, 0.0, 0, (5, 1.0, 1, 0))))
    states = rollouts._episodes.states[: rollouts.n_steps]
    assert len(states) > 300
    o = states[:, :7]
    np.testing.assert_allclose(np.hypot(o[:, 1], o[:, 2]), 2.0, rtol=1e-9)
    later = np.flatnonzero(np.diff(rollouts._episodes.owner[: rollouts.n_steps]) == 0) + 1
    for k in later.tolist():
        assert WHEEL.rows(o[k, :5], o[k - 1]).tolist() == o[k].tolist()
    np.testing.assert_allclose(states[later, 7:], o[later] - o[later - 1], atol=1e-12)


def test_a_step_of_an_angle_is_the_naive_step(wheel):
    world, generator = wheel.world, np.random.default_rng(4)
    draws = lanes.Draws(generator.random(64), generator.standard_normal(64))
    for at in range(0, 300, 3):
        seen = wheel_seen(generator.uniform(-3, 3), generator.uniform(-1, 1), None)
        state = np.array([*seen, *np.zeros(7)])
        member, action = int(generator.integers(2)), int(generator.integers(2))
        known = world, draws, at, member, action, state
        expected = naive_neural.ensemble_step(*known, WHEEL)
        stepped(*known)
        np.testing.assert_allclose(state, expected[0], atol=1e-4)


CAREFUL = packed((0, 1.5, GO, (0, 3.2, (1, 0.5, GO, STAY), GO)))
RECKLESS = packed((0, 1.5, GO, (0, 3.2, GO, GO)))


def test_a_challenger_meets_the_same_chance_as_if_it_ran_alone(ensemble):
    together = EnsembleRollouts(ensemble, 20, np.random.default_rng(6))
    alone = EnsembleRollouts(ensemble, 20, np.random.default_rng(6))
    together.run(CAREFUL)
    alone.run(RECKLESS)
    assert together.returns_of_each([RECKLESS])[0].tolist() == alone.returns.tolist()
    assert together.returns_of_each([RECKLESS], last=10)[0].tolist() == alone.returns[:10].tolist()
    assert together.returns_of_each([RECKLESS], 10)[0].tolist() == alone.returns[10:].tolist()
    together.run(RECKLESS)
    assert together.returns.tolist() == alone.returns.tolist()
    np.testing.assert_array_equal(together.observations, alone.observations)


def test_many_challengers_side_by_side_earn_what_each_earns_alone(ensemble):
    """More tasks than lanes, episodes of every length, trees of several sizes in one forest."""
    trees = [CAREFUL, RECKLESS, packed(STAY), packed((0, 2.5, GO, STAY)), RECKLESS]
    together = EnsembleRollouts(ensemble, 60, np.random.default_rng(6))
    together.run(CAREFUL)
    returns = together.returns_of_each(trees)
    assert returns.size > 4 * lanes.LANES
    for tree, row in zip(trees, returns, strict=True):
        alone = EnsembleRollouts(ensemble, 60, np.random.default_rng(6))
        alone.run(tree)
        assert row.tolist() == alone.returns.tolist()
    assert together.returns_of_each(trees[1:3], 7, 90).tolist() == returns[1:3, 7:90].tolist()


def test_an_imagined_episode_is_the_naive_one(ensemble):
    """Step after step, wherever its lane lies among those of other episodes."""
    rollouts = EnsembleRollouts(ensemble, 40, np.random.default_rng(9))
    rollouts.run(CAREFUL)
    episodes, draws = rollouts._episodes, rollouts._conditions.draws
    d = ensemble.scales.move.size
    for k in range(0, rollouts.n_steps - 1, 5):
        e = episodes.owner[k]
        if episodes.owner[k + 1] != e:
            continue
        at = int(e) * lanes.EPISODE_STRIDE + (k - int(episodes.first[e])) * (d + 1)
        action = CAREFUL.action[episodes.node[k]]
        after, reward, ends = naive_neural.ensemble_step(
            ensemble.world, draws, at, int(e) % 2, action, episodes.states[k].copy()
        )
        assert not ends
        np.testing.assert_allclose(episodes.states[k + 1], after, atol=1e-4)
        assert episodes.earned[k + 1] - episodes.earned[k] == pytest.approx(reward, abs=1e-3)


def test_redrawing_changes_the_chance_and_a_rerun_does_not(ensemble):
    rollouts = EnsembleRollouts(ensemble, 20, np.random.default_rng(6))
    rollouts.run(CAREFUL)
    first = rollouts.returns.tolist()
    rollouts.run(RECKLESS)
    rollouts.run(CAREFUL)
    assert rollouts.returns.tolist() == first
    rollouts.redraw()
    rollouts.run(CAREFUL)
    assert rollouts.returns.tolist() != first


def test_the_careful_tree_is_imagined_to_earn_more(ensemble):
    rollouts = EnsembleRollouts(ensemble, 60, np.random.default_rng(7))
    rollouts.run(CAREFUL)
    careful, reckless = rollouts.returns, rollouts.returns_of_each([RECKLESS])[0]
    error = np.std(careful - reckless) / np.sqrt(careful.size)
    assert careful.mean() - reckless.mean() > 3 * error
    assert careful.max() <= ensemble.returns[1]


def test_score_is_the_mean_of_members_less_their_spread(ensemble):
    rollouts = EnsembleRollouts(ensemble, 2, np.random.default_rng(8))
    assert rollouts.score(np.array([1.0, 5.0, 3.0, 7.0])) == pytest.approx(4.0 - 0.5 * 2.0)


def test_fitting_on_learns_what_has_changed(data, ensemble):
    """After steps in which going leads half as far the members believe half of the way there."""
    halved = replace(
        data,
        next_observations=data.observations + 0.5 * (data.next_observations - data.observations),
    )
    settings = replace(SMALL, more_updates=800, more_rate=3e-3, recent=data.rewards.size)
    more = replace(
        data,
        **{
            name: np.concatenate([getattr(data, name), getattr(halved, name)])
            for name in ("observations", "actions", "rewards", "next_observations", "terminated")
        },
        episodes=np.concatenate([data.episodes, data.episodes + 1000]),
    )
    before = imagined(ensemble, (1.0, 0.0, 7.0), GO)[:, 0].mean()
    fitted = replace(ensemble, settings=settings).fitted_on(more, np.random.default_rng(9))
    assert imagined(fitted, (1.0, 0.0, 7.0), GO)[:, 0].mean() < before - 0.1
    assert not np.array_equal(fitted.weights, ensemble.weights)


def test_the_same_seed_gives_the_same_bytes(data):
    quick = replace(SMALL, updates=20)
    one, other = (fit_ensemble(data, quick, np.random.default_rng(2)) for _ in range(2))
    assert one.weights.tobytes() == other.weights.tobytes()


def test_the_previous_displacement_can_be_an_input(data):
    known = fit_ensemble(data, replace(SMALL, updates=5, memory=True), np.random.default_rng(2))
    assert known.size[0] == 3 + 3 + 2
    rollouts = EnsembleRollouts(known, 3, np.random.default_rng(0))
    rollouts.run(CAREFUL)
    assert np.isfinite(rollouts.returns).all()
