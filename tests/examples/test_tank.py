"""The example of a valve: its contract, its water, a tree of five openings that holds the level."""

import runpy
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from examples.tank import AREA, EPISODE_STEPS, GRID, STEP, RuleOfThumb, Tank, with_any_opening
from gymnasium.utils.env_checker import check_env

import eutree
from eutree.distillation import DistillationSettings
from eutree.interaction import GriddedAction


@pytest.mark.filterwarnings("ignore:.*render:UserWarning", "ignore:.*WARN.*:UserWarning")
def test_it_keeps_gymnasiums_contract():
    check_env(Tank(), skip_render_check=True)


def test_a_shut_valve_keeps_what_runs_in():
    env = Tank()
    before, _ = env.reset(seed=1)
    after, *_ = env.step([0.0])
    assert after[1] - before[1] == pytest.approx(before[2] / 1000 * STEP / AREA)
    assert env.step([100.0])[0][1] < after[1]


def test_five_openings_hold_the_level_and_a_small_tree_does_so_too():
    env = GriddedAction(gymnasium.make("ValveTank-v0"), GRID)
    rule = RuleOfThumb(env)
    settings = DistillationSettings(max_leaves=16, iterations=5, episodes=6, validation_episodes=20)
    tree, _ = eutree.distill(rule, env, settings, seed=0)
    held, ruled = (eutree.evaluate(p, env, episodes=60, seed=2) for p in (tree, rule))
    always = eutree.TreePolicy(eutree.DecisionTree.single_leaf(3), np.array([2]), tree.schema)
    left = eutree.evaluate(always, env, episodes=60, seed=2)
    assert tree.n_leaves <= 16
    assert ruled.success_rate == 1.0
    assert held.success_rate > 0.8 > 0.5 > left.success_rate
    assert with_any_opening(60, 2) > ruled.mean_return  # what the grid costs
    assert {value for (value,) in tree.schema.action_values} == set(GRID["valve [%]"])


def test_the_program_prints_and_writes(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("eutree.distill", short(eutree.distill))
    monkeypatch.setattr(sys, "argv", ["tank.py", "--out", str(tmp_path / "valve.c")])
    monkeypatch.delitem(gymnasium.registry, "ValveTank-v0")
    runpy.run_path("examples/tank.py", run_name="__main__")
    printed = capsys.readouterr().out
    assert "rule, five openings: 200 episodes: success 100.0%" in printed
    assert "valve 25 %" in printed
    assert "double decide_valve(const double *observation)" in (tmp_path / "valve.c").read_text()
    assert EPISODE_STEPS == 100


def short(distill):
    fewer = {"iterations": 2, "episodes": 3, "validation_episodes": 4}
    return lambda teacher, env, settings, **options: distill(
        teacher, env, replace(settings, **fewer), **options
    )
