"""A policy search in a checkpoint: where it stood as a document, its episodes as arrays."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eutree.data import Episode
from eutree.errors import FormatError
from eutree.policies import TreePolicy
from eutree.training.search import STAGES, SearchState

_PREFIX = "race_"
_KINDS = {
    "lengths": "i",
    "observations": "f",
    "actions": "i",
    "rewards": "f",
    "terminated": "b",
    "successes": "i",
}
_UNKNOWN = -1  # success of an episode of an environment that reports none

Count = Annotated[int, msgspec.Meta(ge=0)]


class PolicyText(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A policy as the text of its file."""

    text: str

    @classmethod
    def of(cls, policy: TreePolicy) -> "PolicyText":
        """Return the text of a policy."""
        return cls(policy.to_bytes().decode())

    def policy(self, path: Path) -> TreePolicy:
        """Return the policy; ``path`` is for messages."""
        return TreePolicy.from_bytes(self.text.encode(), path)


class ChanceDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """State of a PCG64 generator; its numbers have 128 bits."""

    state: str
    inc: str
    has_uint32: Count
    uinteger: Count


class FittedDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When the advantages of recorded steps were fitted last."""

    steps: Count
    episodes: Count
    chance: ChanceDocument


class RaceDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where a policy search stood between two stages; see ``SearchState``."""

    stage: str
    incumbent: PolicyText
    challengers: list[PolicyText]
    round: Count
    block: Count
    limit: Count
    tried: Count
    won: Count
    idle: Count
    n_episodes: Count
    own: list[Count]
    fitted: FittedDocument | None
    chance: ChanceDocument | None


def race_to_document(state: SearchState) -> RaceDocument:
    """Return where a search stood as a document."""
    fitted = state.fitted
    return RaceDocument(
        stage=state.stage,
        incumbent=PolicyText.of(state.incumbent),
        challengers=[PolicyText.of(tree) for tree in state.challengers],
        round=state.round,
        block=state.block,
        limit=state.limit,
        tried=state.tried,
        won=state.won,
        idle=state.idle,
        n_episodes=state.n_episodes,
        own=list(state.own),
        fitted=None if fitted is None else FittedDocument(*fitted[:2], _chance_to(fitted[2])),
        chance=None if state.chance is None else _chance_to(state.chance),
    )


def race_from_document(document: RaceDocument, path: Path, n_episodes: int) -> SearchState:
    """Take a document back; ``n_episodes`` are stored beside it.

    Raises:
        FormatError: It does not fit the episodes, or names no stage.
    """
    fitted = document.fitted
    known = [document.n_episodes, *(number + 1 for number in document.own)]
    if fitted is not None:
        known.append(fitted.episodes)
    if max(known) > n_episodes:
        raise FormatError(path, "race", f"must be of {n_episodes} episodes, got {max(known)}")
    if document.stage not in STAGES:
        raise FormatError(path, "race", f"stage must be one of {STAGES}, got {document.stage!r}")
    if document.stage in ("cut", "race", "prove") and not document.challengers:
        raise FormatError(path, "race", f"stage {document.stage!r} must have challengers")
    if document.stage == "vary" and fitted is None:
        raise FormatError(path, "race", "stage 'vary' must say when advantages were fitted")
    return SearchState(
        stage=document.stage,
        incumbent=document.incumbent.policy(path),
        challengers=tuple(text.policy(path) for text in document.challengers),
        round=document.round,
        block=document.block,
        limit=document.limit,
        tried=document.tried,
        won=document.won,
        idle=document.idle,
        n_episodes=document.n_episodes,
        own=tuple(document.own),
        fitted=None
        if fitted is None
        else (fitted.steps, fitted.episodes, _chance_from(path, fitted.chance)),
        chance=None if document.chance is None else _chance_from(path, document.chance),
    )


