"""The method ``distilled-dqn`` in a run: budget, common starts, going on, the limit of leaves."""

import json

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli._learning import progress_of
from eutree.envs.experts import follow_the_fall
from eutree.learners import DistilledDQN
from eutree.neural import DoubleDQNSettings
from eutree.world_model.ensemble import EnsembleSettings

BUDGET = 6000
METHOD = DistilledDQN(
    demonstration_updates=50,
    teacher=DoubleDQNSettings(hidden=16, batch=16),
    world_model=EnsembleSettings(members=2, hidden=16, batch=32, updates=100, more_updates=50),
)


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("CartPole-v1")


@pytest.fixture(scope="module")
def shown(env):
    return eutree.record(env, follow_the_fall, episodes=5, seed=0)


def learned(env, shown, **arguments):
    usual = {"max_leaves": 4, "evaluate_every": 10**6, "evaluation_episodes": 2, "seed": 3}
    return eutree.learn(
        env, demonstrations=shown, method=METHOD, steps=BUDGET, **{**usual, **arguments}
    )


@pytest.fixture(scope="module")
def whole(env, shown, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    return learned(env, shown, out=folder), folder


def races(folder):
    lines = (folder / "events.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if "race" in event]


def test_the_budget_and_the_limit_of_leaves_are_kept(whole):
    result, _ = whole
    assert BUDGET - 500 < result.steps <= BUDGET
    assert result.policy.n_leaves <= 4
    assert result.method.max_leaves == 4


def test_rivals_run_from_common_starts(whole):
    """Heats of one race and number begin at the same observation, others do not."""
    result, folder = whole
    history = result.history
    first = history.observations[np.searchsorted(history.episodes, np.arange(history.n_episodes))]
    starts = {}
    for event in races(folder):
        episode = 5 + event["episode"] - 1  # after the five demonstrations
        starts.setdefault((event["race"], event["start"]), []).append(tuple(first[episode]))
    assert max(map(len, starts.values())) > 1
    assert all(len(set(same)) == 1 for same in starts.values())
    assert len({same[0] for same in starts.values()}) == len(starts)


def test_the_log_tells_of_every_stage(whole):
    _, folder = whole
    lines = (folder / "events.jsonl").read_text().splitlines()
    stages = {json.loads(line).get("stage") for line in lines}
    assert {"teacher", "dagger", "race"} <= stages
    assert any("rivals" in json.loads(line) for line in lines)


def test_an_interrupted_run_goes_on_to_the_same_bytes(whole, env, shown, tmp_path):
    asked = 0

    def stop():
        nonlocal asked
        asked += 1
        return asked % 1900 == 0

    for attempt in range(40):
        learned(env, shown, out=tmp_path / "run", resume=attempt > 0, stop=stop)
        if asked % 1900:
            break
    assert attempt > 1
    _, folder = whole
    for name in ("policy.json", "events.jsonl"):
        assert (tmp_path / "run" / name).read_bytes() == (folder / name).read_bytes()


def test_the_command_line_shows_the_stage(env, shown):
    labels = []
    learned(env, shown, on_progress=lambda run: labels.append(progress_of(run)))
    names = [name for name, _, _ in labels]
    assert (
        list(dict.fromkeys(names)) == ["teacher", "dagger", "race", "last race"][: len(set(names))]
    )
    assert {"teacher", "dagger", "race"} <= set(names)
    used = [steps for _, steps, _ in labels]
    assert used == sorted(used)
    assert {total for _, _, total in labels} == {BUDGET}
