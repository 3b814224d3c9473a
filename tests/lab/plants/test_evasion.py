"""Bounds of success in N-Evasion: against a dense chain, a million real episodes, wrong kernels."""

import csv
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from eutree.envs.evasion import EvasionParameters
from eutree.errors import InvalidArgumentError
from eutree.evaluation import evaluate
from eutree.proof import Effort, check_plant, plant_of, prove
from eutree.schema import EnvironmentSpec
from eutree_lab.plants.chance import Normal, circle_moves, line_moves
from eutree_lab.plants.evasion_chain import SUCCESS, EvasionChain, Payoffs
from tests.proof.policies import policy_of

STOP, GO = 0, 1
SPEC = EnvironmentSpec("eutree/Evasion2-v0")
COARSE = Effort(refinements=(1,))

GATES = (
    0, 17.986, (0, 4.041,
        GO,
        (0, 14.233,
         (0, 7.981, (1, 8.488, (1, -8.538, GO, STOP), GO), GO),
         (2, -8.741, GO, (2, 8.524, STOP, GO)))),
    GO,
)  # fmt: skip
"""C4.5's tree of fifteen demonstrations of the gate rule, seed 0."""

TREES = {"always go": GO, "gates": GATES, "one gate": (0, 7.9, (1, 8.5, STOP, GO), GO)}
SHORT = {"n_opponents": 1, "main_path_length": 9.0, "crossings": (5.0,), "trial_limit": 12.0}


def dense_success(parameters, goes, *, width=0.05, place=0.02):
    """Return the success of one opponent's domain by plain sums over a dense grid.

    ``goes(x, y)`` says where the policy goes. Means over cells this small are the values.
    """
    p = parameters
    n = round(2 * p.path_length / width)
    x = np.arange(-0.5, p.main_path_length + 3.0, place) + place / 2
    phase = width * (np.arange(n) + 0.5)
    y = np.where(phase < p.path_length, phase - p.half_path, 3 * p.half_path - phase)
    hit = (np.minimum(x, p.main_path_length)[:, None] - p.crossing[0]) ** 2 + y**2
    hit = hit <= p.collision_square
    arrived = np.broadcast_to((x >= p.main_path_length)[:, None], hit.shape)
    going = goes(x[:, None], y[None])

    def kernel(size, step):
        offset = size * np.arange(-n, n + 1)
        weight = np.exp(-0.5 * ((offset - step) / (p.noise * step)) ** 2)
        return offset, weight / weight.sum()

    offset, weight = kernel(width, p.opponent_step)
    circle = np.zeros(n)
    np.add.at(circle, (np.round(offset / width).astype(int)) % n, weight)
    spectrum = np.conj(np.fft.fft(circle))
    offset, weight = kernel(place, p.agent_step)
    near = weight > 1e-14
    shifts = np.round(offset[near] / place).astype(int)
    value = np.where(hit, 0.0, np.where(arrived, 1.0, 0.0))
    for step in range(p.max_steps - 1, -1, -1):
        turned = np.fft.ifft(np.fft.fft(value, axis=1) * spectrum, axis=1).real
        moved = np.zeros_like(turned)
        for shift, share in zip(shifts, weight[near], strict=True):
            moved[: len(x) - shift] += share * turned[shift:]
            moved[len(x) - shift :] += share * turned[-1:]
        value = np.where(going, moved, turned)
        if step > 0:
            value = np.where(hit, 0.0, np.where(arrived, 1.0, value))
    start = np.abs(x - place / 2).argmin()
    return float(value[start].mean() + value[start - 1].mean()) / 2


def short_gate(x, y):
    return (x > 2.9) | (np.abs(y) > 6.3)


SHORT_GATE = (0, 2.9, (1, -6.3, GO, (1, 6.3, STOP, GO)), GO)


@pytest.fixture(scope="module")
def exact():
    return dense_success(EvasionParameters(**SHORT), short_gate)


def chain(cells=440, spacing=0.5):
    policy = policy_of(SHORT_GATE, "eutree/Evasion-v0", **SHORT)
    return EvasionChain(EvasionParameters(**SHORT), policy, cells=cells, spacing=spacing)


