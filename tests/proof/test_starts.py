"""Where a proof failed episodes begin: in the boxes of its certificate, and nowhere else."""

import json

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.errors import FormatError, InvalidArgumentError
from eutree.proof import (
    BeginningThere,
    Effort,
    Plant,
    load_certificate,
    plant_of,
    prove,
    register_plant,
    save_certificate,
)
from eutree.schema import EnvironmentSpec
from tests.proof.policies import BAD, GOOD, policy_of

PLANT = plant_of(EnvironmentSpec("MountainCar-v0"))
QUESTION = "arrives within 110 steps"


@pytest.fixture(scope="module")
def bad():
    return prove(policy_of(BAD), PLANT, QUESTION)


@pytest.fixture
def file(tmp_path, bad):
    save_certificate(tmp_path / "proof.json", bad, policy_of(BAD))
    return tmp_path / "proof.json"


def inside(certificate, positions):
    low, high = certificate.starts.low[:, 0], certificate.starts.high[:, 0]
    # An observation is the state in single precision.
    return [bool(((low - 1e-7 <= x) & (x <= high + 1e-7)).any()) for x in positions]


def test_the_starts_are_the_pieces_that_fail_joined(bad):
    pieces = bad.pieces
    fails = pieces.last == np.iinfo(np.int32).max
    width = (bad.starts.high - bad.starts.low)[:, 0]
    assert width.sum() == pytest.approx((pieces.high - pieces.low)[fails, 0].sum(), rel=1e-12)
    assert len(width) < fails.sum()
    assert (np.diff(width) <= 0).all()
    assert prove(policy_of(GOOD), PLANT, effort=Effort(smallest=2.0**-10)).starts is None


def test_every_episode_begins_there_and_the_policy_fails(bad):
    env = BeginningThere(gymnasium.make("MountainCar-v0"), [bad])
    policy = policy_of(BAD)
    starts = []
    for seed in range(6):
        observation, _ = env.reset(seed=seed)
        starts.append(float(observation[0]))
        steps, over = 0, False
        while not over:
            observation, _, terminated, truncated, _ = env.step(policy.act(observation.tolist()))
            over, steps = terminated or truncated, steps + 1
        assert steps > 110
    assert all(inside(bad, starts))
    assert len(set(starts)) == 6
    assert [env.reset(seed=seed)[0][0] for seed in range(6)] == starts


def test_half_of_the_episodes_of_learning_begin_there(bad):
    env = BeginningThere(gymnasium.make("MountainCar-v0"), [bad], share=0.5)
    found = inside(bad, [float(env.reset(seed=seed)[0][0]) for seed in range(200)])
    assert 70 < sum(found) < 130


def test_a_run_learns_from_there(bad):
    demonstrations = eutree.record("MountainCar-v0", eutree.experts.push_along, episodes=2, seed=0)
    options = {
        "demonstrations": demonstrations, "method": "u-tree", "episodes": 20, "evaluate_every": 20,
        "evaluation_episodes": 1, "judge_episodes": 0, "seed": 0,
    }  # fmt: skip

    def begun(**more):
        seen = eutree.learn("MountainCar-v0", **options, **more).history.observations
        return seen[(seen[:, 1] == 0) & (np.abs(seen[:, 0] + 0.5) <= 0.1), 0].tolist()[2:]

    assert sum(inside(bad, begun())) <= 1
    assert sum(inside(bad, begun(starts=[bad]))) >= 5


def test_what_has_no_starts_or_others(bad):
    env = gymnasium.make("MountainCar-v0")
    proven = prove(policy_of(GOOD), PLANT, "stays in position <= 0.7 for 3 steps")
    for certificate, where, message in (
        (proven, env, "certificate must have boxes in which"),
        (bad, gymnasium.make("Acrobot-v1"), "none is known for Acrobot-v1"),
        (bad, gymnasium.make("eutree/Evasion2-v0"), "certificate must be of eutree/Evasion2-v0"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            BeginningThere(where, [certificate])
    with pytest.raises(InvalidArgumentError, match="starts must be empty without an environment"):
        eutree.learn(None, starts=[bad])


def test_a_certificate_comes_back_from_its_file(file, bad):
    found = load_certificate(file, policy_of(BAD))
    assert found.figures() == json.loads(json.dumps(bad.figures()))
    np.testing.assert_array_equal(found.starts.low, bad.starts.low)
    np.testing.assert_array_equal(found.pictures[0].values, bad.pictures[0].values)
    with pytest.raises(InvalidArgumentError, match="certificate of this policy"):
        load_certificate(file, policy_of(GOOD))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"verdict": "sure"}, "must be one of proven, refuted, undecided"),
        ({"starts": {"names": ["a"], "low": [[0.0]], "high": [[-1.0]]}}, "must be boxes"),
        ({"starts": {"names": ["a"], "low": [[0.0, 1.0]], "high": [[1.0]]}}, "must be boxes"),
        ({"starts": {"names": ["a"], "low": [[0.0], [1.0, 2.0]], "high": [[1.0]]}}, "one length"),
        ({"starts": {"names": [], "low": [], "high": []}}, "must be boxes"),
    ],
)
def test_a_damaged_file(file, change, message):
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(FormatError, match=message):
        load_certificate(file)


