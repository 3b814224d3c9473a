"""A plant of one's own: a start of two numbers is followed, and a mistake never proves anything."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.errors import InvalidArgumentError
from eutree.proof import Effort, Intervals, Plant, check_plant, prove
from eutree.schema import EnvironmentSpec
from tests.proof.policies import policy_of

NAME = "OwnBoiler-v0"
ASKED = "arrives within 20 steps"


class Boiler(gymnasium.Env[Any, Any]):
    """Water that warms, and the room around it."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own declaration
    feature_names = ("water", "room")
    action_names = ("off", "on")

    def __init__(self) -> None:
        self.observation_space = gymnasium.spaces.Box(-100.0, 200.0, (2,), np.float64)
        self.action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = self.np_random.uniform([20.0, 15.0], [30.0, 20.0])
        return self.state.copy(), {}

    def step(self, action: int) -> Any:
        water, room = self.state
        later = water + 0.05 * (room - water) + 4.0 * action
        self.state = np.array([later, room + 0.001 * (water - room)])
        return self.state.copy(), -1.0, bool(later >= 55.0), False, {}


class Hidden(Boiler):
    """Another one, which keeps its state elsewhere."""

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        gymnasium.Env.reset(self, seed=seed)
        self.water = 25.0
        return np.array([self.water, 18.0]), {}

    def step(self, action: int) -> Any:
        self.water += 4.0 * action
        return np.array([self.water, 18.0]), -1.0, False, False, {}


class BoilerPlant(Plant):
    """The boiler on intervals."""

    state = ("water", "room")
    start = ((20.0, 30.0), (15.0, 20.0))

    def __init__(self) -> None:
        self.environment = EnvironmentSpec(NAME)

    def step(self, state: Any, action: Any) -> Any:
        water, room = state
        later = water + 0.05 * (room - water) + 4.0 * action
        return [self.changed(later), room + 0.001 * (water - room)]

    def arrives(self, state: Any) -> Any:
        return state[0] >= 55.0

    def changed(self, later: Any) -> Any:
        return later


@pytest.fixture
def policy(monkeypatch):
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, Boiler))
    return policy_of(1, NAME)


def test_a_start_of_two_numbers_is_not_cut_along_every_line_between_two_answers(policy):
    """As many pieces as along one number: lines, not points, divide what takes a step more."""
    effort = Effort(smallest=2.0**-16, box_steps=200_000)
    found = prove(policy, BoilerPlant(), ASKED, effort=effort)
    check_plant(BoilerPlant(), episodes=5, generator=np.random.default_rng(0))
    assert found.sentence.endswith("it arrives within 13 steps")
    assert found.bounds["steps"] == (9, 13)


def clipped(later):
    return max(later, 0.0)


def switched(later):
    return 0.0 * later + 55.0 if later > 50.0 else later


def kept_in(later):
    return later if (later > 0.0) and (later < 90.0) else 0.0 * later + 55.0


def unless(later):
    return later + 100.0 if later != 20.0 else later


@pytest.mark.parametrize("changed", [clipped, switched, kept_in, unless])
def test_what_python_would_decide_for_all_of_a_box_is_refused(policy, changed):
    plant = BoilerPlant()
    plant.changed = changed
    with pytest.raises(InvalidArgumentError, match="write where, minimum, maximum, clip"):
        prove(policy, plant, ASKED)


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        (
            {"start": ((30.0, 20.0), (15.0, 20.0))},
            "each start of BoilerPlant must be the lowest an",
        ),
        (
            {"start": ((20.0, 30.0), (15.0, np.inf))},
            "each start of BoilerPlant must be .* finite rang",
        ),
        (
            {"start": ((20.0, 30.0),)},
            "BoilerPlant cannot move boxes: ValueError: not enough",
        ),
        ({"state": "water"}, "state must be a list"),
        (
            {"step": lambda state, action: [state[0]]},
            "step of BoilerPlant must return Intervals of",
        ),
        (
            {"step": lambda state, action: [1.0, 2.0]},
            "step of BoilerPlant must return Intervals of",
        ),
        (
            {"step": lambda state, action: [state[0], Intervals.of(0.25)]},
            "step of BoilerPlant must return an interval for each of",
        ),
        ({"step": lambda state: state}, "BoilerPlant cannot move boxes: TypeError: .*lambda"),
        (
            {"arrives": lambda before, state: None},
            "BoilerPlant cannot move boxes: TypeError: .*lam",
        ),
    ],
)
def test_what_is_no_plant_is_refused(policy, declared, message):
    plant = BoilerPlant()
    for name, value in declared.items():
        setattr(plant, name, value)
    with pytest.raises(InvalidArgumentError, match=message):
        prove(policy, plant, ASKED)


