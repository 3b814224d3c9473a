"""What an environment does to the process while a command runs, and how a run goes on."""

import os
from pathlib import Path

import gymnasium
import pytest

from tests.interaction.sick import Healthy, WordlessError

LEARN = ("learn", "Strange-v0", "--method", "paper", "--evaluation-episodes", 2, "--episodes", 6,
         "--checkpoint-seconds", 999)  # fmt: skip


@pytest.fixture
def strange():
    """Register an environment under one name for a test."""
    yield lambda kind: gymnasium.register("Strange-v0", kind, max_episode_steps=50)
    gymnasium.registry.pop("Strange-v0")


class Wanders(Healthy):
    """Goes to another folder when it is made, reset, or in a step, and reads there."""

    there, moment = "", ""

    def __init__(self):
        self.go("made")

    def reset(self, *, seed=None, options=None):
        self.go("reset")
        return super().reset(seed=seed)

    def step(self, action):
        if self.moment != "step" or self.count:
            assert Path("here").read_text() == "there"
        self.go("step")
        return super().step(action)

    def go(self, moment):
        if moment == self.moment:
            os.chdir(self.there)


@pytest.mark.parametrize("moment", ["made", "reset", "step"])
def test_relative_paths_stay_where_the_command_began(eutree, strange, tmp_path, moment):
    """``os.chdir`` in ``reset`` lost the whole run."""
    elsewhere = tmp_path / "else"
    elsewhere.mkdir()
    (elsewhere / "here").write_text("there")
    (tmp_path / "here").write_text("there")
    strange(type("There", (Wanders,), {"there": str(elsewhere), "moment": moment}))
    answer = eutree(*LEARN, "--out", "run")
    assert answer.code == 0, answer.err
    assert (tmp_path / "run" / "policy.json").exists()
    assert eutree("evaluate", "run", "--episodes", 3).code == 0
    assert eutree("show", "run", "--html", "page.html").code == 0
    assert (tmp_path / "page.html").exists()
    assert sorted(path.name for path in elsewhere.iterdir()) == ["here"]


def failing(error, *, moment, episode):
    """Return an environment that raises at the reset, or at step 2, of an episode."""

    class Fails(Healthy):
        episodes = 0

        def reset(self, *, seed=None, options=None):
            self.episodes += 1
            if moment == "reset" and self.episodes == episode:
                raise error
            return super().reset(seed=seed)

        def step(self, action):
            if moment == "step" and self.episodes == episode and self.count == 2:
                raise error
            return super().step(action)

    return Fails


@pytest.mark.parametrize("moment", ["reset", "step"])
@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (WordlessError(), 2, "raised WordlessError"),
        (GeneratorExit(), 2, "raised GeneratorExit"),
        (KeyboardInterrupt(), 130, "stopped and saved"),
    ],
)
def test_whatever_an_environment_raises_costs_one_episode(
    eutree, strange, tmp_path, error, code, says, moment
):
    strange(failing(error, moment=moment, episode=6))  # two were evaluated, three learned from
    answer = eutree(*LEARN, "--out", "run")
    assert answer.code == code
    assert says in answer.err
    assert "Traceback" not in answer.err
    gymnasium.registry.pop("Strange-v0")
    strange(Healthy)
    resumed = eutree(*LEARN, "--out", "run", "--resume")
    whole = eutree(*LEARN, "--out", "whole")
    assert resumed.code == whole.code == 0
    for name in ("policy.json", "curve.csv"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    lines = (tmp_path / "run" / "progress.csv").read_text().splitlines()
    assert len(lines) >= 2
