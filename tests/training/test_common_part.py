"""Sizes that go on from what they have in common become what runs of their own become."""

from dataclasses import replace
from pathlib import Path

import gymnasium
import pytest
from benchmarks import table
from benchmarks.common_part import fitted_once
from benchmarks.table import Cell, Learning, Settings

from eutree.world_model.ensemble import EnsembleSettings

TEACHING = Settings.of("Acrobot-v1")  # its teacher goes on learning from its trees' episodes
LITTLE = EnsembleSettings(members=2, hidden=8, batch=32, updates=20, more_updates=5)
SETTINGS = {
    "CartPole-v1": replace(
        TEACHING,
        method=replace(TEACHING.method, world_model=LITTLE),
        expert=table.script_of("CartPole-v1", "fall"),
        demonstrations=5,
    ),
    "MountainCar-v0": replace(Settings.of("MountainCar-v0"), demonstrations=5),
}


@pytest.mark.parametrize("task", SETTINGS)
def test_a_size_is_as_a_run_of_its_own(task: str, tmp_path: Path) -> None:
    cell, env = Cell("eutree", task, steps=3_000, leaves=6, seed=1), gymnasium.make(task)
    alone, used_alone = Learning(cell, env, SETTINGS[task]).result()
    learning = Learning(cell, env, SETTINGS[task], tmp_path)
    assert learning.common_seconds() > 0.0
    for again in (False, True):  # what was fitted before is known the second time
        with fitted_once(tmp_path) as spared:
            tree, used = learning.result()
        assert (tree.to_bytes(), used) == (alone.to_bytes(), used_alone)
        assert bool(spared) == (again and task == "CartPole-v1")
    assert len(list(tmp_path.glob("*.npz"))) == 1, "learned once"