@pytest.mark.parametrize("name", ["state", "start"])
def test_a_plant_that_lacks_what_it_must_name_is_refused(policy, monkeypatch, name):
    monkeypatch.delattr(BoilerPlant, name)
    with pytest.raises(InvalidArgumentError, match=f"plant must have {name}, got BoilerPlant with"):
        prove(policy, BoilerPlant(), ASKED)


def test_a_plant_without_an_environment_is_refused(policy):
    plant = BoilerPlant()
    del plant.environment
    with pytest.raises(InvalidArgumentError, match="plant must have environment, got BoilerPlant"):
        prove(policy, plant, ASKED)


def test_an_environment_that_keeps_its_state_elsewhere_is_not_believed_to_stand_still(
    policy, monkeypatch
):
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, Hidden))
    message = "BoilerPlant must have methods put and state_of of its own"
    with pytest.raises(InvalidArgumentError, match=message):
        prove(policy, BoilerPlant(), "stays in water <= 40 for 20 steps")
    with pytest.raises(InvalidArgumentError, match=message):
        check_plant(BoilerPlant(), episodes=1, generator=np.random.default_rng(0))


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (((0.0, 80.0, 20),), "OwnBoiler-v0 has no grid of all numbers, which a property for ever"),
        (((0.0, 80.0, 0), (0.0, 40.0, 9)), "cells of a grid must be an integer >= 1, got 0"),
        (((0.0, 80.0, 2e3), (0.0, 40.0, 9)), "cells of a grid must be an integer >= 1, got 2000.0"),
    ],
)
def test_what_is_no_grid_is_refused(policy, grid, message):
    plant = BoilerPlant()
    plant.grid = grid
    with pytest.raises(InvalidArgumentError, match=message):
        prove(policy, plant, "stays in water <= 90 for ever")


def test_starts_are_of_as_many_numbers_as_states(policy):
    """An internal error of NumPy, where the numbers behind were not looked at."""
    plant = BoilerPlant()
    plant.start = (*plant.start, (0.0, 1.0))
    plant.step = lambda state, action: BoilerPlant.step(plant, state[:2], action)
    with pytest.raises(InvalidArgumentError, match="start of BoilerPlant must have a range for"):
        prove(policy, plant, ASKED)


@pytest.mark.parametrize("ends", [(80.0, 0.0), (0.0, np.nan), (-np.inf, 80.0)])
def test_a_grid_between_bounds_that_are_none_is_refused_as_such(policy, ends):
    """It was said not to hold all starts."""
    plant = BoilerPlant()
    plant.grid = ((*ends, 20), (0.0, 40.0, 9))
    with pytest.raises(InvalidArgumentError, match="each range of a grid must be the lowest and "):
        prove(policy, plant, "stays in water <= 90 for ever")


@pytest.mark.parametrize("given", [(), (0,), (-1,), ("a",), 2, (1.5,), "12", (1, True)])
def test_refinements_are_looked_at(given):
    with pytest.raises(InvalidArgumentError, match=r"refinements must (have|be)"):
        Effort(refinements=given)


@pytest.mark.parametrize("number", ["nan", "inf", "1e999", "-1e999", "--", "much"])
def test_a_return_or_a_probability_is_a_finite_number(policy, number):
    """The whole grammar was shown, or infinity taken."""
    for asked in ("returns at least {}", "succeeds with probability at least {}"):
        with pytest.raises(InvalidArgumentError, match=f"in digits, a finite .*, got '{number}'"):
            prove(policy, BoilerPlant(), asked.format(number))


@pytest.mark.parametrize("given", [(NAME, (("a", 1),)), (NAME, None), (None,), (7, {})])
def test_what_makes_no_environment_is_refused_where_it_is_named(given):
    with pytest.raises(InvalidArgumentError, match=r"(id|arguments) must be a"):
        EnvironmentSpec(*given)
