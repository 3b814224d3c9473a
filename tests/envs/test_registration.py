"""Every registered id keeps Gymnasium's contract."""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env

import eutree  # noqa: F401 - registers
from eutree.envs import IDS, experts, register
from tests.patience import ENOUGH

SOURCE = str(Path(__file__).parents[2] / "src")


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("observe_direction", [False, True])
def test_check_env_has_nothing_to_say(name: str, observe_direction: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(name, observe_direction=observe_direction)
        check_env(env.unwrapped)


@pytest.mark.parametrize(
    ("name", "count"),
    [("Evasion-v0", 2), ("Evasion2-v0", 2), ("Evasion3-v0", 3), ("Evasion4-v0", 4)],
)
def test_ids_have_their_number_of_opponents(name: str, count: int) -> None:
    assert gymnasium.make(f"eutree/{name}").observation_space.shape == (count + 1,)


def test_general_id_takes_any_number_of_opponents() -> None:
    for count in (1, 4, 10):
        env = gymnasium.make("eutree/Evasion-v0", n_opponents=count)
        assert env.observation_space.shape == (count + 1,)


def test_registering_twice_changes_nothing() -> None:
    before = dict(gymnasium.registry)
    register()
    assert dict(gymnasium.registry) == before


def test_spec_survives_its_json() -> None:
    env = gymnasium.make("eutree/Evasion3-v0", noise=0.05, crossings=(5.0, 15.0, 25.0))
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.parameters == env.unwrapped.parameters


def test_module_prefix_imports_and_registers_cheaply() -> None:
    program = (
        "import sys, gymnasium\n"
        "env = gymnasium.make('eutree:eutree/Evasion2-v0')\n"
        "env.reset(seed=0); env.step(1)\n"
        "assert 'numba' not in sys.modules and 'pygame' not in sys.modules\n"
    )
    subprocess.run(
        [sys.executable, "-c", program], check=True, env=os.environ | {"PYTHONPATH": "src"}
    )


STRANGER = """
import gymnasium
import numpy as np


class Line(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(0.0, 9.0, (1,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)
    max_steps = 9

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = 0.0
        return np.array([self.place]), {}

    def step(self, action):
        self.place += action
        return np.array([self.place]), float(action), self.place >= 3.0, False, {}


def register():
    gymnasium.register(id="stranger/Line-v0", entry_point=Line)


class Go:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.ones(np.shape(observation)[:-1], int), state


EXPERTS = {"stranger/Line-v0": {"go": lambda env: Go()}}
"""


def installed(folder: Path, entry_points: str) -> dict[str, str]:
    """Return the variables under which a distribution of that metadata is found."""
    (folder / "stranger.py").write_text(STRANGER)
    metadata = folder / "stranger-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(entry_points)
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")]), SOURCE])
    return {**os.environ, "PYTHONPATH": path}


def test_a_stranger_adds_an_environment_and_its_demonstrator(tmp_path: Path) -> None:
    points = (
        "[eutree.environments]\nline = stranger:register\n[eutree.experts]\nx = stranger:EXPERTS\n"
    )
    line = ["record", "stranger/Line-v0", "--expert", "go", "--episodes", "2", "--out", "demos"]
    done = subprocess.run(
        [sys.executable, "-m", "eutree", *line],
        cwd=tmp_path, env=installed(tmp_path, points), capture_output=True, text=True,
        timeout=ENOUGH,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "demos" / "demonstrations.json").exists()


def test_a_stranger_that_cannot_be_imported_is_named_and_stops_nobody(tmp_path: Path) -> None:
    """One broken distribution took the demonstrators of all others away."""
    (tmp_path / "leaving.py").write_text("raise SystemExit(3)\n")
    points = (
        "[eutree.environments]\nline = stranger:nothing\nquits = leaving:register\n"
        "[eutree.experts]\na = nowhere:X\nb = json:loads\nc = leaving:X\nd = stranger:EXPERTS\n"
    )
    code = (
        "import warnings\n"
        "with warnings.catch_warnings(record=True) as said:\n"
        "    warnings.simplefilter('always')\n"
        "    import eutree\n"
        "    from eutree.envs.experts import experts_for\n"
        "    assert list(experts_for('stranger/Line-v0')) == ['go']\n"
        "print(*(one.message for one in said), sep='\\n')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=installed(tmp_path, points), capture_output=True, text=True, check=True, timeout=ENOUGH,
    )  # fmt: skip
    begin = [line.partition(" cannot ")[0] for line in done.stdout.splitlines()]
    assert begin == [
        "environments 'line', stranger:nothing,", "environments 'quits', leaving:register,",
        "experts 'a', nowhere:X,", "experts 'b', json:loads,", "experts 'c', leaving:X,",
    ]  # fmt: skip


def test_a_stranger_adds_a_demonstrator_to_an_environment_that_has_some(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "more.py").write_text("EXPERTS = {'CartPole-v1': {'lean': len, 'fall': len}}\n")
    metadata = tmp_path / "more-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: more\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[eutree.experts]\nmore = more:EXPERTS\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    known = experts.experts_for("CartPole-v1")
    assert list(known) == ["fall", "balance", "lean"]
    assert known["fall"] is experts.follow_the_fall, "ours stay ours"