def episodes_to_arrays(episodes: Sequence[Episode]) -> dict[str, NDArray[Any]]:
    """Return episodes as arrays for a checkpoint."""
    if not episodes:
        return {}
    known = [_UNKNOWN if e.is_success is None else int(e.is_success) for e in episodes]
    arrays: dict[str, NDArray[Any]] = {
        "lengths": np.array([len(episode) for episode in episodes], dtype=np.int64),
        "observations": np.concatenate([episode.observations for episode in episodes]),
        "actions": np.concatenate([episode.actions for episode in episodes]),
        "rewards": np.concatenate([episode.rewards for episode in episodes]),
        "terminated": np.array([episode.terminated for episode in episodes]),
        "successes": np.array(known, dtype=np.int8),
    }
    return {_PREFIX + name: array for name, array in arrays.items()}


def episodes_from_arrays(
    path: Path, arrays: dict[str, NDArray[Any]], n_actions: int, n_features: int
) -> list[Episode]:
    """Take the episodes of a search out of the arrays of a checkpoint.

    Raises:
        FormatError: They do not fit each other, or the environment.
    """
    found = {name: arrays.pop(_PREFIX + name, None) for name in _KINDS}
    if all(array is None for array in found.values()):
        return []
    known: dict[str, NDArray[Any]] = {}
    for name, array in found.items():
        dimensions = 2 if name == "observations" else 1
        if array is None or array.dtype.kind != _KINDS[name] or array.ndim != dimensions:
            raise FormatError(path, _PREFIX + name, "missing, or of another type or shape")
        known[name] = array
    lengths = known["lengths"]
    _check(path, "lengths", bool((lengths > 0).all() and (lengths < 2**40).all()), "above 0")
    n, e = int(lengths.sum()), lengths.size
    sizes = {"actions": n, "rewards": n, "terminated": e, "successes": e, "observations": n + e}
    for name, size in sizes.items():
        _check(path, name, len(known[name]) == size, f"of {size} rows")
    _check(path, "observations", known["observations"].shape[1] == n_features, "of the features")
    for name in ("observations", "rewards"):
        _check(path, name, bool(np.isfinite(known[name]).all()), "finite")
    actions, successes = known["actions"], known["successes"]
    _check(path, "actions", bool(((actions >= 0) & (actions < n_actions)).all()), "actions")
    _check(path, "successes", bool(((successes >= _UNKNOWN) & (successes <= 1)).all()), "-1, 0, 1")
    return [_episode(known, k, int(lengths[:k].sum())) for k in range(e)]


def _episode(known: dict[str, NDArray[Any]], number: int, start: int) -> Episode:
    """Return one of the stored episodes, whose steps begin at ``start``."""
    end = start + int(known["lengths"][number])
    success = int(known["successes"][number])
    terminated = bool(known["terminated"][number])
    return Episode(
        observations=known["observations"][start + number : end + number + 1],
        actions=known["actions"][start:end],
        rewards=known["rewards"][start:end],
        terminated=terminated,
        truncated=not terminated,
        is_success=None if success == _UNKNOWN else bool(success),
    )


def _check(path: Path, name: str, right: bool, wanted: str) -> None:
    if not right:
        raise FormatError(path, _PREFIX + name, f"must be {wanted}")


def _chance_to(state: dict[str, Any]) -> ChanceDocument:
    inner = state["state"]
    return ChanceDocument(
        str(inner["state"]), str(inner["inc"]), int(state["has_uint32"]), int(state["uinteger"])
    )


def _chance_from(path: Path, document: ChanceDocument) -> dict[str, Any]:
    numbers = document.state, document.inc
    if not all(number.isdecimal() and len(number) < 40 for number in numbers):
        raise FormatError(path, "race", "chance must be numbers of 128 bits")
    state, inc = (int(number) % 2**128 for number in numbers)
    return {
        "bit_generator": "PCG64",
        "state": {"state": state, "inc": inc},
        "has_uint32": document.has_uint32 % 2,
        "uinteger": document.uinteger % 2**32,
    }
