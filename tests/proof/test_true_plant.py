"""What a tree sees and does is the environment's: a plant that says otherwise proves nothing."""

from dataclasses import replace
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.errors import InvalidArgumentError
from eutree.proof import Effort, Intervals, Plant, check_plant, prove, replay, where
from eutree.schema import EnvironmentSpec
from tests.proof.policies import policy_of

NAME = "Line-v0"
FEW = Effort(box_steps=100_000)
SWITCH = (0, 0.0, 0, 1)  # down where what is seen is at most 0


class Line(gymnasium.Env[Any, Any]):
    """A place that an action moves down or up by a quarter; what is seen of it may differ."""

    metadata: ClassVar = {"render_modes": []}
    seen_as: ClassVar[Any] = staticmethod(lambda place: place)
    starts: ClassVar = (0.2, 0.8)
    action_space = gymnasium.spaces.Discrete(2)
    observation_space = gymnasium.spaces.Box(-100.0, 100.0, (1,), np.float64)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = self.np_random.uniform(*self.starts, 1)
        return self.seen(), {}

    def step(self, action: int) -> Any:
        self.state = self.state + 0.25 * (2 * (action - self.action_space.start) - 1)
        return self.seen(), 0.0, self.ends(), False, {}

    def seen(self) -> Any:
        return self.seen_as(self.state.copy())

    def ends(self) -> bool:
        return False


class LinePlant(Plant):
    """The line on intervals."""

    state = ("place",)
    start = ((0.2, 0.8),)

    def __init__(self) -> None:
        self.environment = EnvironmentSpec(NAME)

    def step(self, state: Any, action: Any) -> Any:
        return [state[0] + 0.25 * (2.0 * action - 1.0)]


class Mirror(LinePlant):
    """What is seen is its negative."""

    def observe(self, state: Any) -> Any:
        return [-state[0]]


@pytest.fixture(autouse=True)
def line(monkeypatch):
    """Register the line; return a function that makes one of its own out of it."""

    def registered(limit: int | None = None, **declared: Any) -> Any:
        kind = type("Own", (Line,), declared)
        monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, kind, max_episode_steps=limit))
        return policy_of(SWITCH, NAME)

    registered()
    return registered


def checked(plant: Plant) -> None:
    check_plant(plant, episodes=20, steps=20, generator=np.random.default_rng(0))


def test_axes_cut_what_a_tree_sees_only_where_that_is_the_state(line):
    """Boxes of leaves, which are of what is seen, cut the state: what fails was proven."""
    policy = line(seen_as=staticmethod(lambda place: -place))
    plant = Mirror()
    plant.axes, plant.cells = ((1.0,),), (0.01,)
    checked(plant)
    assert (
        prove(policy, plant, "stays in place >= -0.2 for 5 steps", effort=FEW).verdict == "refuted"
    )
    assert prove(policy, plant, "stays in place >= -1.1 for 5 steps", effort=FEW).proven


@pytest.mark.parametrize(
    ("axes", "cells"),
    [
        (((1.0,),), ()),
        (((1.0,),), (0.0,)),
        (((1.0,),), (-0.1,)),
        (((1.0,),), (np.nan,)),
        (((1.0, 2.0),), (0.1,)),
        (((1.0,), (1.0,)), (0.1, 0.1)),
        (((0.0,),), (0.1,)),
    ],
)
def test_axes_that_are_none_are_refused(line, axes, cells):
    """Without widths compiled code read what was not there, and the process ended."""
    plant = LinePlant()
    plant.axes, plant.cells = axes, cells
    with pytest.raises(InvalidArgumentError, match=r"axes (and cells )?of a plant must"):
        prove(line(), plant, "stays in place <= 100 for 5 steps")


def test_actions_are_numbered_from_nought_as_the_tree_does(line):
    policy = line(action_space=gymnasium.spaces.Discrete(2, start=1))
    checked(LinePlant())
    found = prove(policy, LinePlant(), "stays in place <= 1.5 for 5 steps", effort=FEW)
    assert found.verdict == "refuted"
    start = np.array([found.counterexample["place"]])
    assert replay(LinePlant(), policy, start, 1).states[1] == start + 0.25

    class AsItsOwn(LinePlant):
        def step(self, state: Any, action: Any) -> Any:
            return super().step(state, action - 1)

    with pytest.raises(InvalidArgumentError, match="plant must move as Line-v0 does"):
        checked(AsItsOwn())


