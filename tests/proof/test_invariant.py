"""What holds for ever: the largest set of cells against a plain loop, and the thermostat."""

import gymnasium
import numpy as np
import pytest
from examples.thermostat import Room, RoomPlant

from eutree.errors import InvalidArgumentError
from eutree.proof import Effort, check_plant, plant_of, prove, replay
from eutree.proof.certificate import KNOWN, OPEN
from eutree.proof.invariant import StateGrid, largest_invariant
from eutree.proof.reach import Acting
from eutree.schema import EnvironmentSpec
from tests.proof.policies import policy_of

OFF, ON = 0, 1
SPEC = EnvironmentSpec("Room-v0")
PLANT = RoomPlant(SPEC)
THERMOSTAT = (0, 20.0, ON, OFF)


def naive_invariant(acting, plant, keeps, grid):
    """Take out cells one after the other, each move computed again, until nothing changes."""
    safe = keeps.copy()
    changed = True
    while changed:
        changed = False
        for cell in np.flatnonzero(safe):
            box = grid.boxes(np.array([cell]))
            actions = int(acting(box)[0])
            for action in range(actions.bit_length()):
                if not actions >> action & 1:
                    continue
                first, last = grid.range(plant.step(box, np.array([action])))
                inside = first.min() >= 0 and safe[first[0, 0] : last[0, 0] + 1].all()
                if not inside:
                    safe[cell] = False
                    changed = True
                    break
    return safe


def test_the_safe_cells_are_those_of_a_plain_loop():
    grid = StateGrid((np.linspace(17.0, 23.0, 61),))
    acting = Acting(policy_of(THERMOSTAT, "Room-v0"), PLANT)
    low, high = grid.edges[0][:-1], grid.edges[0][1:]
    for least, most in ((18.5, 21.5), (19.3, 20.9), (19.9, 20.1)):
        keeps = (low >= least) & (high <= most)
        found = largest_invariant(acting, PLANT, keeps, grid).safe
        assert found.tolist() == naive_invariant(acting, PLANT, keeps, grid).tolist()


def test_a_thermostat_keeps_its_room_warm_for_ever():
    found = prove(policy_of(THERMOSTAT, "Room-v0"), PLANT)
    assert found.proven
    assert "for ever" in found.sentence
    assert found.work["safe_cells"] > 0
    assert found.starts is None
    assert found.pictures[0].marks.shape == (320, 1)
    assert (found.pictures[0].marks == KNOWN).mean() > 0.2


def test_cells_with_starts_that_may_be_left_are_black():
    """A switch at 20.9 degrees heats beyond what is allowed."""
    found = prove(policy_of((0, 20.9, ON, OFF), "Room-v0"), PLANT)
    assert not found.proven
    assert (found.pictures[0].marks == OPEN).any()
    assert ((found.starts.low >= 18.9) & (found.starts.high <= 21.1)).all()


def test_no_real_episode_leaves_a_set_that_is_proven():
    policy = policy_of(THERMOSTAT, "Room-v0")
    assert prove(policy, PLANT, "stays in 18.9 <= temperature <= 21.1 for ever").proven
    for seed in range(10):
        start = np.random.default_rng(seed).uniform(19, 21, 1)
        states = replay(PLANT, policy, start, 300).states
        assert states.min() >= 18.9
        assert states.max() <= 21.1


def test_a_thermostat_that_is_set_too_high_is_refuted_by_an_episode():
    found = prove(policy_of((0, 21.4, ON, OFF), "Room-v0"), PLANT)
    assert found.verdict == "refuted"
    env = gymnasium.make("Room-v0")
    policy = policy_of((0, 21.4, ON, OFF), "Room-v0")
    observation, _ = env.reset(seed=found.counterexample["seed"])
    for _ in range(found.counterexample["steps"]):
        observation, *_ = env.step(policy.predict(observation)[0])
    assert observation[0] > 21.5


def test_what_is_neither_proven_nor_broken_is_undecided():
    """Far too coarse a grid: nothing can be safe, and no episode breaks it."""

    class Coarse(RoomPlant):
        grid = ((15.0, 25.0, 10),)

    found = prove(policy_of(THERMOSTAT, "Room-v0"), Coarse(SPEC), effort=Effort(refinements=(1,)))
    assert found.verdict == "undecided"
    assert found.undecided > 0
    assert prove(
        policy_of(THERMOSTAT, "Room-v0"), Coarse(SPEC), effort=Effort(refinements=(1, 50))
    ).proven


def test_the_plant_is_found_by_the_environments_id_and_is_true():
    plant = plant_of(SPEC)
    assert isinstance(plant, RoomPlant)
    with pytest.raises(InvalidArgumentError, match="must be about a number of steps"):
        prove(policy_of(THERMOSTAT, "Room-v0"), plant, "arrives")
    check_plant(plant, episodes=20, generator=np.random.default_rng(0))


def test_a_wrong_plant_is_caught():
    class Warm(RoomPlant):
        def step(self, state, action):
            return super().step(state, action * 2)

    with pytest.raises(InvalidArgumentError, match="plant must move as Room-v0 does"):
        check_plant(Warm(SPEC), episodes=2, generator=np.random.default_rng(0))


def test_a_plant_without_a_grid_says_so():
    class Without(RoomPlant):
        grid = ()

    with pytest.raises(InvalidArgumentError, match="has no grid"):
        prove(policy_of(THERMOSTAT, "Room-v0"), Without(SPEC))


def test_the_room_keeps_gymnasiums_contract():
    env = Room()
    first, _ = env.reset(seed=3)
    again, _ = env.reset(seed=3)
    assert first.tolist() == again.tolist()
    assert env.observation_space.contains(first)