@pytest.mark.parametrize("cells", [110, 220, 440, 880])
def test_bounds_hold_a_dense_chain(exact, cells):
    low, high = chain(cells).bounds(SUCCESS)
    assert low <= exact <= high
    assert 0.5 < exact < 0.999


def test_bounds_of_finer_cells_are_narrow(exact):
    low, high = chain(880, 0.25).bounds(SUCCESS)
    assert exact - 0.02 < low <= exact <= high < exact + 0.02


def test_a_collision_that_is_too_small_is_caught(exact):
    narrow = replace(EvasionParameters(**SHORT), collision_distance=1.9)
    policy = policy_of(SHORT_GATE, "eutree/Evasion-v0", **SHORT)
    low, high = EvasionChain(narrow, policy, cells=880, spacing=0.25).bounds(SUCCESS)
    assert not low <= exact <= high


@pytest.mark.parametrize("cells", [220, 440, 700])
def test_what_a_step_around_the_circle_is_off(cells):
    """Any value of any state: its mean after a step is as far from the means' sum as said."""
    width, step = 44.0 / cells, Normal(center=3.2, deviation=0.064)
    first, moves = circle_moves(width, step)
    fine = 40
    generator = np.random.default_rng(cells)
    offset = width / fine * (np.arange(moves.mean.shape[1] * fine) + 0.5) + first * width
    starts = width / fine * (np.arange(fine) + 0.5)
    density = step.density(offset - starts[:, None]) * width / fine
    for _ in range(20):
        value = generator.random((moves.mean.shape[1], fine)) < generator.random()
        value = value.astype(float)
        value = np.sort(value, axis=1) if generator.random() < 0.5 else value
        mean, spans = value.mean(axis=1), np.ptp(value, axis=1)
        true = density @ value.reshape(-1)
        assert abs(true.mean() - mean @ moves.mean[0]) <= moves.blur[0] @ spans + 1e-4
        change = np.diff(mean)
        low = mean[0] + np.where(change > 0, moves.low[0, 1:], moves.high[0, 1:]) @ change
        assert true.min() >= low - moves.spread[0] @ spans - 1e-4
        assert (density.reshape(fine, -1, fine).sum(axis=2) <= moves.most[0] + 1e-4).all()
    # A value of 1 just where the end is likelier than the cell's mean: less would be wrong.
    end = density.mean(axis=0).reshape(-1, fine)
    worst = (end > end.mean(axis=1, keepdims=True)).astype(float)
    off = (end * worst).sum() - worst.mean(axis=1) @ moves.mean[0]
    assert 0.9 * moves.blur.sum() < off <= moves.blur.sum()