def test_actions_that_are_masked_are_refused(line):
    policy = line(action_masks=lambda self: np.array([self.state[0] > 0.5, True]))
    for ask in (
        lambda: prove(policy, LinePlant(), "stays in place <= 9"),
        lambda: checked(LinePlant()),
    ):
        with pytest.raises(InvalidArgumentError, match="all actions must be allowed everywhere"):
            ask()


def test_a_policy_that_says_masked_is_refused_for_what_it_is(line):
    """It was said of the environment, which shows no masks."""
    policy = replace(line(), masked=True)
    with pytest.raises(
        InvalidArgumentError, match=r"the policy \(its file says masked\) has masks"
    ):
        prove(policy, LinePlant(), "stays in place <= 9")
    policy = replace(line(action_masks=lambda self: np.array([True, True])), masked=True)
    with pytest.raises(InvalidArgumentError, match=f"{NAME} has masks"):
        prove(policy, LinePlant(), "stays in place <= 9")


def test_the_first_thing_that_is_seen_is_observed(line):
    """It was the state itself, so that counterexamples began with another decision."""
    policy = line(seen_as=staticmethod(lambda place: -place))
    path = replay(Mirror(), policy, np.array([0.5]), 1)
    assert path.states.tolist() == [[0.5], [0.25]]


@pytest.mark.parametrize("still", [Intervals.of(0.5), 0.5])
def test_a_number_that_never_changes_is_observed_as_one(line, still):
    class Twice(LinePlant):
        def observe(self, state: Any) -> Any:
            return [-state[0], still]

    box = gymnasium.spaces.Box(-100.0, 100.0, (2,), np.float64)
    shown = staticmethod(lambda place: np.append(-place, 0.5))
    policy = line(seen_as=shown, observation_space=box)
    assert replay(Twice(), policy, np.array([0.5]), 1).states.tolist() == [[0.5], [0.25]]
    assert prove(policy, Twice(), "stays in place <= 1 for 2 steps", effort=FEW).verdict == "proven"


def test_a_plant_that_knows_what_is_seen_only_but_for_rounding_says_so(line):
    class Tenth(LinePlant):
        def observe(self, state: Any) -> Any:
            return [0.1 * state[0]]

    policy = line(seen_as=staticmethod(lambda place: 0.1 * place))
    with pytest.raises(InvalidArgumentError, match="Tenth must have a method put of its own"):
        prove(policy, Tenth(), "stays in place <= 1 for 5 steps", effort=FEW)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_observations_are_of_the_precision_that_the_plant_says(line, kind):
    box = gymnasium.spaces.Box(-100.0, 100.0, (1,), kind)
    policy = line(seen_as=staticmethod(lambda place: place.astype(kind)), observation_space=box)
    plant = LinePlant()
    for precision in (np.float64, np.float16, "float31"):
        plant.precision = precision
        with pytest.raises(InvalidArgumentError, match="precision of LinePlant must be the type"):
            prove(policy, plant, "stays in place <= 9 for 5 steps")
    plant.precision = np.float32
    if kind is np.float32:
        assert prove(policy, plant, "stays in place <= 9 for 5 steps").proven


def test_observations_within_observations_are_of_no_precision(line):
    inner = gymnasium.spaces.Box(-100.0, 100.0, (1,), np.float32)
    nested = gymnasium.spaces.Dict({"of": gymnasium.spaces.Dict({"place": inner})})
    shown = staticmethod(lambda place: {"of": {"place": place.astype(np.float32)}})
    policy = line(seen_as=shown, observation_space=nested)
    with pytest.raises(InvalidArgumentError, match="where they are object"):
        prove(policy, LinePlant(), "stays in place <= 9 for 5 steps")


class Goal(LinePlant):
    """It arrives at 3; between 1.5 and 1.7 the real one crashes."""

    def arrives(self, state: Any) -> Any:
        return state[0] >= 3.0


