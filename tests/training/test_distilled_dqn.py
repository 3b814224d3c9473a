"""The method ``distilled-dqn`` in a run: budget, common starts, going on, the limit of leaves."""

import importlib
import json
from dataclasses import replace
from html import escape

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli._learning import as_values, in_words, progress_of
from eutree.cli.main import run
from eutree.distillation import DistillationSettings
from eutree.envs.experts import follow_the_fall
from eutree.errors import InvalidArgumentError, RunFolderError
from eutree.learners import DistilledDQN
from eutree.neural import DoubleDQNSettings
from eutree.report import report_of_run, run_page
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
def short():
    """So that there are many episodes."""
    return gymnasium.make("CartPole-v1", max_episode_steps=100)


@pytest.fixture(scope="module")
def longer():
    """In which the tree that the demonstrations make does not reach the end."""
    return gymnasium.make("CartPole-v1", max_episode_steps=250)


@pytest.fixture(scope="module")
def shown(env):
    return eutree.record(env, follow_the_fall, episodes=5, seed=0)


def learned(env, shown, **arguments):
    usual = {"max_leaves": 4, "evaluate_every": 10**6, "evaluation_episodes": 2, "seed": 3,
             "steps": BUDGET, "method": METHOD}  # fmt: skip
    return eutree.learn(env, demonstrations=shown, **{**usual, **arguments})


@pytest.fixture(scope="module")
def told():
    """Return the progress that the whole run has told of."""
    return []


