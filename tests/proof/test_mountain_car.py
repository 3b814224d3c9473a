"""Proofs of MountainCar's trees: sound for the program that runs, tight, and quick."""

import functools

import gymnasium
import numpy as np
import pytest
from benchmarks.carried import boxes_along

from eutree.errors import InvalidArgumentError
from eutree.proof import Effort, Plant, check_plant, plant_of, prove, register_plant, replay
from eutree.proof.certificate import NEVER
from eutree.proof.intervals import cos
from eutree.proof.plant import MountainCar
from eutree.proof.reach import Acting
from eutree.schema import EnvironmentSpec
from tests.proof.policies import BAD, GOOD, SWITCH, policy_of

SPEC = EnvironmentSpec("MountainCar-v0")
PLANT = MountainCar(SPEC)
COARSE = Effort(smallest=2.0**-11)  # where bounds need not be tight


@functools.cache
def proof_of(nested):
    """Prove a tree of the module once; it takes seconds."""
    return prove(policy_of(nested), PLANT)


@pytest.fixture(scope="module")
def good():
    return proof_of(GOOD)


@pytest.fixture(scope="module")
def coarse():
    return prove(policy_of(GOOD), PLANT, effort=COARSE)


def test_a_learned_tree_arrives_from_every_start(good):
    assert good.proven
    assert good.kind == "proof"
    assert good.undecided == 0.0
    assert good.bounds["steps"] == (83, 108)
    low, high = good.bounds["mean_return"]
    assert high - low < 0.04
    assert "arrives within 108 steps" in good.sentence
    assert good.worst_start["steps"] == 108


def test_a_tree_that_never_arrives_from_some_start_is_refuted_by_gymnasium():
    """Its mean return of 200 episodes was among the best of its table."""
    policy = policy_of(BAD)
    found = proof_of(BAD)
    assert found.verdict == "refuted"
    env = gymnasium.make("MountainCar-v0")
    position = found.counterexample["position"]
    observation, _ = env.reset(options={"low": position, "high": position})
    steps, over = 0, False
    while not over and steps < 200:
        observation, _, over, _, _ = env.step(policy.predict(observation)[0])
        steps += 1
    assert not over


@pytest.mark.parametrize("nested", [SWITCH, GOOD, BAD])
def test_real_episodes_end_at_the_certified_step(nested):
    policy = policy_of(nested)
    pieces = proof_of(nested).pieces
    generator = np.random.default_rng(7)
    order = np.argsort(pieces.low[:, 0])
    for position in generator.uniform(-0.6, -0.4, 150):
        k = order[np.searchsorted(pieces.low[order, 0], position, side="right") - 1]
        assert pieces.low[k, 0] <= position <= pieces.high[k, 0]
        path = replay(PLANT, policy, np.array([position, 0.0]), 200)
        steps = len(path.states) - 1 if path.is_over else NEVER
        assert pieces.first[k] <= steps <= pieces.last[k]


def outside(policy, pieces, plant, count):
    """Return how many of some real states lie outside of their boxes, and how many have one."""
    order = np.argsort(pieces.low[:, 0])
    starts = np.random.default_rng(3).uniform(-0.6, -0.4, count)
    k = order[np.searchsorted(pieces.low[order, 0], starts, side="right") - 1]
    paths = [replay(PLANT, policy, np.array([one, 0.0]), 200).states for one in starts]
    boxes = boxes_along(Acting(policy, plant), plant, (pieces.low[k], pieces.high[k]), 120)
    wrong = known = 0
    for step, (low, high) in enumerate(boxes, start=1):
        for path, least, most in zip(paths, low, high, strict=True):
            if step < len(path) and np.isfinite(least).all():
                wrong += not ((least <= path[step]) & (path[step] <= most)).all()
                known += 1
    return wrong, known


@pytest.mark.parametrize("nested", [GOOD, BAD])
def test_real_states_lie_in_the_boxes_at_every_step(nested):
    policy = policy_of(nested)
    wrong, known = outside(policy, proof_of(nested).pieces, PLANT, 60)
    assert wrong == 0
    assert known > 60 * 80 * 0.9


def test_a_box_of_another_hill_is_caught_by_real_states(good):
    wrong, known = outside(policy_of(GOOD), good.pieces, Slippery(SPEC), 5)
    assert wrong > known / 2


