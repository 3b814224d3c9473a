"""Runs followed with the tools of Stable-Baselines3: progress.csv, TensorBoard, callbacks."""

import csv
import struct

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.training.listeners import Logger
from tests.worlds import FEW_IMAGINED

SHORT = {"episodes": 45, "evaluate_every": 15, "evaluation_episodes": 10, "seed": 4}
SHORT |= {"method": FEW_IMAGINED, "front_steps": 0}


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("eutree/Evasion2-v0")


@pytest.fixture(scope="module")
def demonstrations(env):
    return eutree.record(env, eutree.experts.wait_at_crossing, episodes=8, seed=0)


class Witness:
    """Notes every call, and all rewards and ends."""

    def __init__(self):
        self.seen = []
        self.rewards = []
        self.ends = []

    def init_callback(self, model):
        self.model = model

    def on_training_start(self, locals_, globals_):
        self.seen.append("training start")

    def on_rollout_start(self):
        self.seen.append(f"rollout start {self.model.run.episode}")

    def update_locals(self, known):
        self.rewards += known["rewards"]
        self.ends += known["dones"]

    def on_step(self):
        assert self.model.num_timesteps == len(self.rewards)
        return True

    def on_rollout_end(self):
        self.seen.append(f"rollout end {self.model.run.episode}")
        self.model.logger.record("own/steps", self.model.num_timesteps)
        self.model.logger.record("own/nothing", np.nan)

    def on_training_end(self):
        self.seen.append("training end")