@pytest.mark.parametrize(
    "change",
    [{"marks": [[9]]}, {"values": []}, {"low": [0.0, 1.0]}, {"low": [5.0]}, {"marks": [[0, 0]]}],
)
def test_a_damaged_picture(file, change):
    document = json.loads(file.read_text())
    document["pictures"] = [
        {"title": "", "names": ["a"], "low": [0.0], "high": [1.0], "values": [[1.0]],
         "marks": [[0]], "legend": ""} | change
    ]  # fmt: skip
    file.write_text(json.dumps(document))
    with pytest.raises(FormatError, match=r"pictures\[0\]"):
        load_certificate(file)


def test_recording_from_there_on_the_command_line(file, bad, tmp_path, capsys):
    line = ["record", "MountainCar-v0", "--expert", "push", "--episodes", "5", "--starts-from"]
    assert run([*line, str(file), "--out", str(tmp_path / "demos")]) == 0
    assert "regions of the starts: refuted" in capsys.readouterr().err
    shown = eutree.Demonstrations.load(tmp_path / "demos")
    assert all(inside(bad, [one.observations[0][0] for one in shown.episodes]))
    assert shown.environment == EnvironmentSpec("MountainCar-v0")
    save_certificate(file, prove(policy_of(GOOD), PLANT), policy_of(GOOD))
    assert run([*line, str(file), "--out", str(tmp_path / "none")]) == 2
    assert "must have boxes in which the proof fails" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_learning_from_there_on_the_command_line(file, tmp_path, capsys):
    policy_of(BAD).save(tmp_path / "bad.json")
    line = ["learn", "MountainCar-v0", "--expert", str(tmp_path / "bad.json"), "--start", "tree",
            "--episodes", "1", "--evaluation-episodes", "1", "--judge-episodes", "0",
            "--out", str(tmp_path / "run")]  # fmt: skip
    assert run([*line, "--starts-from", str(file), "--starts-from", str(file)]) == 0
    assert run(["learn", "--out", str(tmp_path / "run"), "--resume", "--episodes", "2"]) == 0
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    assert len(config["starts"].split()) == 2


def test_a_person_records_from_there(bad, tmp_path):
    from eutree.recording import Recorder, SessionSettings
    from eutree.recording.events import Command

    env = BeginningThere(gymnasium.make("MountainCar-v0", render_mode="rgb_array"), [bad])
    recorder = Recorder(env, tmp_path, settings=SessionSettings(target=1, countdown=0.0))
    recorder.tick(0.0)
    recorder.tick(0.1, [Command("start")])
    for k in range(40):
        recorder.tick(0.2 + 0.1 * k)
    recorder.tick(5.0, [Command("end")])
    recorder.close()
    (episode,) = recorder.session.episodes
    assert inside(bad, [episode.observations[0][0]]) == [True]


class Drifting(gymnasium.Env):
    """A number that is known by its state, with chance of its own."""

    observation_space = gymnasium.spaces.Box(-9.0, 9.0, (1,), dtype=np.float64)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = self.np_random.uniform(-1.0, 1.0, 1)
        return self.state.copy(), {}

    def step(self, action):
        self.state = self.state + 0.1 * self.np_random.uniform(-1.0, 1.0, 1)
        return self.state.copy(), 0.0, False, False, {}


class DriftingPlant(Plant):
    state = ("place",)
    start = ((-1.0, 1.0),)

    def __init__(self, spec):
        self.environment = spec

    def step(self, state, action):
        return state


def test_chance_goes_on_as_the_seed_says(bad):
    """Putting it there resets the environment with one and the same seed."""
    from dataclasses import replace

    from eutree.proof import Starts

    gymnasium.register("Drifting-v0", entry_point=Drifting)
    register_plant("Drifting-v0", DriftingPlant)
    starts = Starts(("place",), np.array([[0.5]]), np.array([[0.5]]))
    env = BeginningThere(gymnasium.make("Drifting-v0"), [replace(bad, starts=starts)])

    def second(seed):
        assert env.reset(seed=seed)[0].tolist() == [0.5]
        return float(env.step(0)[0][0])

    try:
        assert len({second(seed) for seed in range(5)}) == 5
        assert second(3) == second(3)
    finally:
        del gymnasium.registry["Drifting-v0"]