def test_the_pieces_are_all_starts_and_do_not_overlap(good):
    low, high = np.sort(good.pieces.low[:, 0]), np.sort(good.pieces.high[:, 0])
    assert low[0] == -0.6
    assert high[-1] == -0.4
    assert (low[1:] == high[:-1]).all()


def test_the_plant_moves_as_gymnasium_does():
    check_plant(PLANT, episodes=40, generator=np.random.default_rng(0))


class Slippery(MountainCar):
    """A plant with another hill."""

    def step(self, state, action):
        position, velocity = state
        velocity = velocity + (cos(3 * position) * -0.00251 + (action - 1) * 0.001)
        return position + velocity, velocity


class Inward(MountainCar):
    """A plant that is rounded the wrong way."""

    def step(self, state, action):
        return [type(one)(one.high, one.low) for one in super().step(state, action)]


@pytest.mark.parametrize("wrong", [Slippery, Inward])
def test_a_wrong_plant_is_caught_by_sampling(wrong):
    with pytest.raises(InvalidArgumentError, match="plant must move as MountainCar-v0 does"):
        check_plant(wrong(SPEC), episodes=3, generator=np.random.default_rng(0))


def test_coarser_pieces_leave_bounds_that_are_wider_and_true(good, coarse):
    assert coarse.bounds["mean_return"][0] <= good.bounds["mean_return"][0]
    assert coarse.bounds["mean_return"][1] >= good.bounds["mean_return"][1]
    assert coarse.work["pieces"] < good.work["pieces"]


def test_without_effort_nothing_is_decided_and_nothing_is_claimed():
    found = prove(policy_of(GOOD), PLANT, effort=Effort(box_steps=2000))
    assert found.verdict == "undecided"
    assert 0 < found.undecided <= 1


def test_what_must_hold_at_every_step():
    policy = policy_of(GOOD)
    assert prove(policy, PLANT, "stays in position <= 0.6 for 150 steps", effort=COARSE).proven
    assert prove(policy, PLANT, "avoids velocity >= 0.071", effort=COARSE).proven
    broken = prove(policy, PLANT, "stays in position >= -0.9", effort=COARSE)
    assert broken.verdict == "refuted"
    assert broken.counterexample["steps"] > 0


def test_single_precision_of_observations_is_exact():
    """A threshold between two doubles of one float32 decides by the float32 alone."""
    start = np.float32(-0.5)
    threshold = float(np.nextafter(start, np.float32(1)) / 2 + start / 2)
    for nudge in (-1e-9, 0.0, 1e-9):
        found = prove(policy_of((0, threshold + nudge, 2, 0)), PLANT, "arrives within 1 steps")
        assert found.verdict == "refuted"
    from eutree.proof.reach import _Boxes

    acting = Acting(policy_of((0, threshold, 2, 0)), PLANT)
    for position in np.linspace(-0.5, -0.5 + 1.2e-7, 2001):
        point = np.array([[position], [0.0]])
        box = _Boxes.beginning(point, point, np.array([True, False]))
        action = policy_of((0, threshold, 2, 0)).act([float(np.float32(position)), 0.0])
        assert acting(box.state())[0] == 1 << action


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ("flies", "property must be 'arrives"),
        ("stays in speed <= 1", "unknown feature 'speed'"),
        ("stays in position <= 1 for ever", "has no grid"),
        ("arrives within 0 steps", "must be about 1 to"),
        ("succeeds with probability at least 0.9", "is about chance"),
        ("succeeds with probability at least 1.5", "between 0 and 1"),
        ("returns at least --", "must have a return in digits"),
        ("stays in position <= -0.5", "must hold where episodes begin"),
    ],
)
def test_a_property_that_cannot_be_asked_is_one_line(question, message):
    with pytest.raises(InvalidArgumentError, match=message) as raised:
        prove(policy_of(GOOD), PLANT, question)
    assert "\n" not in str(raised.value)


def test_a_plant_without_a_step_and_a_policy_of_another_task():
    class Empty(MountainCar):
        step = Plant.step

    with pytest.raises(InvalidArgumentError, match="must have a step that moves boxes"):
        prove(policy_of(GOOD), Empty(SPEC))
    with pytest.raises(InvalidArgumentError, match="features and actions of MountainCar-v0"):
        prove(policy_of((0, 0.0, 0, 1), "CartPole-v1"), PLANT)
    with pytest.raises(InvalidArgumentError, match="knows no argument 'gravity'"):
        plant_of(EnvironmentSpec("MountainCar-v0", {"gravity": 1.0}))