class Crashing(Goal):
    """Knows it: there it stays."""

    def step(self, state: Any, action: Any) -> Any:
        crashed = (state[0] > 1.5) & (state[0] < 1.7)
        return [where(crashed, state[0], super().step(state, action)[0])]


def test_an_end_that_the_plant_does_not_know_is_found(line):
    policy = line(ends=lambda self: bool(self.state[0] >= 3.0 or 1.5 < self.state[0] < 1.7))
    with pytest.raises(
        InvalidArgumentError, match=r"ends in .*, which has not arrived and which a"
    ):
        checked(Goal())
    checked(Crashing())
    found = prove(policy, Crashing(), "arrives within 20 steps", effort=FEW)
    assert found.verdict == "refuted"
    assert "steps" not in found.bounds
    assert found.worst_start is None


def test_no_episode_arrives_after_it_was_cut_short(line):
    ends = {"ends": lambda self: bool(self.state[0] >= 3.0)}
    assert prove(line(**ends), Goal(), "arrives within 20 steps", effort=FEW).proven
    assert not prove(line(limit=5, **ends), Goal(), "arrives within 20 steps", effort=FEW).proven
    plant = Goal()
    plant.limit = 7
    with pytest.raises(InvalidArgumentError, match="limit of Goal must be that of Line-v0, 5 "):
        prove(line(limit=5, **ends), plant, "arrives")


def test_a_start_that_the_plant_does_not_know_is_found(line):
    line(starts=(0.0, 1.0))
    with pytest.raises(InvalidArgumentError, match="plant must start as Line-v0 does"):
        checked(LinePlant())


def test_a_reward_that_is_not_the_environments_is_found():
    plant = LinePlant()
    plant.reward = 0.0
    checked(plant)
    plant.reward = -2.0
    message = "plant must earn as Line-v0 does: after action . in .* the reward is 0.0, and .* -2.0"
    with pytest.raises(InvalidArgumentError, match=message):
        checked(plant)


def test_a_plant_is_checked_with_one_warning_in_all(line):
    line(observation_space=gymnasium.spaces.Box(0.0, 0.5, (1,), np.float64))
    plant = LinePlant()
    plant.make = lambda: gymnasium.make(NAME, disable_env_checker=True)
    with pytest.warns(UserWarning, match="said once") as found:
        checked(plant)
    assert len(found) == 1


class Disturbed(LinePlant):
    """A step goes up to half a quarter farther or less far, by chance."""

    def step(self, state: Any, action: Any) -> Any:
        by = Intervals.between(np.full(action.shape, -0.125), np.full(action.shape, 0.125))
        return [state[0] + 0.25 * (2.0 * action - 1.0) + by]


def test_starts_are_not_cut_where_disturbances_keep_the_tree_of_two_minds(line):
    """Tens of millions of pieces, none of which was decided by its halves, took all memory."""
    policy = policy_of((0, 0.9, 1, 0), NAME)
    found = prove(
        policy, Disturbed(), "stays in place >= -2 for 4 steps", effort=Effort(pieces=50_000)
    )
    assert found.proven
    assert found.work["pieces"] < 10_000


def test_no_more_pieces_are_kept_than_the_effort_allows(line):
    policy = policy_of((0, 0.5, 0, (0, 0.6, 1, 0)), NAME)
    asked = "stays in place <= 0.9 for 3 steps"
    whole = prove(policy, LinePlant(), asked, effort=FEW)
    found = prove(policy, LinePlant(), asked, effort=Effort(pieces=2))
    assert found.work["pieces"] < whole.work["pieces"]
    assert found.undecided > whole.undecided


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        (
            {"step": lambda state, action: [state[0] * np.nan]},
            "step of LinePlant must return bounds that are numbers, got nan for place",
        ),
        (
            {"arrives": lambda state: True},
            "arrives of LinePlant must return a Truth of N statements, got True",
        ),
        (
            {"observe": lambda state: True},
            "observe of LinePlant must return Intervals of .*, got True",
        ),
        (
            {"observe": lambda state: [*state, 1.0]},
            "observe of LinePlant must return Intervals of .*, got ",
        ),
        (
            {"measure": lambda state: "place"},
            "measure of LinePlant must return Intervals of place, got 'place'",
        ),
    ],
)
def test_what_a_plant_returns_is_looked_at(line, declared, message):
    plant = LinePlant()
    for name, value in declared.items():
        setattr(plant, name, value)
    with pytest.raises(InvalidArgumentError, match=message):
        prove(line(), plant, "arrives within 3 steps", effort=FEW)