def test_what_a_step_along_the_path_is_off():
    step = Normal(center=2.0, deviation=0.04)
    edges = [
        step.after(k).center + step.after(k).deviation * np.linspace(-5.5, 5.5, 12) for k in (4, 5)
    ]
    moves = line_moves(edges[0], edges[1], 4, step)
    generator = np.random.default_rng(0)
    start = step.after(4).center + step.after(4).deviation * generator.standard_normal(400_000)
    end = start + step.center + step.deviation * generator.standard_normal(start.size)
    for row in range(3, 8):
        here = (start > edges[0][row]) & (start <= edges[0][row + 1])
        found = np.histogram(end[here], bins=edges[1])[0] / here.sum()
        assert np.abs(found - moves.mean[row]).max() < 5 * 0.5 / np.sqrt(here.sum())
        assert (found <= moves.most[row] + 0.01).all()
    assert np.allclose(moves.mean.sum(axis=1), 1.0)
    assert (moves.blur <= moves.mean + 1e-7).all()


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Take cells that are larger than those of the command, for a test of seconds."""
    for name, value in (
        ("_CELLS", 330),
        ("_BEST_CELLS", 110),
        ("_SPACING", 0.8),
        ("_BEST_SPACING", 1.5),
    ):
        monkeypatch.setattr(f"eutree_lab.plants.evasion.{name}", value)


def rows_of_a_million():
    with (Path(__file__).parent / "evasion_success.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("row", rows_of_a_million(), ids=lambda row: row["tree"])
def test_bounds_hold_a_million_real_episodes(row):
    episodes, successes = int(row["episodes"]), int(row["successes"])
    found = prove(policy_of(TREES[row["tree"]], SPEC.id), plant_of(SPEC), effort=COARSE)
    low, high = found.bounds["success"]
    off = 5 * np.sqrt(0.25 / episodes)
    assert low - off <= successes / episodes <= high + off
    again = evaluate(policy_of(TREES[row["tree"]], SPEC.id), SPEC, episodes=2000, seed=5)
    assert abs(np.mean(again.successes) - successes / episodes) < 5 * np.sqrt(0.25 / 2000)


def test_verdicts():
    always, plant = policy_of(GO, SPEC.id), plant_of(SPEC)
    proven = prove(always, plant, "succeeds with probability at least 0.4", effort=COARSE)
    assert proven.verdict == "proven"
    assert "succeeds with probability at least 0.4" in proven.sentence
    assert proven.bounds["best_success"][1] > 0.99
    assert (
        prove(always, plant, "succeeds with probability at least 0.9", effort=COARSE).verdict
        == "refuted"
    )
    low, high = proven.bounds["success"]
    between = f"succeeds with probability at least {(low + high) / 2:.4f}"
    assert prove(always, plant, between, effort=COARSE).verdict == "undecided"


def test_bounds_of_every_policy_prove_nothing(monkeypatch):
    monkeypatch.setattr("eutree_lab.plants.evasion._CELLS", 40)
    monkeypatch.setattr("eutree_lab.plants.evasion._SPACING", 6.0)
    found = prove(policy_of(GATES, SPEC.id), plant_of(SPEC), effort=COARSE)
    assert found.bounds["success"] == (0.0, 1.0)
    assert found.verdict == "undecided"
    assert found.undecided == 1.0
    assert found.sentence.endswith("; this says nothing of the policy")


def test_a_mean_return_is_bounded_too(monkeypatch):
    monkeypatch.setattr("eutree_lab.plants.evasion._CELLS", 440)
    monkeypatch.setattr("eutree_lab.plants.evasion._SPACING", 0.6)
    policy = policy_of(GO, SPEC.id)
    found = prove(policy, plant_of(SPEC), "returns at least 20", effort=COARSE)
    low, high = found.bounds["mean_return"]
    played = evaluate(policy, SPEC, episodes=4000, seed=1).returns
    off = 5 * played.std() / np.sqrt(played.size)
    assert low - off <= played.mean() <= high + off
    assert high - low < 60
    assert found.bounds["best_mean_return"][1] > 90


def test_a_policy_that_looks_at_directions():
    """It goes when the opponent heads outward; the dense chain cannot tell, so real episodes do."""
    arguments = {**SHORT, "observe_direction": True}
    nested = (0, 2.9, (2, 0.0, (1, -6.3, GO, STOP), (1, 6.3, STOP, GO)), GO)
    policy = policy_of(nested, "eutree/Evasion-v0", **arguments)
    parameters = EvasionParameters(**arguments)
    low, high = EvasionChain(parameters, policy, cells=880, spacing=0.4).bounds(SUCCESS)
    spec = EnvironmentSpec("eutree/Evasion-v0", arguments)
    played = np.mean(evaluate(policy, spec, episodes=4000, seed=0).successes)
    assert low - 0.03 <= played <= high + 0.03
    assert high - low < 0.06


def test_the_picture_is_below_what_real_episodes_show():
    """Of episodes without a stop so far, success is at least the mean of the picture's cells."""
    policy = policy_of(GATES, SPEC.id)
    pictures = prove(policy, plant_of(SPEC), effort=COARSE).pictures
    env = gymnasium.make(SPEC.id)
    seen = {}
    for seed in range(400):
        observation, _ = env.reset(seed=seed)
        path, stopped, over = [], False, False
        while not over:
            if not stopped:
                path.append(observation[1:3])
            action = policy.act(observation.tolist())
            stopped = stopped or action == STOP
            observation, _, ended, cut, info = env.step(action)
            over = ended or cut
        for k, places in enumerate(path):
            seen.setdefault(k, []).append((places, info["is_success"]))
    for opponent, picture in enumerate(pictures):
        low, high = picture.low[1], picture.high[1]
        assert picture.values.shape[1] == 64
        for k in range(8):
            places = np.array([one[opponent] for one, _ in seen[k]])
            cells = np.minimum((places - low) / (high - low) * 64, 63).astype(int)
            success = np.mean([good for _, good in seen[k]])
            assert picture.values[k, cells].mean() <= success + 3 * 0.5 / np.sqrt(len(cells))
        assert np.ptp(picture.values) > 0.3


