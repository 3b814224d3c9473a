"""Callbacks with the names and the meaning of Stable-Baselines3.

A callback follows a run and may end it: ``eutree.learn(env, callback=...)`` takes a function of
``(locals, globals)``, a callback, or a list of them. What SB3 calls a rollout is a gathering phase
here, and ``model`` is the run as a ``TrainingModel``. A callback written for SB3 works too where it
asks the model for nothing else.

Evaluations that a callback makes, and whatever else it does, do not change what is learned; only
ending the run does. A callback's own memory is not part of a checkpoint.
"""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from eutree.errors import InvalidArgumentError
from eutree.evaluation import evaluate
from eutree.files import make_folder, write_arrays
from eutree.training.callback import (
    BaseCallback,
    Callback,
    CallbackList,
    FunctionCallback,
    Logger,
    TrainingModel,
)
from eutree.validation import check_integer, check_number

__all__ = [
    "BaseCallback",
    "Callback",
    "CallbackList",
    "CheckpointCallback",
    "EvalCallback",
    "FunctionCallback",
    "Logger",
    "StopTrainingOnMaxEpisodes",
    "StopTrainingOnRewardThreshold",
    "TrainingModel",
]


class CheckpointCallback(BaseCallback):
    """Saves the present policy every so many steps, as ``PREFIX_STEPS_steps.json``.

    To resume a run, its run folder has checkpoints of its own.

    Args:
        save_freq: Steps between two files.
        save_path: The folder.
        name_prefix: What the names begin with.
        verbose: Kept for SB3's signature.
    """

    def __init__(
        self, save_freq: int, save_path: str | Path, name_prefix: str = "policy", verbose: int = 0
    ) -> None:
        super().__init__(verbose)
        self.save_freq = check_integer("save_freq", save_freq, low=1)
        self.save_path = Path(save_path)
        self.name_prefix = name_prefix

    def _on_step(self) -> bool:
        if self.num_timesteps % self.save_freq == 0:
            name = f"{self.name_prefix}_{self.num_timesteps}_steps.json"
            self.model.save(make_folder(self.save_path) / name)
        return True


class EvalCallback(BaseCallback):
    """Evaluates the frozen policy every so many steps, each time on the same episodes.

    ``learn`` evaluates by itself, between episodes (``evaluate_every``); this is for another
    environment, for keeping the best policy, or for code that was written for SB3.

    Args:
        eval_env: Where to evaluate; not the environment that the run gathers in.
        callback_on_new_best: Asked after an evaluation that is better than all before.
        callback_after_eval: Asked after every evaluation.
        n_eval_episodes: Episodes of each evaluation.
        eval_freq: Steps between two evaluations.
        log_path: Folder for ``evaluations.npz``: ``timesteps``, ``results``, ``ep_lengths`` and,
            where the environment reports it, ``successes``, with a row for each evaluation.
        best_model_save_path: Folder for ``best_model.json``.
        deterministic: Kept for SB3's signature: a tree always decides the same.
        seed: Seed of the episodes.
        verbose: Kept for SB3's signature.

    Attributes:
        best_mean_reward: Mean return of the best evaluation so far.
        last_mean_reward: Mean return of the last one.
    """

    def __init__(
        self,
        eval_env: gymnasium.Env[Any, Any],
        callback_on_new_best: Callback | None = None,
        callback_after_eval: Callback | None = None,
        n_eval_episodes: int = 5,
        eval_freq: int = 10000,
        *,
        log_path: str | Path | None = None,
        best_model_save_path: str | Path | None = None,
        deterministic: bool = True,
        seed: int = 0,
        verbose: int = 0,
    ) -> None:
        super().__init__(verbose)
        self.eval_env = eval_env
        self.n_eval_episodes = check_integer("n_eval_episodes", n_eval_episodes, low=1)
        self.eval_freq = check_integer("eval_freq", eval_freq, low=1)
        self.best_mean_reward = self.last_mean_reward = -np.inf
        self.evaluations_timesteps: list[int] = []
        self._on_new_best, self._after_eval = callback_on_new_best, callback_after_eval
        self._children = [c for c in (callback_on_new_best, callback_after_eval) if c is not None]
        self._log_path, self._best_path = log_path, best_model_save_path
        self._seed = seed
        self._log: dict[str, list[Any]] = {"results": [], "ep_lengths": [], "successes": []}

    def _init_callback(self) -> None:
        if self.eval_env.unwrapped is self.training_env.unwrapped:
            raise InvalidArgumentError(
                "eval_env must not be the environment that is learned in: the episode that is "
                "under way would be lost"
            )
        for child in self._children:
            child.parent = self  # type: ignore[attr-defined]  # SB3's have it too
            child.init_callback(self.model)

    def _on_training_start(self) -> None:
        for child in self._children:
            child.on_training_start(self.locals, self.globals)

    def update_child_locals(self, locals_: dict[str, Any]) -> None:
        """Pass it on."""
        for child in self._children:
            child.update_locals(locals_)

    def _on_step(self) -> bool:
        if self.num_timesteps % self.eval_freq:
            return True
        policy = self.model.policy
        result = evaluate(policy, self.eval_env, episodes=self.n_eval_episodes, seed=self._seed)
        self.last_mean_reward = result.mean_return
        self.logger.record("eval/mean_reward", result.mean_return)
        self.logger.record("eval/mean_ep_length", result.mean_length)
        if result.success_rate is not None:
            self.logger.record("eval/success_rate", result.success_rate)
        self.evaluations_timesteps.append(self.num_timesteps)
        self._log["results"].append(result.returns)
        self._log["ep_lengths"].append(result.lengths)
        self._log["successes"].append(result.successes)
        if self._log_path is not None:
            self._save_log(make_folder(self._log_path) / "evaluations.npz")
        goes_on = True
        if result.mean_return > self.best_mean_reward:
            self.best_mean_reward = result.mean_return
            if self._best_path is not None:
                policy.save(make_folder(self._best_path) / "best_model.json")
            goes_on = self._on_new_best is None or self._on_new_best.on_step()
        return goes_on and (self._after_eval is None or self._after_eval.on_step())

    def _save_log(self, path: Path) -> None:
        known = {name: np.array(rows) for name, rows in self._log.items() if rows[0] is not None}
        write_arrays(path, {"timesteps": np.array(self.evaluations_timesteps), **known})


class StopTrainingOnRewardThreshold(BaseCallback):
    """Ends the run once an evaluation reached a mean return.

    As ``callback_on_new_best`` of an ``EvalCallback`` it follows that one's evaluations, alone the
    run's own.

    Args:
        reward_threshold: The mean return that is enough.
        verbose: Kept for SB3's signature.
    """

    def __init__(self, reward_threshold: float, verbose: int = 0) -> None:
        super().__init__(verbose)
        self.reward_threshold = check_number("reward_threshold", reward_threshold)

    def _on_step(self) -> bool:
        if isinstance(self.parent, EvalCallback):
            best = self.parent.best_mean_reward
        else:
            best = max((point.mean_return for point in self.model.run.curve), default=-np.inf)
        return bool(best < self.reward_threshold)


class StopTrainingOnMaxEpisodes(BaseCallback):
    """Ends the run after so many episodes, whatever ``episodes`` says.

    Args:
        max_episodes: Episodes of experience, those before an interruption included.
        verbose: Kept for SB3's signature.
    """

    def __init__(self, max_episodes: int, verbose: int = 0) -> None:
        super().__init__(verbose)
        self.max_episodes = check_integer("max_episodes", max_episodes, low=1)

    def _on_step(self) -> bool:
        return bool(self.model.run.episode < self.max_episodes)