def progress(folder):
    with open(folder / "progress.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_progress_says_what_was_measured(env, demonstrations, tmp_path):
    witness = Witness()
    result = eutree.learn(
        env, demonstrations=demonstrations, out=tmp_path / "a", callback=witness, **SHORT
    )
    rows = progress(tmp_path / "a")
    assert [row["time/episodes"] for row in rows] == ["0", "15", "20", "30", "40", "45"]
    assert [row["time/iterations"] for row in rows] == ["0", "0", "1", "1", "2", "3"]
    ends = np.flatnonzero(witness.ends) + 1
    lengths = np.diff(ends, prepend=0)
    returns = [sum(part) for part in np.split(witness.rewards, ends)[:-1]]
    last = rows[-1]
    assert float(last["rollout/ep_rew_mean"]) == pytest.approx(np.mean(returns))
    assert float(last["rollout/ep_len_mean"]) == pytest.approx(np.mean(lengths))
    assert 0 <= float(last["rollout/success_rate"]) <= 1
    assert int(last["time/total_timesteps"]) == result.steps == len(witness.rewards)
    assert float(last["own/steps"]) == result.steps
    assert last["own/nothing"] == rows[0]["own/steps"] == rows[1]["rollout/ep_rew_mean"] == ""
    evaluated = {
        int(r["time/episodes"]): float(r["eval/mean_reward"]) for r in rows if r["eval/mean_reward"]
    }
    assert evaluated == {point.episode: point.mean_return for point in result.curve}
    assert float(last["eval/success_rate"]) == result.curve[-1].success_rate
    assert int(last["eval/n_leaves"]) == result.policy.n_leaves


def test_means_are_of_the_last_hundred_episodes():
    gathered = eutree.training.progress.GatheredEpisodes()
    for number in range(150):
        gathered.append(float(number), 2 * number, success=number >= 100)
    assert gathered.means(150) == {
        "rollout/ep_len_mean": 199.0,
        "rollout/ep_rew_mean": 99.5,
        "rollout/success_rate": 0.5,
    }
    assert gathered.means(10)["rollout/ep_rew_mean"] == 4.5
    gathered.append(1.0, 1, success=None)
    assert gathered.means(151)["rollout/success_rate"] is None
    assert gathered.means(0)["rollout/ep_len_mean"] is None


def test_calls_come_in_order_and_change_nothing(env, demonstrations, tmp_path):
    witness = Witness()
    options = {"demonstrations": demonstrations, **SHORT}
    followed = eutree.learn(env, callback=[witness, lambda locals_, globals_: None], **options)
    assert witness.seen == [
        "training start",
        *("rollout start 0", "rollout end 20", "rollout start 20", "rollout end 40"),
        *("rollout start 40", "rollout end 45"),
        "training end",
    ]
    alone = eutree.learn(env, **options)
    assert followed.policy == alone.policy
    assert followed.curve == alone.curve


@pytest.mark.promise(8)
def test_what_callbacks_record_survives_an_interruption(env, demonstrations, tmp_path):
    class Recorder:
        def init_callback(self, model):
            self.model = model

        def update_locals(self, known):
            self.model.logger.record("own/reward", known["rewards"][0])

    def interrupt(run):
        if run.episode == 27:
            raise RuntimeError

    options = {"demonstrations": demonstrations, "callback": Recorder(), **SHORT}
    folder, whole = tmp_path / "a", tmp_path / "whole"
    with pytest.raises(RuntimeError):
        eutree.learn(env, out=folder, on_progress=interrupt, **options)
    eutree.learn(env, out=folder, resume=True, **options)
    eutree.learn(env, out=whole, **options)
    assert (folder / "progress.csv").read_bytes() == (whole / "progress.csv").read_bytes()
    assert (folder / "checkpoint.npz").read_bytes() == (whole / "checkpoint.npz").read_bytes()


@pytest.mark.parametrize("end_of_episode", [False, True])
def test_false_ends_the_run_and_it_can_be_resumed(env, demonstrations, tmp_path, end_of_episode):
    def enough(locals_, globals_):
        calls.append(1)
        return len(calls) < 400 or locals_["dones"][0] is not end_of_episode

    calls = []
    options = {"demonstrations": demonstrations, **SHORT}
    stopped = eutree.learn(env, out=tmp_path / "a", callback=enough, **options)
    assert 0 < stopped.episodes < 45
    assert (stopped.steps == len(calls)) is end_of_episode
    resumed = eutree.learn(env, out=tmp_path / "a", resume=True, **options)
    assert resumed.policy == eutree.learn(env, out=tmp_path / "b", **options).policy
    name = "progress.csv"
    assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize("at_the_end", [False, True])
def test_a_fault_in_a_callback_leaves_the_run_resumable(env, demonstrations, tmp_path, at_the_end):
    def faulty(locals_, globals_):
        calls.append(1)
        if len(calls) >= 300 and locals_["dones"][0] is at_the_end:
            raise ZeroDivisionError

    calls = []
    options = {"demonstrations": demonstrations, **SHORT}
    with pytest.raises(ZeroDivisionError):
        eutree.learn(env, out=tmp_path / "a", callback=faulty, **options)
    resumed = eutree.learn(env, out=tmp_path / "a", resume=True, **options)
    assert resumed.policy == eutree.learn(env, **options).policy


def test_any_callback_of_several_ends_the_run(env, demonstrations):
    class Ending(Witness):
        def on_step(self):
            return np.bool_(len(self.rewards) < 50)

    options = {"demonstrations": demonstrations, **SHORT}
    other = Witness()
    result = eutree.learn(env, callback=[Ending(), other, lambda *_: None], **options)
    assert result.steps <= 50 == len(other.rewards)
    assert other.seen[-1] == "training end"


def test_what_is_no_callback_is_refused(env, demonstrations):
    with pytest.raises(InvalidArgumentError, match="callback must be a Listener"):
        eutree.learn(env, callback="progress", **SHORT)
    for one in (lambda known: True, lambda: True, Witness, lambda *, known: True):
        with pytest.raises(InvalidArgumentError, match=r"a function of \(locals, globals\)"):
            eutree.learn(env, callback=one, **SHORT)
    with pytest.raises(InvalidArgumentError, match="offline learning, which takes no steps"):
        eutree.learn(None, demonstrations=demonstrations, callback=lambda *_: True)
    with pytest.raises(InvalidArgumentError, match="value of 'a' must be a number, got 'b'"):
        Logger({}).record("a", "b")


def scalars(folder):
    """Read a log of TensorBoard as it does: what a later start purges is left out."""
    from tensorboardX.proto.event_pb2 import Event, SessionLog

    found = []
    for path in sorted(folder.glob("events.out.tfevents.*")):
        data = path.read_bytes()
        while data:
            (length,) = struct.unpack("<Q", data[:8])
            event = Event.FromString(data[12 : 12 + length])
            data = data[16 + length :]
            if event.HasField("session_log") and event.session_log.status == SessionLog.START:
                found = [entry for entry in found if entry[0] < event.step]
            found += [
                (event.step, value.tag, value.simple_value)
                for value in event.summary.value
                if not value.tag.startswith("time/")
            ]
    return found


def test_tensorboard_gets_each_value_once(env, demonstrations, tmp_path):
    def interrupt(run):
        if run.episode == 27:
            raise RuntimeError

    options = {"demonstrations": demonstrations, "callback": Witness(), **SHORT}
    whole = {"out": tmp_path / "whole", "tensorboard": tmp_path / "tb" / "whole"}
    eutree.learn(env, **whole, **options)
    torn = {"out": tmp_path / "torn", "tensorboard": tmp_path / "tb" / "torn"}
    options["callback"] = lambda *_: None
    eutree.learn(env, **(torn | {"out": None, "tensorboard": tmp_path / "tb" / "c"}), **options)
    with pytest.raises(RuntimeError):
        eutree.learn(env, on_progress=interrupt, checkpoint_seconds=1000.0, **torn, **options)
    eutree.learn(env, resume=True, **torn, **options)
    wanted = scalars(tmp_path / "tb" / "c")
    assert sorted(scalars(tmp_path / "tb" / "torn")) == sorted(wanted)
    assert len(set(wanted)) == len(wanted)
    own = {tag for _, tag, _ in scalars(tmp_path / "tb" / "whole")} - {tag for _, tag, _ in wanted}
    assert own == {"own/steps"}
    rows = [row for row in progress(tmp_path / "whole") if row["rollout/ep_rew_mean"]]
    shown = {step: value for step, tag, value in wanted if tag == "rollout/ep_rew_mean"}
    assert shown == {
        int(row["time/total_timesteps"]): np.float32(row["rollout/ep_rew_mean"]) for row in rows
    }
    with pytest.raises(InvalidArgumentError, match="without the log of another run"):
        eutree.learn(env, tensorboard=tmp_path / "tb" / "c", **SHORT)


def test_offline_learning_is_followed_too(demonstrations, tmp_path):
    eutree.learn(
        None, demonstrations=demonstrations, out=tmp_path / "a", tensorboard=tmp_path / "tb"
    )
    leaves = [row["train/n_leaves"] for row in progress(tmp_path / "a")]
    shown = [value for _, tag, value in scalars(tmp_path / "tb") if tag == "train/n_leaves"]
    assert list(map(float, leaves)) == shown


def test_tensorboard_names_its_extra(env, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "tensorboardX", None)
    with pytest.raises(MissingExtraError, match="tensorboard"):
        eutree.learn(env, tensorboard=tmp_path, **SHORT)
