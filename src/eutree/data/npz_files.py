"""Demonstrations in the npz files of imitation and Stable-Baselines, without pickle.

Read are two layouts. Rows: ``obs`` [N, d], ``acts`` or ``actions`` [N], and where present
``next_obs``, ``rews`` or ``rewards``, ``action_masks`` [N, A], and the ends of episodes as
``terminations`` and ``truncations``, as ``dones``, or as ``episode_starts``. Trajectories: ``obs``
with one more row than ``acts`` for each episode, ``indices`` (where the actions of all but the
first begin) and ``terminal``. ``infos`` are pickled dictionaries in these files and are not read.
Written are rows. D4RL and d3rlpy call the ends ``terminals``, ``timeouts``, ``episode_terminals``.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.data.episode import Episode, allowed_in, episodes_from_rows
from eutree.errors import FormatError, InvalidArgumentError, blamed
from eutree.files import read_arrays, write_arrays

_ALIASES = {
    "obs": ("obs", "observations"),
    "acts": ("acts", "actions"),
    "next_obs": ("next_obs", "next_observations"),
    "rews": ("rews", "rewards"),
    "dones": ("dones", "episode_terminals"),
    "terminations": ("terminations", "terminals"),
    "truncations": ("truncations", "timeouts"),
    "starts": ("episode_starts",),
    "indices": ("indices",),
    "terminal": ("terminal",),
    "masks": ("action_masks",),
}
_Arrays = dict[str, NDArray[Any]]


def read_npz(path: str | Path, ends_in_place: bool = False) -> tuple[tuple[Episode, ...], int]:
    """Return the episodes in a file, and their number of features.

    ``ends_in_place`` is as in ``Demonstrations.from_npz``.

    Raises:
        FormatError: The file has none of the layouts, or its arrays contradict each other.
        FileError: The file is missing or cannot be read.
    """
    found = read_arrays(path, only={name for names in _ALIASES.values() for name in names})
    arrays = {
        key: found[name] for key, names in _ALIASES.items() for name in names if name in found
    }
    for key in ("obs", "acts"):
        if key not in arrays:
            raise FormatError(path, key, "missing; expected observations obs and actions acts")
    for key, array in arrays.items():
        if not array.ndim or array.dtype.kind not in "biuf":
            kind, shape = array.dtype, array.shape
            raise FormatError(path, key, f"must be an array of numbers, got {kind} of {shape}")
    for key in ("dones", "terminations", "truncations", "starts"):
        if key in arrays and arrays[key].shape != arrays["acts"].shape[:1]:
            shape = arrays[key].shape
            raise FormatError(path, key, f"must be one truth for each action, got shape {shape}")
    for key in ("acts", "rews"):
        if key in arrays and arrays[key].shape[1:] == (1,):
            arrays[key] = arrays[key][:, 0]
    for key in ("obs", "next_obs"):
        if key in arrays and arrays[key].ndim == 1:
            arrays[key] = arrays[key][:, np.newaxis]
    with blamed(path, errors=(InvalidArgumentError, IndexError)):
        many = "indices" in arrays
        read = _trajectories(arrays) if many else _rows(arrays, ends_in_place)
        return read, int(arrays["obs"].shape[1])


def write_npz(path: str | Path, episodes: tuple[Episode, ...], n_features: int) -> None:
    """Write the episodes as rows; facts without a place in rows (seeds, comments) are left out.

    So are the rewards, if those of one episode are not known.
    """
    known = all(episode.has_rewards for episode in episodes)
    episodes = tuple(episode for episode in episodes if len(episode))
    lengths = np.array([len(episode) for episode in episodes], dtype=np.int64)
    ends = np.cumsum(lengths)
    starts, dones, terminated, truncated = np.zeros((4, int(lengths.sum())), dtype=bool)
    starts[ends - lengths] = dones[ends - 1] = True
    terminated[ends - 1] = [episode.terminated for episode in episodes]
    truncated[ends - 1] = [episode.truncated for episode in episodes]
    nothing = np.empty((0, n_features))
    arrays = {
        "obs": np.concatenate([nothing, *(e.observations[:-1] for e in episodes)]),
        "acts": np.concatenate([np.empty(0, np.int64), *(e.actions for e in episodes)]),
        "next_obs": np.concatenate([nothing, *(e.observations[1:] for e in episodes)]),
        "rews": np.concatenate([np.empty(0), *(e.rewards for e in episodes)]),
        "dones": dones,
        "terminations": terminated,
        "truncations": truncated,
        "episode_starts": starts,
    }
    if (allowed := allowed_in(episodes)) is not None:
        arrays["action_masks"] = allowed
    write_arrays(path, {name: array for name, array in arrays.items() if known or name != "rews"})


def _rows(arrays: _Arrays, ends_in_place: bool) -> tuple[Episode, ...]:
    dones, terminated, truncated = map(arrays.get, ("dones", "terminations", "truncations"))
    if dones is not None:  # an end is of the one kind or of the other
        if terminated is None:
            terminated = dones if truncated is None else np.logical_and(dones, truncated == 0)
        elif truncated is None:
            truncated = np.logical_and(dones, terminated == 0)
    elif terminated is not None:
        dones = terminated if truncated is None else np.logical_or(terminated, truncated)
    starts = np.arange(len(arrays["acts"])) == 0
    if dones is not None:
        starts[1:] = dones[:-1]
    return episodes_from_rows(
        arrays["obs"],
        arrays["acts"],
        starts=arrays.get("starts", starts),
        rewards=arrays.get("rews"),
        next_observations=arrays.get("next_obs"),
        terminated=terminated,
        truncated=truncated,
        action_masks=arrays.get("masks"),
        ends_in_place=ends_in_place,
    )


def _trajectories(arrays: _Arrays) -> tuple[Episode, ...]:
    obs, acts, indices = arrays["obs"], arrays["acts"], arrays["indices"]
    count = len(indices) + 1
    if indices.ndim != 1 or indices.dtype.kind not in "iu":
        raise InvalidArgumentError(f"indices must be a vector of integers, got {indices.dtype}")
    if len(obs) != len(acts) + count:
        raise InvalidArgumentError(
            f"obs must have one more row than acts for each of the {count} episodes, "
            f"got {len(obs)} and {len(acts)}"
        )
    begins, ends = [0, *indices.tolist()], [*indices.tolist(), len(acts)]
    spans = list(zip(begins, ends, strict=True))
    terminal = arrays.get("terminal", np.zeros(count, dtype=bool))
    if terminal.shape != (count,):
        raise InvalidArgumentError(
            f"terminal must say of each of the {count} episodes whether the task ended it, "
            f"got an array of shape {terminal.shape}"
        )
    if any(not 0 <= begin <= end <= len(acts) for begin, end in spans):
        raise InvalidArgumentError(f"indices must rise from 0 to at most {len(acts)}")
    before = np.concatenate([np.arange(b, e) + k for k, (b, e) in enumerate(spans)])
    starts, terminated = np.zeros(len(acts), dtype=bool), np.zeros(len(acts), dtype=bool)
    for is_end, (begin, end) in zip(terminal, spans, strict=True):
        if begin < end:
            starts[begin], terminated[end - 1] = True, is_end
    return episodes_from_rows(
        obs[before],
        acts,
        starts=starts,
        rewards=arrays.get("rews"),
        next_observations=obs[before + 1],
        terminated=terminated,
        action_masks=arrays.get("masks"),
    )