def test_payoffs_of_one_are_a_certainty():
    one = Payoffs(goal=1.0, collision=1.0, late=1.0, stop=0.0, low=0.0, high=1.0)
    assert chain(110).bounds(one) == pytest.approx((1.0, 1.0), abs=1e-5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"start": "either end"}, "knows start='anywhere', got 'either end'"),
        ({"bounce": "turn"}, "knows bounce='reflect', got 'turn'"),
        ({"noise": 0.0}, "needs noise above 0"),
    ],
)
def test_a_domain_that_the_plant_does_not_know_is_one_line(arguments, message):
    with pytest.raises(InvalidArgumentError, match=message) as raised:
        plant_of(EnvironmentSpec("eutree/Evasion2-v0", arguments))
    assert "\n" not in str(raised.value)


def test_a_property_that_chance_cannot_keep_is_one_line():
    plant = plant_of(SPEC)
    for question in (
        "arrives",
        "avoids position >= 31",
        "returns at least 5 with probability at least 0.9",
    ):
        with pytest.raises(InvalidArgumentError, match="whose noise has no bounds"):
            prove(policy_of(GO, SPEC.id), plant, question)
    with pytest.raises(InvalidArgumentError, match="has no boxes"):
        check_plant(plant, generator=np.random.default_rng(0))


def test_too_many_opponents_at_once_are_one_line():
    arguments = {"n_opponents": 4, "collision_distance": 3.0, "crossings": (9.0, 10.0, 11.0, 12.0)}
    policy = policy_of(GO, "eutree/Evasion-v0", **arguments)
    plant = plant_of(EnvironmentSpec("eutree/Evasion-v0", arguments))
    with pytest.raises(InvalidArgumentError, match="looks at too many opponents at once"):
        prove(policy, plant)


def make_table(episodes=1_000_000):
    """Write the table of real episodes: ``python -m tests.lab.plants.test_evasion``."""
    with (Path(__file__).parent / "evasion_success.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["tree", "episodes", "successes"])
        for name, nested in TREES.items():
            policy = policy_of(nested, SPEC.id)
            successes = sum(
                int(np.sum(evaluate(policy, SPEC, episodes=episodes // 10, seed=seed).successes))
                for seed in range(100, 110)
            )
            table.writerow([name, episodes, successes])


if __name__ == "__main__":
    gymnasium.register_envs(__import__("eutree"))
    make_table()


@pytest.mark.parametrize("limit", [3, 40, 900])
def test_the_time_limit_of_gymnasium_counts_too(limit):
    """It was proven to succeed in 99.8 % of episodes that three steps cut short."""
    cut = EnvironmentSpec("eutree/Evasion-v0", SHORT | {"max_episode_steps": limit})
    seconds = min(limit * EvasionParameters().time_step, SHORT["trial_limit"])
    same = EnvironmentSpec("eutree/Evasion-v0", SHORT | {"trial_limit": seconds})
    policy = policy_of(SHORT_GATE, "eutree/Evasion-v0", **SHORT)
    asked = "succeeds with probability at least 0.5"
    found, expected = (prove(policy, plant_of(one), asked, effort=COARSE) for one in (cut, same))
    assert found.bounds == expected.bounds
    assert (found.verdict == "refuted") == (limit == 3)
    low, high = found.bounds["success"]
    played = evaluate(policy, cut, episodes=200, seed=4).success_rate
    assert low - 0.1 <= played <= high + 0.1
