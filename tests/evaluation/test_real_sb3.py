"""The real Stable-Baselines3 takes our policies, and our runs take its callbacks.

SB3 needs PyTorch (900 MB), so it is in no lock: these tests run where it is installed.
"""

import gymnasium
import numpy as np
import pytest

import eutree

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]


@pytest.fixture(scope="module")
def sb3():
    return pytest.importorskip("stable_baselines3")


@pytest.fixture(scope="module")
def learned():
    env = gymnasium.make("eutree/Evasion2-v0")
    demonstrations = eutree.record(env, eutree.experts.wait_at_crossing, episodes=6, seed=0)
    return eutree.fit_expert_tree(demonstrations), demonstrations


@pytest.mark.parametrize("n_envs", [1, 3])
def test_evaluate_policy_accepts_a_tree(sb3, learned, n_envs):
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.evaluation import evaluate_policy

    policy, _ = learned
    venv = make_vec_env("eutree/Evasion2-v0", n_envs=n_envs, seed=5)
    returns, lengths = evaluate_policy(policy, venv, 12, return_episode_rewards=True)
    assert len(returns) == len(lengths) == 12
    mean, deviation = evaluate_policy(policy, venv, 12, warn=False)
    assert np.isfinite([mean, deviation]).all()
    assert mean > -50


def test_policies_with_a_history_keep_their_state_in_sb3(sb3):
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.evaluation import evaluate_policy

    env = gymnasium.make("CartPole-v1")
    result = eutree.learn(env, episodes=20, evaluate_every=20, evaluation_episodes=2, history=1)
    assert result.policy.history == 1
    venv = make_vec_env("CartPole-v1", n_envs=2, seed=0)
    returns, lengths = evaluate_policy(result.policy, venv, 6, return_episode_rewards=True)
    assert returns == lengths


def test_sb3s_callbacks_follow_our_runs(sb3, learned, tmp_path):
    from stable_baselines3.common import callbacks

    _, demonstrations = learned

    class Own(callbacks.BaseCallback):
        ends = 0

        def _on_step(self):
            self.ends += sum(self.locals["dones"])
            self.logger.record("own/ends", self.ends)
            return self.ends < 25

    own = Own()
    eval_env = sb3.common.monitor.Monitor(gymnasium.make("eutree/Evasion2-v0"))
    evaluation = callbacks.EvalCallback(
        eval_env,
        callback_on_new_best=callbacks.StopTrainingOnRewardThreshold(1e6),
        best_model_save_path=str(tmp_path / "best"),
        log_path=str(tmp_path / "log"),
        eval_freq=200,
        verbose=0,
    )
    result = eutree.learn(
        gymnasium.make("eutree/Evasion2-v0"),
        demonstrations=demonstrations,
        episodes=40,
        evaluation_episodes=5,
        out=tmp_path / "run",
        callback=[own, evaluation, callbacks.CheckpointCallback(100, str(tmp_path / "saved"))],
    )
    assert result.episodes == own.ends == 25
    assert evaluation.best_mean_reward > -np.inf
    saved = next((tmp_path / "saved").iterdir())
    assert eutree.TreePolicy.load(saved).n_leaves >= 1
    assert "own/ends" in (tmp_path / "run" / "progress.csv").read_text().splitlines()[0]


def test_tensorboard_reads_a_resumed_log(tmp_path, learned):
    module = "tensorboard.backend.event_processing.event_accumulator"
    EventAccumulator = pytest.importorskip(module).EventAccumulator

    def interrupt(run):
        if run.episode == 27:
            raise RuntimeError

    _, demonstrations = learned
    env = gymnasium.make("eutree/Evasion2-v0")
    options = {
        "demonstrations": demonstrations,
        "episodes": 45,
        "evaluate_every": 15,
        "evaluation_episodes": 5,
    }

    def read(folder):
        log = EventAccumulator(str(folder)).Reload()
        tags = [tag for tag in log.Tags()["scalars"] if not tag.startswith("time/")]
        return {tag: [(s.step, s.value) for s in log.Scalars(tag)] for tag in tags}

    eutree.learn(env, tensorboard=tmp_path / "whole", **options)
    torn = {"out": tmp_path / "run", "tensorboard": tmp_path / "torn", **options}
    with pytest.raises(RuntimeError):
        eutree.learn(env, on_progress=interrupt, checkpoint_seconds=1000.0, **torn)
    eutree.learn(env, resume=True, **torn)
    assert read(tmp_path / "torn") == read(tmp_path / "whole")
    assert "rollout/ep_rew_mean" in read(tmp_path / "torn")