def test_a_plant_of_ones_own_is_found_by_the_id():
    register_plant("TestCar-v0", MountainCar)
    assert isinstance(plant_of(EnvironmentSpec("TestCar-v0")), MountainCar)
    assert plant_of(EnvironmentSpec("LunarLander-v3")) is None


def test_the_mean_return_over_all_starts_is_proven_too(coarse):
    low, high = coarse.bounds["mean_return"]
    for least, verdict in ((low - 0.01, "proven"), (high + 0.01, "refuted"),
                           ((low + high) / 2, "undecided")):  # fmt: skip
        found = prove(policy_of(GOOD), PLANT, f"returns at least {least!r}", effort=COARSE)
        assert found.verdict == verdict
        assert "its mean return is in [-9" in found.sentence
        assert found.counterexample is None
    with pytest.raises(InvalidArgumentError, match="is about chance"):
        prove(policy_of(GOOD), PLANT, "returns at least -100 with probability at least 0.9")


def test_no_episode_arrives_behind_the_time_limit():
    """It was proven to arrive within 159 steps where all episodes end after 100."""
    short = MountainCar(EnvironmentSpec("MountainCar-v0", {"max_episode_steps": 100}))
    found = prove(policy_of(GOOD), short, "arrives within 110 steps", effort=COARSE)
    assert found.verdict == "refuted"
    assert found.counterexample["steps"] == 100
    env = gymnasium.make("MountainCar-v0", max_episode_steps=100)
    position = found.counterexample["position"]
    observation, _ = env.reset(options={"low": position, "high": position})
    over = False
    while not over:
        action = policy_of(GOOD).act(observation.tolist())
        observation, _, arrived, over, _ = env.step(action)
    assert not arrived
    endless = MountainCar(EnvironmentSpec("MountainCar-v0", {"max_episode_steps": -1}))
    assert prove(policy_of(GOOD), endless, "arrives within 110 steps", effort=COARSE).proven


@pytest.mark.parametrize(("name", "limit"), [("MountainCar-v0", 200), ("CartPole-v1", 500)])
def test_a_time_limit_of_none_is_the_registered_one(name, limit):
    """It was none, and trees were proven to arrive later than Gymnasium ends an episode."""
    for asked, meant in ((None, limit), (50, 50), (-1, None)):
        plant = plant_of(EnvironmentSpec(name, {"max_episode_steps": asked}))
        assert (plant.limit, plant.time_limit) == (meant, meant)


def test_no_tree_arrives_behind_the_registered_time_limit():
    slow = policy_of((1, 0.0, 1, (0, -0.3, 2, 1)))  # 241 to 337 steps
    plant = MountainCar(EnvironmentSpec("MountainCar-v0", {"max_episode_steps": None}))
    found = prove(slow, plant, "arrives within 400 steps", effort=COARSE)
    assert (found.verdict, found.counterexample["steps"]) == ("refuted", 200)


def test_a_certificate_of_a_mean_return_has_no_boxes_of_starts():
    """They were those of another question: whether it arrives."""
    refuted = prove(policy_of(BAD), PLANT, "returns at least -50", effort=COARSE)
    proven = prove(policy_of(BAD), PLANT, "returns at least -150", effort=COARSE)
    assert (refuted.verdict, proven.verdict) == ("refuted", "proven")
    assert (refuted.starts, refuted.undecided) == (proven.starts, proven.undecided) == (None, 0.0)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"plant": None}, "plant must be a Plant"),
        ({"plant": "MountainCar-v0"}, "plant must be a Plant"),
        ({"plant": PLANT, "effort": 5}, "effort must be an? Effort"),
    ],
)
def test_other_kinds_of_arguments_are_refused(arguments, said):
    with pytest.raises(InvalidArgumentError, match=said):
        prove(policy_of(GOOD), **arguments)


@pytest.mark.parametrize("wrong", [{"smallest": -1.0}, {"smallest": np.nan}, {"box_steps": 0}])
def test_an_effort_ends(wrong):
    with pytest.raises(InvalidArgumentError, match=next(iter(wrong))):
        Effort(**wrong)
