"""How episodes end: without arriving, in a part of a box, under masks, from starts hard to cut."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.errors import InvalidArgumentError
from eutree.proof import Effort, Plant, check_plant, prove, replay, where
from eutree.schema import EnvironmentSpec
from tests.proof.policies import policy_of

NAME, LIMIT = "Walk-v0", 100
LEFT, SWITCH, SWING, RIGHT = 0, (0, 0.5, 0, 1), (0, 0.5, 1, 0), 1


class Walk(gymnasium.Env[Any, Any]):
    """A place that an action moves by 1, and the number of the step."""

    metadata: ClassVar = {"render_modes": []}
    feature_names = ("place", "clock")
    action_space = gymnasium.spaces.Discrete(2)
    observation_space = gymnasium.spaces.Box(-1e10, 1e10, (2,), np.float64)
    starts: ClassVar = (0.0, 1.0)
    reward, goal, pit, masked_from = -1.0, 10.0, -np.inf, 10**6

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state, self.steps = np.array([self.np_random.uniform(*self.starts), 0.0]), 0
        return self.state.copy(), {}

    def step(self, action: int) -> Any:
        self.steps += 1
        self.state = self.state + np.array([2.0 * action - 1.0, 1.0])
        over = bool(self.state[0] >= self.goal or self.state[0] <= self.pit)
        info = {"action_mask": np.array([1, 1], np.int8)} if self.steps >= self.masked_from else {}
        return self.state.copy(), self.reward, over, False, info


class WalkPlant(Plant):
    """The walk on intervals: at the goal it arrives, in the pit it stays where it is."""

    state = ("place", "clock")

    def __init__(self, kind: type[Walk], limit: int | None) -> None:
        self.environment, self.limit, self._kind = EnvironmentSpec(NAME), limit, kind
        self.start, self.reward = (kind.starts, (0.0, 0.0)), kind.reward

    def step(self, state: Any, action: Any) -> Any:
        place, clock = state
        fallen = place <= self._kind.pit
        moved = place + (2.0 * action - 1.0), clock + 1.0
        return [where(fallen, one, other) for one, other in zip(state, moved, strict=True)]

    def arrives(self, state: Any) -> Any:
        return state[0] >= self._kind.goal


class FallingPlant(WalkPlant):
    """Moves on in the pit, but says that the episode has failed there."""

    def step(self, state: Any, action: Any) -> Any:
        return state[0] + (2.0 * action - 1.0), state[1] + 1.0

    def fails(self, state: Any) -> Any:
        return state[0] <= self._kind.pit


@pytest.fixture
def walk(monkeypatch):
    """Return a function that registers a walk and returns its plant."""

    def registered(limit: int | None = None, **declared: Any) -> WalkPlant:
        kind = type("Own", (Walk,), declared)
        monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, kind, max_episode_steps=limit))
        return WalkPlant(kind, limit)

    return registered


def checked(plant: Plant) -> None:
    check_plant(plant, episodes=20, steps=20, generator=np.random.default_rng(0))


def paths(plant: Plant, policy: Any, steps: int) -> list[Any]:
    """Return real episodes from starts at equal distances."""
    places = (np.arange(200) + 0.5) / 200
    return [replay(plant, policy, np.array([place, 0.0]), steps).states for place in places]


@pytest.mark.parametrize("reward", [-1.0, 1.0])
@pytest.mark.parametrize("tree", [LEFT, SWITCH, SWING, RIGHT])
def test_the_mean_return_is_between_its_bounds_where_episodes_end_in_a_pit(walk, tree, reward):
    plant = walk(LIMIT, reward=reward, pit=-1.0)
    policy = policy_of(tree, NAME)
    checked(plant)
    mean = reward * np.mean([len(path) - 1 for path in paths(plant, policy, LIMIT)])
    for question in ("arrives", "returns at least 0"):
        low, high = prove(policy, plant, question).bounds["mean_return"]
        assert low <= mean <= high


@pytest.mark.parametrize(("reward", "least"), [(1.0, 90), (-1.0, -50)])
def test_an_episode_that_ends_in_a_pit_is_not_believed_to_last(walk, reward, least):
    """It returned 100, or -100, "proven" and "refuted", where it ends after two steps."""
    plant = walk(LIMIT, reward=reward, pit=-1.0)
    found = prove(policy_of(LEFT, NAME), plant, f"returns at least {least}")
    assert found.verdict == "undecided"
    bounds = sorted((reward, reward * LIMIT))
    assert found.bounds["mean_return"] == pytest.approx(bounds, abs=1e-5)


def test_an_episode_that_moves_at_its_last_step_has_lasted_to_its_limit(walk):
    plant = walk(LIMIT, pit=-1.0)
    found = prove(policy_of(SWING, NAME), plant, "returns at least -100.1")
    assert found.proven
    assert found.bounds["mean_return"] == pytest.approx((-LIMIT, -LIMIT), abs=1e-5)


@pytest.mark.parametrize("goal", [1.9, 1.6, 1.4, 1.1])
def test_starts_that_arrive_before_a_property_breaks_are_not_counted_as_failing(walk, goal):
    """All starts were, or the plant was said not to move as the environment does."""
    plant = walk(goal=goal)
    policy = policy_of(RIGHT, NAME)
    checked(plant)
    found = prove(policy, plant, "stays in clock <= 1.5 for 2 steps")
    breaks = [bool((path[:, 1] > 1.5).any()) for path in paths(plant, policy, 2)]
    assert found.verdict == "refuted"
    assert found.sentence.endswith(f": not from {100 * np.mean(breaks):.3g} % of all starts")
    assert found.counterexample["place"] + 1 < goal
    assert found.undecided < 1e-6


def test_a_property_that_breaks_only_after_every_arrival_holds(walk):
    plant = walk(goal=1.5)
    policy = policy_of(RIGHT, NAME)
    assert prove(policy, plant, "stays in clock <= 2.5 for 9 steps").proven
    assert prove(policy, plant, "stays in clock <= 1.5 for 9 steps").verdict == "refuted"


@pytest.mark.parametrize("since", [1, 3])
def test_masks_that_are_said_only_after_some_steps_are_found(walk, since):
    plant = walk(masked_from=since)
    policy = policy_of(RIGHT, NAME)
    asked = "stays in place >= 0 for 5 steps" if since == 1 else "stays in place <= 2 for 5 steps"
    for ask in (
        lambda: checked(plant),
        lambda: prove(policy, plant, asked),
        lambda: replay(plant, policy, np.array([0.5, 0.0]), 5),
    ):
        with pytest.raises(InvalidArgumentError, match="all actions must be allowed everywhere"):
            ask()


def test_starts_with_no_double_between_them_are_not_cut(walk):
    """The same piece was cut again and again, and a part of the starts left open."""
    low = 1.7e9
    plant = walk(starts=(low, low + 1e-4), goal=np.inf)
    tree = (0, low + 0.3e-4, 0, 1)
    found = prove(policy_of(tree, NAME), plant, f"stays in place <= {low + 20:.0f} for 5 steps")
    assert found.proven
    assert found.work["pieces"] < 1000


def test_a_number_too_narrow_to_be_cut_leaves_the_other_to_be(walk):
    low = 1.7e9
    plant = walk(starts=(low, np.nextafter(low, np.inf)), goal=np.inf)
    plant.start = (plant.start[0], (0.0, 1.0))
    policy = policy_of((1, 0.3, 0, 1), NAME)
    found = prove(policy, plant, f"stays in place <= {low + 0.5} for 1 steps")
    assert found.sentence.endswith(": not from 70 % of all starts")


TURNS = (1, 1.5, 0, 1)  # two steps to the left, then to the right


@pytest.mark.parametrize("kind", [WalkPlant, FallingPlant])
def test_what_would_arrive_after_it_has_failed_does_not_arrive(walk, kind):
    plant = kind(walk(LIMIT, pit=-1.5, goal=3.0)._kind, LIMIT)
    policy = policy_of(TURNS, NAME)
    checked(plant)
    found = prove(policy, plant, "arrives")
    assert found.verdict == "refuted"
    assert ": not from 50 % of all starts" in found.sentence
    assert (found.starts.low[0, 0], found.starts.high[0, 0]) == pytest.approx((0.0, 0.5), abs=1e-6)
    low, high = found.bounds["mean_return"]
    assert low <= -np.mean([len(path) - 1 for path in paths(plant, policy, LIMIT)]) <= high


@pytest.mark.parametrize("kind", [WalkPlant, FallingPlant])
def test_what_breaks_only_after_it_has_failed_is_kept(walk, kind):
    plant = kind(walk(pit=-1.5)._kind, None)
    policy = policy_of(LEFT, NAME)
    found = prove(policy, plant, "stays in place >= -1.8 for 9 steps")
    breaks = [bool((path[:, 0] < -1.8).any()) for path in paths(plant, policy, 9)]
    assert found.sentence.endswith(f": not from {100 * np.mean(breaks):.3g} % of all starts")
    assert prove(policy, plant, "stays in place >= -2.6 for 9 steps").undecided < 1e-6


@pytest.mark.parametrize("named", [{}, {"axes": ((1.0, 0.0), (0.0, 1.0)), "cells": (0.1, 0.1)}])
def test_an_end_that_a_plant_without_a_goal_does_not_know_is_found(walk, named):
    """Only plants with a goal of their own were asked, and shares of others were false."""
    known = walk(pit=-1.5, goal=np.inf)
    kind = type("Own", (FallingPlant,), {"arrives": Plant.arrives, "fails": Plant.fails, **named})
    with pytest.raises(
        InvalidArgumentError, match=r"ends in .*, which has not arrived and which a"
    ):
        checked(kind(known._kind, None))
    plant = type("Own", (kind,), {"fails": FallingPlant.fails})(known._kind, None)
    checked(plant)
    policy = policy_of((0, 50.0, 0, 1), NAME)
    assert prove(policy, plant, "stays in place >= -2.7 for 9 steps").proven
    assert prove(policy, plant, "stays in place >= -2.3 for 9 steps").verdict == "refuted"


def test_an_end_where_the_environment_goes_on_is_found(walk):
    plant = FallingPlant(type("Own", (walk()._kind,), {"pit": -1.5}), None)
    with pytest.raises(InvalidArgumentError, match=r"over in .*, where the environment goes on"):
        checked(plant)


def test_a_share_is_a_bound_where_other_starts_are_open(walk):
    plant, policy = walk(pit=-1.5), policy_of(LEFT, NAME)
    found = prove(policy, plant, "stays in place >= -1.8 for 9 steps", effort=Effort(smallest=0.2))
    assert found.verdict == "refuted"
    assert found.sentence.endswith(" % of all starts at least")
    share = float(found.sentence.split("not from ")[1].split(" %")[0]) / 100
    assert share < 0.7 < share + found.undecided
