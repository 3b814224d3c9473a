"""Every registered id keeps Gymnasium's contract."""

import os
import subprocess
import sys
import warnings

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env

import eutree  # noqa: F401 - registers
from eutree.envs.registration import IDS, register


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("observe_direction", [False, True])
def test_check_env_has_nothing_to_say(name: str, observe_direction: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(name, observe_direction=observe_direction)
        check_env(env.unwrapped)


@pytest.mark.parametrize(
    ("name", "count"), [("Evasion-v0", 2), ("Evasion2-v0", 2), ("Evasion3-v0", 3)]
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
