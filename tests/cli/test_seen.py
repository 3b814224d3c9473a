"""An environment in which a person is to record has to draw itself."""

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete


class Bare(gymnasium.Env):
    """As short as it can be: no constructor, no metadata, no picture."""

    observation_space, action_space = Box(0.0, 1.0, (1,)), Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), 0.0, False, False, {}


class Texts(Bare):
    """Draws texts alone."""

    metadata = {"render_modes": ["human", "ansi"]}  # noqa: RUF012 - as its base has it

    def __init__(self, render_mode=None):
        self.render_mode = render_mode


class Unsaid(Texts):
    """Takes any mode, and says of none that it knows it."""

    metadata = {"render_modes": []}  # noqa: RUF012 - as its base has it


@pytest.fixture
def unseen(request):
    gymnasium.register("Unseen-v0", request.param, max_episode_steps=5)
    yield
    gymnasium.registry.pop("Unseen-v0")


@pytest.mark.parametrize("unseen", [Bare, Texts, Unsaid], indirect=True)
@pytest.mark.parametrize("line", [["record", "Unseen-v0", "--out"], ["study", "lead"]])
def test_what_draws_nothing_is_refused_before_anything_is_there(eutree, unseen, line, tmp_path):
    line = [*line, "place", *(["Unseen-v0"] if "lead" in line else [])]
    answer = eutree(*line)
    assert answer.code == 2
    words = "error: Unseen-v0 must draw what a person sees: its metadata['render_modes'] must hold "
    assert answer.err.startswith(words)
    assert answer.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("unseen", [Bare], indirect=True)
def test_an_expert_needs_no_picture(eutree, unseen, tmp_path):
    (tmp_path / "rests.py").write_text("def rests(observation):\n    return 0\n")
    line = ("record", "Unseen-v0", "--expert", "rests.py:rests", "--episodes", 1, "--out", "demos")
    assert eutree(*line).code == 0
