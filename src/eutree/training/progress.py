"""The progress of a run in the words of Stable-Baselines3: ``progress.csv`` and TensorBoard.

Everything follows from the events of a run and the episodes that it gathered, both of which its
checkpoints hold: a resumed run writes the rows of an undisturbed one, each once. Times of the
clock are therefore in TensorBoard only.
"""

import csv
import io
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = dict[str, float | int | None]

WINDOW = 100  # episodes of the means, as in SB3

COLUMNS = (
    "time/iterations",
    "time/episodes",
    "time/total_timesteps",
    "rollout/ep_len_mean",
    "rollout/ep_rew_mean",
    "rollout/success_rate",
    "train/n_leaves",
    "train/n_splits",
    "eval/mean_ep_length",
    "eval/mean_reward",
    "eval/success_rate",
    "eval/n_leaves",
)

SILENT = ("request", "kept", "front", "judgement")  # events without values over time

_UNKNOWN = -1  # an episode of an environment that reports no success


class GatheredEpisodes:
    """Return, length and success of each episode that a run gathered."""

    def __init__(self) -> None:
        self.returns = array("d")  # 17 bytes an episode in all: runs are long
        self.lengths = array("q")
        self._successes = array("b")

    def append(self, undiscounted_return: float, length: int, success: bool | None) -> None:
        """Remember a finished episode."""
        self.returns.append(undiscounted_return)
        self.lengths.append(length)
        self._successes.append(_UNKNOWN if success is None else int(success))

    def means(self, episode: int) -> Values:
        """Return the means of the last ``WINDOW`` episodes before episode ``episode``."""
        recent = slice(max(0, episode - WINDOW), episode)
        successes = self._successes[recent]
        known = bool(successes) and _UNKNOWN not in successes
        return {
            "rollout/ep_len_mean": _mean(self.lengths[recent]),
            "rollout/ep_rew_mean": _mean(self.returns[recent]),
            "rollout/success_rate": _mean(successes) if known else None,
        }

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all episodes as arrays for a checkpoint; ``restore`` takes them back."""
        return {
            "episode_returns": np.array(self.returns, dtype=np.float64),
            "episode_lengths": np.array(self.lengths, dtype=np.int64),
            "episode_successes": np.array(self._successes, dtype=np.int8),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take back a ``state()``; a checkpoint of an early version has none."""
        if "episode_returns" in state:
            self.returns = array("d", state["episode_returns"].tolist())
            self.lengths = array("q", state["episode_lengths"].tolist())
            self._successes = array("b", state["episode_successes"].tolist())


def values_of(event: Mapping[str, Any], episodes: GatheredEpisodes) -> Values:
    """Return the values of one event of a run, under SB3's names."""
    if event["event"] == "record":
        return dict(event["values"])
    if event["event"] in SILENT:
        return {}
    if event["event"] == "race":
        return {f"race/{name}": event[name] for name in ("n_leaves", "tried", "won")}
    if event["event"] == "evaluation":
        return {
            "eval/mean_ep_length": event.get("mean_length"),
            "eval/mean_reward": event["mean_return"],
            "eval/success_rate": event["success_rate"],
            "eval/n_leaves": event["n_leaves"],
        }
    values: Values = {
        "train/n_leaves": event.get("n_leaves"),
        "train/n_splits": len(event.get("splits", ())),
    }
    return values | (episodes.means(event["episode"]) if episodes.lengths else {})


def progress_to_csv(events: Sequence[Mapping[str, Any]], episodes: GatheredEpisodes) -> str:
    """Return ``progress.csv``: a row for each expansion or evaluation, one for both at once.

    The records of callbacks stand in the next row. A field is empty where nothing was measured.
    """
    rows: list[Values] = []
    pending: Values = {}
    iterations = 0
    for event in events:
        pending |= values_of(event, episodes)
        if event["event"] in ("record", *SILENT):
            continue
        iterations += event["event"] == "expansion"
        time: Values = {
            "time/iterations": iterations,
            "time/episodes": event.get("episode"),
            "time/total_timesteps": event.get("steps"),
        }
        is_new = not rows or event["event"] in ("expansion", "race")
        if not is_new and rows[-1]["time/episodes"] == event.get("episode"):
            rows[-1] |= pending | time
        else:
            rows.append(time | pending)
        pending = {}
    own = sorted({name for row in rows for name in row} - set(COLUMNS))
    text = io.StringIO()
    table = csv.DictWriter(text, [*COLUMNS, *own], lineterminator="\n")
    table.writeheader()
    for row in rows:  # numbers so that they read back to the same bits
        table.writerow({name: repr(value) for name, value in row.items() if value is not None})
    return text.getvalue()


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