@pytest.fixture(scope="module")
def whole(env, shown, told, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    return learned(
        env, shown, out=folder, on_progress=lambda run: told.append(progress_of(run))
    ), folder


def events_of(folder):
    return [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]


def races(folder):
    return [event for event in events_of(folder) if "race" in event]


def test_the_budget_and_the_limit_of_leaves_are_kept(whole):
    result, _ = whole
    assert BUDGET - 500 < result.steps <= BUDGET
    assert result.policy.n_leaves <= 4
    assert result.method.max_leaves == 4


def test_challengers_run_from_common_starts(whole):
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


def test_the_run_says_whether_its_model_can_be_trusted(short, shown, tmp_path):
    folder = tmp_path / "run"
    model = replace(METHOD.world_model, updates=1500)
    result = learned(
        short, shown, out=folder, method=replace(METHOD, world_model=model), max_leaves=2
    )
    trust = result.model_trust
    compared = [event for event in races(folder) if "imagined" in event]
    assert compared[-1]["rank_correlation"] == trust.correlation.value
    assert compared[-1]["imagined"] == trust.imagined.tolist()
    assert compared[-1]["real"] == pytest.approx(trust.real.tolist())
    assert trust.describe() in in_words(result, folder, recorded=None)
    assert as_values(result, folder)["model_trust"]["trees_compared"] == trust.correlation.n
    page = run_page(report_of_run(folder))
    assert escape(trust.describe()[1:]) in page
    assert page.count('class="point"') == len(trust.real)
    assert "return of the teacher" in page.lower()


def test_the_teacher_can_be_distilled_again(whole, env):
    result, _ = whole
    settings = DistillationSettings(
        method="viper", max_leaves=4, iterations=1, validation_episodes=2
    )
    tree, told = eutree.distill(result.teacher, env, settings)
    assert told.weighted
    assert tree.n_leaves <= 4


class Pushes:
    """Pushes towards the side that the pole falls to; asked as SB3 asks."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        assert observation.dtype == np.float32  # the environment's own observation
        return np.int64(observation[2] + 0.5 * observation[3] > 0), None


def test_a_teacher_of_ones_own_is_declared_and_reported_apart(env, shown, tmp_path):
    teacher = eutree.Teacher(Pushes(), steps=123_000)
    usual = {"judge_episodes": 0, "out": tmp_path / "run"}  # a contest at the end comes on top
    result = learned(env, shown, teacher=teacher, **usual)
    counts = result.environment_steps
    assert counts.declared == 123_000
    own = counts.teacher + counts.learning
    assert counts.total == counts.demonstrations + own <= 6000 + shown.n_transitions
    assert "123000 steps, as declared" in in_words(result, tmp_path, recorded=None)
    rows = result.history.observations
    assert (result.teacher.predict(rows)[0] == (rows[:, 2] + 0.5 * rows[:, 3] > 0)).all()
    other = eutree.Teacher(Pushes(), steps=5)
    with pytest.raises(RunFolderError, match="was started with teacher 'Pushes, 123000 steps'"):
        learned(env, shown, teacher=other, resume=True, **usual)


WITH_SUMS = {
    "method": replace(METHOD, sums=2, teacher_share=0.2, dagger_share=0.25), "max_leaves": 2,
    "steps": 15_000, "race_steps": 1000, "seed": 5, "judge_episodes": 60, "front_steps": 40_000,
    "teacher": eutree.Teacher(Pushes(), steps=0),
}  # fmt: skip


@pytest.fixture(scope="module")
def with_sums(longer, shown, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sums")
    return learned(longer, shown, out=folder, **WITH_SUMS), folder


def test_trees_may_ask_for_the_sum_that_their_teacher_decides_by(with_sums, env):
    policy = with_sums[0].policy
    first = policy.schema.derived[0]
    assert (first.name, first.formula) == ("sum 1", 'angle + 0.5 * "turn rate"')
    assert policy.n_leaves == 2
    assert policy.tree.feature[0] >= 4  # a sum
    assert eutree.evaluate(policy, env, episodes=5, seed=1).mean_return == 500.0


def test_a_run_with_sums_goes_on_to_the_same_bytes(with_sums, longer, shown, tmp_path):
    asked = 0

    def stop():
        nonlocal asked
        asked += 1
        return asked % 3000 == 0

    for attempt in range(40):
        learned(longer, shown, out=tmp_path / "run", resume=attempt > 0, stop=stop, **WITH_SUMS)
        if asked % 3000:
            break
    assert attempt > 1
    for name in ("policy.json", "events.jsonl"):
        assert (tmp_path / "run" / name).read_bytes() == (with_sums[1] / name).read_bytes()


def test_what_asks_for_sums_can_be_worked_with(with_sums, tmp_path, capsys):
    """Run folders keep what was measured: who reads them derives what the tree asks for."""
    folder, small = str(with_sums[1]), str(tmp_path / "small.json")
    policy = f"{folder}/policy.json"
    assert run(["export", policy, "--format", "c", "--out", str(tmp_path / "policy.c")]) == 0
    assert run(["show", policy]) == 0
    assert "where sum 1 = " in capsys.readouterr().out
    assert run(["compress", folder, "--max-leaves", "2", "--episodes", "20", "--out", small]) == 0
    assert eutree.TreePolicy.load(small).schema.derived
    assert run(["verify", policy, "--property", "no dead leaves", "--run", folder]) < 2
    assert "rror" not in capsys.readouterr().err


def test_sums_need_the_present_alone(env, shown):
    with pytest.raises(InvalidArgumentError, match=r"sums must be 0 where trees remember the past"):
        learned(env, shown, method=replace(METHOD, sums=1), history=1)
    with pytest.raises(InvalidArgumentError, match="sums must be 0 with monotone rules"):
        learned(env, shown, method=replace(METHOD, sums=1), monotone=["right in angle"])
    with pytest.raises(InvalidArgumentError, match="sums must be an integer >= 0, got -1"):
        replace(METHOD, sums=-1)


class CountsItsSteps(Pushes):
    num_timesteps = 7_000  # as models of Stable-Baselines3 do


def test_a_teacher_may_know_itself_what_its_training_cost():
    assert eutree.Teacher(CountsItsSteps()).cost == 7_000
    assert eutree.Teacher(CountsItsSteps(), steps=9).cost == 9
    with pytest.raises(InvalidArgumentError, match="steps must say in how many environment steps"):
        eutree.Teacher(Pushes())


def test_the_steps_of_the_network_that_teaches_are_its_own(whole):
    """They stood among those of the trees: 0 steps of 180,000 were the teacher's."""
    result, folder = whole
    counts = result.environment_steps
    stages = [event for event in events_of(folder) if event.get("stage") == "teacher"]
    assert counts.teacher == stages[-1]["steps"] > 0
    assert counts.learning == result.steps - counts.teacher > 0


class Remembers(Pushes):
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return 0, 1 if state is None else state + 1


class Errs(Pushes):
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return 7, None


@pytest.mark.parametrize(
    ("teacher", "words"),
    [
        (Pushes(), r"teacher must be eutree\.Teacher\(policy, steps"),
        (eutree.Teacher(Remembers(), steps=0), "one observation alone"),
        (eutree.Teacher(Errs(), steps=0), "an action from 0 to 1, got 7"),
        (eutree.Teacher(Pushes(), 0, lambda rows: rows), r"finite numbers of shape \(1, 2\)"),
    ],
)
def test_a_teacher_that_cannot_teach_is_refused(teacher, words, env, shown):
    with pytest.raises(InvalidArgumentError, match=words):
        learned(env, shown, teacher=teacher)


def test_methods_that_ask_nobody_refuse_a_teacher(env, shown):
    with pytest.raises(InvalidArgumentError, match="asks no teacher"):
        eutree.learn(
            env, method="planning", demonstrations=shown, teacher=eutree.Teacher(Pushes(), steps=0)
        )


@pytest.mark.parametrize(
    "place",
    ["neural.double_dqn._kernels.update", "world_model.ensemble.kernels.fit",
     "world_model.ensemble_rollouts.kernels.go_on"],
)  # fmt: skip
def test_an_interruption_in_the_middle_of_an_update_loses_nothing(
    place, whole, env, shown, tmp_path, monkeypatch
):
    """The last checkpoint is good, whatever was under way: networks, world model, imagination."""
    module, where, name = place.rsplit(".", 2)
    kernels = getattr(importlib.import_module(f"eutree.{module}"), where)
    plainly, calls = getattr(kernels, name), 0

    def interrupted(*arguments):
        nonlocal calls
        calls += 1
        if calls == 2:
            raise KeyboardInterrupt
        return plainly(*arguments)

    monkeypatch.setattr(kernels, name, interrupted)
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        learned(env, shown, out=out, checkpoint_seconds=0)
    learned(env, shown, out=out, resume=True)
    _, folder = whole
    for file in ("policy.json", "events.jsonl"):
        assert (out / file).read_bytes() == (folder / file).read_bytes()


def test_no_loop_runs_for_long_without_a_chance_to_interrupt(env, shown, monkeypatch):
    """A compiled loop ends after 256 updates, a third of a second, however many are to be made."""
    sizes = []
    for module, where, name, rows in (
        ("neural.double_dqn", "_kernels", "update", 2),
        ("world_model.ensemble", "kernels", "fit", 2),
    ):
        kernels = getattr(importlib.import_module(f"eutree.{module}"), where)
        plainly = getattr(kernels, name)

        def counted(*arguments, plainly=plainly, rows=rows):
            sizes.append(len(arguments[rows]))
            return plainly(*arguments)

        monkeypatch.setattr(kernels, name, counted)
    model = replace(METHOD.world_model, updates=600)
    method = replace(METHOD, demonstration_updates=600, world_model=model)
    learned(env, shown, method=method)
    assert max(sizes) == 256


@pytest.mark.usefixtures("whole")
def test_the_command_line_shows_the_stage(told):
    names = [name for name, _, _ in told]
    assert (
        list(dict.fromkeys(names)) == ["teacher", "dagger", "race", "last race"][: len(set(names))]
    )
    assert {"teacher", "dagger", "race"} <= set(names)
    used = [steps for _, steps, _ in told]
    assert used == sorted(used)
    assert {total for _, _, total in told} == {BUDGET}


QUICK = ["updates=50", "more_updates=20", "members=1", "hidden=8", "batch=16"]


def test_the_command_line_takes_a_teacher_and_writes_the_page(shown, tmp_path, capsys):
    shown.save(tmp_path / "demos")
    out = tmp_path / "run"
    words = f"learn CartPole-v1 --demos {tmp_path / 'demos'} --method distilled-dqn --steps 3000"
    asked = f"--max-leaves 3 --evaluation-episodes 2 --teacher fall --teacher-steps 7 --out {out}"
    choices = [word for one in QUICK for word in ("--set", f"world_model.{one}")]
    assert run([*words.split(), *asked.split(), *choices, "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["environment_steps"]["declared"] == 7
    assert "model_trust" in values
    page = tmp_path / "page.html"
    assert run(["show", str(out), "--run-html", str(page)]) == 0
    assert "Its teacher is one" in page.read_text()
    assert run(["show", str(tmp_path / "demos"), "--run-html", str(page)]) != 0
    assert "must be a run folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("--teacher-steps 5", "--teacher-steps says what --teacher cost; name the teacher"),
        ("--teacher nobody", "unknown --teacher 'nobody'"),
    ],
)
def test_a_teacher_on_the_command_line_must_be_known(words, error, tmp_path, capsys):
    run(["learn", "CartPole-v1", *words.split(), "--out", str(tmp_path / "run")])
    assert error in capsys.readouterr().err