def test_infinite_bounds_are_allowed(line):
    plant = LinePlant()
    plant.step = lambda state, action: [Intervals.of(state[0]) + Intervals.between(-np.inf, np.inf)]
    found = prove(line(), plant, "avoids place > 9 for 2 steps", effort=FEW)
    assert found.verdict == "undecided"


def test_a_measure_that_never_changes_may_be_a_number(line):
    plant = LinePlant()
    plant.measures, plant.measure = ("place", "load"), lambda state: [state[0], 3.0]
    asked = "stays in place <= 2 and load <= 4 for 3 steps"
    assert prove(line(), plant, asked, effort=FEW).proven
    plant.axes, plant.cells = ((1.0,),), (0.01,)
    assert prove(line(), plant, asked, effort=FEW).proven


@pytest.mark.parametrize("limit", [2, 100])
@pytest.mark.parametrize("asked", ["arrives", "avoids place > 3", "avoids place > 3 for 50 steps"])
def test_a_limit_that_is_not_that_of_gymnasium_proves_nothing(line, limit, asked):
    """Of two steps alone, where an episode has ten, it was proven to stay where it does not."""
    plant = Goal()
    plant.limit = limit
    message = f"limit of Goal must be that of Line-v0, 10 steps, got {limit}"
    policy = line(limit=10)
    for refused in (lambda: prove(policy, plant, asked), lambda: checked(plant)):
        with pytest.raises(InvalidArgumentError, match=message):
            refused()
    plant.limit = 10
    assert prove(policy, plant, "avoids place > 1.5", effort=FEW).verdict == "refuted"


@pytest.mark.parametrize("limit", [0, -5, 2.0, "2", True])
def test_what_is_no_limit_is_refused(line, limit):
    """Nought steps were for ever, and others an error of NumPy, or a property of no step."""
    plant = Goal()
    plant.limit = limit
    for registered in (None, 10):
        with pytest.raises(InvalidArgumentError, match="limit of Goal must be an integer >= 1"):
            prove(line(limit=registered), plant, "avoids place > 3")


def test_a_property_of_arrival_needs_a_number_of_steps_where_nothing_limits_it(line):
    with pytest.raises(InvalidArgumentError, match="must be about a number of steps"):
        prove(line(), Goal(), "arrives")
    with pytest.raises(InvalidArgumentError, match="must be about a number of steps"):
        prove(line(limit=10), Goal(), "arrives")


def test_a_property_of_an_episode_ends_with_the_time_limit_that_gymnasium_alone_says(line):
    """It was one for ever, without a grid refused, and open where an episode keeps it."""
    policy = line(limit=10)
    highest = 0.8 + 10 * 0.25
    gridded = type("Own", (LinePlant,), {"grid": ((-5.0, 5.0, 100),)})
    for plant in (LinePlant(), gridded()):
        assert prove(policy, plant, f"stays in place <= {highest + 1e-9}", effort=FEW).proven
        found = prove(policy, plant, f"avoids place > {highest - 0.1}", effort=FEW)
        assert found.verdict == "refuted"
        assert found.counterexample["steps"] == 10
    assert not prove(line(), gridded(), f"stays in place <= {highest + 1e-9}", effort=FEW).proven


@pytest.mark.parametrize("limit", [None, 10])
def test_for_ever_goes_on_where_gymnasium_would_cut_the_episode_short(line, limit):
    policy = line(limit=limit)
    plant = type("Own", (LinePlant,), {"grid": ((-9.0, 9.0, 100),)})()
    found = prove(policy, plant, "stays in place <= 8 for ever", effort=FEW)
    assert found.verdict == "refuted"
    env = plant.make()
    place = env.reset(seed=found.counterexample["seed"])[0][0]
    steps = found.counterexample["steps"]
    assert place + 0.25 * (steps - 1) <= 8 < place + 0.25 * steps
