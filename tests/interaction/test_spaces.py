"""Any flat space becomes a vector of named numbers."""

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from eutree.interaction.spaces import describe, encoder, spec_of
from tests.interaction.sick import Healthy

SPACES = {
    "box": (spaces.Box(-1, 1, (2,), np.float32), ["x0", "x1"], [-1, -1], [1, 1]),
    "discrete": (spaces.Discrete(4, start=2), ["x0"], [2], [5]),
    "several discrete": (spaces.MultiDiscrete([3, 2]), ["x0", "x1"], [0, 0], [2, 1]),
    "bits": (spaces.MultiBinary(2), ["x0", "x1"], [0, 0], [1, 1]),
    "tuple": (
        spaces.Tuple([spaces.Discrete(3), spaces.Box(0, 1, (2,))]),
        ["0", "1.x0", "1.x1"],
        [0, 0, 0],
        [2, 1, 1],
    ),
    "dict": (
        spaces.Dict({"speed": spaces.Box(0, 9, (1,)), "at": spaces.MultiBinary(2)}),
        ["at.x0", "at.x1", "speed"],
        [0, 0, 0],
        [1, 1, 9],
    ),
}


@pytest.mark.parametrize("name", SPACES)
def test_names_bounds_and_encoding(name):
    space, names, low, high = SPACES[name]

    class Of(Healthy):
        observation_space = space

    schema = describe(Of())
    assert list(schema.feature_names) == names
    assert [f.low for f in schema.features] == low
    assert [f.high for f in schema.features] == high
    space.seed(3)
    for _ in range(20):
        sample = space.sample()
        vector = encoder(space)(sample)
        assert vector.dtype == np.float64
        assert vector.shape == (len(names),)
        assert (np.array(low) <= vector).all()
        assert (vector <= np.array(high)).all()


def test_gymnasium_s_own_tasks_have_names():
    schema = describe(gymnasium.make("CartPole-v1"))
    assert schema.feature_names == ("position", "velocity", "angle", "turn rate")
    assert schema.actions == ("left", "right")


def test_the_spec_makes_the_environment_again():
    env = gymnasium.make("CartPole-v1", sutton_barto_reward=True, render_mode="rgb_array")
    spec = spec_of(env)
    assert spec is not None
    assert (spec.id, dict(spec.arguments)) == ("CartPole-v1", {"sutton_barto_reward": True})
    assert spec_of(Healthy()) is None
