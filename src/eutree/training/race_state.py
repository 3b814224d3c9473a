"""A policy search in a checkpoint: where it stood as a document, its episodes as arrays."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eutree.data import Episode
from eutree.errors import FormatError
from eutree.learners import Part, Stored
from eutree.learners.declared import Declared, Found, part, taken
from eutree.policies import TreePolicy
from eutree.training.search import STAGES, SearchState

_PREFIX = "race_"
_UNKNOWN = -1  # success of an episode of an environment that reports none


def _are_episodes(found: Found) -> None:
    n_steps, sizes = int(found.state[f"{_PREFIX}lengths"].sum()), found.sizes
    if (sizes["N"], sizes["rows"]) != (n_steps, n_steps + sizes["E"]):
        raise found.refuse(f"{_PREFIX}lengths", f"must add up to {sizes['N']}, got {n_steps}")


EPISODES = Part(
    {
        f"{_PREFIX}lengths": Stored("i8", "E", low=1, below=2**40),
        f"{_PREFIX}observations": Stored("f8", ("rows", "d")),
        f"{_PREFIX}actions": Stored("i8", "N", low=0, below="A"),
        f"{_PREFIX}rewards": Stored("f8", "N"),
        f"{_PREFIX}terminated": Stored("b1", "E"),
        f"{_PREFIX}successes": Stored("i1", "E", low=_UNKNOWN, most=1),
    },
    _are_episodes,
)

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
    fitted, chance = state.fitted, state.chance
    documents = {
        "incumbent": PolicyText.of(state.incumbent),
        "challengers": [PolicyText.of(tree) for tree in state.challengers],
        "own": list(state.own),
        "fitted": fitted and FittedDocument(*fitted[:2], _chance_to(fitted[2])),
        "chance": chance and _chance_to(chance),
    }
    return RaceDocument(**vars(state) | documents)


def race_from_document(document: RaceDocument, path: Path, n_episodes: int) -> SearchState:
    """Take a document back; ``n_episodes`` are stored beside it.

    Raises:
        FormatError: It does not fit the episodes, or names no stage.
    """
    fitted = document.fitted
    numbers = [document.n_episodes, *(number + 1 for number in document.own)]
    if fitted is not None:
        numbers.append(fitted.episodes)
    if max(numbers) > n_episodes:
        raise FormatError(path, "race", f"must be of {n_episodes} episodes, got {max(numbers)}")
    if document.stage not in STAGES:
        raise FormatError(path, "race", f"stage must be one of {STAGES}, got {document.stage!r}")
    if document.stage in ("cut", "race", "prove") and not document.challengers:
        raise FormatError(path, "race", f"stage {document.stage!r} must have challengers")
    if document.stage == "vary" and fitted is None:
        raise FormatError(path, "race", "stage 'vary' must say when advantages were fitted")
    known = msgspec.structs.asdict(document)
    values = {
        "incumbent": document.incumbent.policy(path),
        "challengers": tuple(text.policy(path) for text in document.challengers),
        "own": tuple(document.own),
        "fitted": fitted and (fitted.steps, fitted.episodes, _chance_from(path, fitted.chance)),
        "chance": document.chance and _chance_from(path, document.chance),
    }
    return SearchState(**known | values)


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
    stored = {name: arrays.pop(name) for name in EPISODES.arrays if name in arrays}
    if not stored:
        return []
    found = part(taken(path, stored, Declared(n_features, n_actions, (EPISODES,))), _PREFIX)
    starts = np.cumsum(found["lengths"]) - found["lengths"]
    return [_episode(found, k, start) for k, start in enumerate(starts.tolist())]


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
