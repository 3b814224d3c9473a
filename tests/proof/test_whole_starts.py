"""Starts that are whole numbers: what holds from all numbers holds, of shares nothing is known."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from eutree.cli.main import run
from eutree.proof import (
    Effort,
    NeedsEpisodesError,
    Plant,
    check_plant,
    maximum,
    prove,
    register_plant,
    replay,
)
from eutree.schema import EnvironmentSpec
from tests.proof.policies import policy_of

NAME = "Ladder-v0"
DOWN, UP = 0, 1
FEW = Effort(box_steps=100_000)
SPLIT = (0, 2.2, UP, (0, 2.8, DOWN, UP))  # it goes down between two whole numbers alone


class Ladder(gymnasium.Env[Any, Any]):
    """Rungs from 0 to 9: up are two of them at once, and down is one."""

    metadata: ClassVar = {"render_modes": []}
    feature_names = ("rung",)
    action_space = gymnasium.spaces.Discrete(2)
    observation_space = gymnasium.spaces.Box(0, 20, (1,), np.int64)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = self.np_random.integers(0, 6, 1).astype(np.float64)
        return self.state.astype(np.int64), {}

    def step(self, action: int) -> Any:
        self.state = np.maximum(self.state + (3 * action - 1), 0)
        return self.state.astype(np.int64), -1.0, bool(self.state[0] >= 9), False, {}


class LadderPlant(Plant):
    """The ladder on intervals."""

    state = ("rung",)
    start = ((0.0, 5.0),)
    limit, reward = 50, -1.0

    def __init__(self, environment: EnvironmentSpec | None = None) -> None:
        self.environment = environment or EnvironmentSpec(NAME)

    def step(self, state: Any, action: Any) -> Any:
        return [maximum(state[0] + (3 * action - 1), 0.0)]

    def arrives(self, state: Any) -> Any:
        return state[0] >= 9


@pytest.fixture(autouse=True)
def ladder(monkeypatch):
    monkeypatch.setitem(gymnasium.registry, NAME, EnvSpec(NAME, Ladder, max_episode_steps=50))
    monkeypatch.setattr("eutree.proof.plant.PLANTS", {})
    check_plant(LadderPlant(), episodes=5, generator=np.random.default_rng(0))


def steps_of(policy):
    """Return the steps of the real episode from each rung, and its highest one."""
    paths = [replay(LadderPlant(), policy, np.array([rung]), 50).states for rung in range(6)]
    return [len(path) - 1 for path in paths], [path.max() for path in paths]


@pytest.mark.parametrize("tree", [UP, SPLIT])
def test_nothing_is_said_of_the_mean_over_whole_starts(tree):
    """From all numbers it is -3.8, and that was said; from whole ones it is -3.5."""
    policy = policy_of(tree, NAME)
    found = prove(policy, LadderPlant(), "arrives")
    steps, _ = steps_of(policy)
    assert np.mean(steps) == 3.5
    assert found.proven
    assert set(found.bounds) == {"steps"}
    assert found.bounds["steps"][0] <= min(steps) <= max(steps) <= found.bounds["steps"][1]
    assert found.worst_start is None or found.worst_start["rung"] == 0.0
    with pytest.raises(
        NeedsEpisodesError, match="Ladder-v0 says nothing of starts at whole numbers"
    ):
        prove(policy, LadderPlant(), "returns at least -3.6")


def test_what_fails_between_whole_starts_alone_is_open_and_accuses_no_plant():
    policy = policy_of(SPLIT, NAME)
    assert max(steps_of(policy)[0]) == 5
    found = prove(policy, LadderPlant(), "arrives within 5 steps")
    assert found.verdict == "undecided"
    assert found.sentence.endswith("arrives within 5 steps is open")
    assert (found.undecided, found.starts) == (1.0, None)


@pytest.mark.parametrize("named", [{}, {"axes": ((1.0,),), "cells": (0.01,)}])
def test_a_counterexample_begins_at_a_whole_number(named):
    policy, plant = policy_of((0, 3.5, UP, UP), NAME), type("Own", (LadderPlant,), named)()
    found = prove(policy, plant, "stays in rung <= 9.5 for 5 steps", effort=FEW)
    assert found.verdict == "refuted"
    assert " % " not in found.sentence
    rung = found.counterexample["rung"]
    assert rung in range(6)
    assert steps_of(policy)[1][int(rung)] > 9.5
    assert prove(policy, plant, "stays in rung <= 11.5 for 5 steps", effort=FEW).proven


def test_where_the_proof_says_nothing_episodes_do(tmp_path, capsys):
    register_plant(NAME, LadderPlant)
    policy_of(UP, NAME).save(tmp_path / "up.json")
    line = ["prove", str(tmp_path / "up.json"), "returns at least -3.9", "--range", "-50", "0"]
    assert run([*line, "--episodes", "3000"]) in (0, 3)
    assert "(statistical)" in capsys.readouterr().out
