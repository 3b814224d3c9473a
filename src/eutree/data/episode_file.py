"""One episode as an archive: its arrays, and a document with everything else."""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eutree.data.episode import Episode
from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import Document
from eutree.files.arrays import MAX_ARCHIVE, decode_archive, encode_archive
from eutree.files.schema_document import plain_json
from eutree.validation import check_finite

_STEPS = "steps_"


class EpisodeDocument(Document, frozen=True, kw_only=True, omit_defaults=True):
    """What an episode's file says beside its arrays."""

    FORMAT: ClassVar[str] = "eutree/episode"
    VERSION: ClassVar[int] = 2

    seed: int | None
    ending: str
    terminated: bool
    truncated: bool
    is_success: bool | None
    kept: bool
    comment: str
    extras: dict[str, Any]
    has_rewards: bool = True


def episode_to_bytes(episode: Episode) -> bytes:
    """Return the content of the episode's file; the same episode gives the same bytes.

    Raises:
        InvalidArgumentError: An observation or a reward is not finite.
    """
    check_finite("observations", episode.observations)
    check_finite("rewards", episode.rewards)
    arrays: dict[str, NDArray[Any]] = {
        "observations": episode.observations,
        "actions": episode.actions,
        "rewards": episode.rewards,
    }
    arrays |= {_STEPS + name: array for name, array in episode.steps.items()}
    data = encode_archive(arrays, episode_document(episode))
    if len(data) > MAX_ARCHIVE:  # never write what could not be read
        raise InvalidArgumentError(f"{len(data):,} bytes are more than the {MAX_ARCHIVE:,} allowed")
    return data


def episode_document(episode: Episode) -> EpisodeDocument:
    """Return what is to be written beside the arrays."""
    return EpisodeDocument(
        seed=episode.seed,
        ending=episode.ending,
        terminated=episode.terminated,
        truncated=episode.truncated,
        is_success=episode.is_success,
        kept=episode.kept,
        comment=episode.comment,
        extras=plain_json(episode.extras, "extras"),
        has_rewards=episode.has_rewards,
    )


def episode_from_bytes(data: bytes, path: str | Path) -> Episode:
    """Return the episode that the bytes hold, all rules checked; ``path`` is for the messages."""
    document, arrays = decode_archive(data, EpisodeDocument, path)
    steps = {
        name.removeprefix(_STEPS): arrays.pop(name)
        for name in sorted(arrays)
        if name.startswith(_STEPS)
    }
    for name, element_type in {"observations": "<f8", "actions": "<i8", "rewards": "<f8"}.items():
        if name not in arrays:
            raise FormatError(path, f"{name}.npy", "missing")
        if arrays[name].dtype.str != element_type:
            reason = f"must hold {np.dtype(element_type)}, got {arrays[name].dtype}"
            raise FormatError(path, f"{name}.npy", reason)
    if len(arrays) > 3:
        unexpected = sorted(set(arrays) - {"observations", "actions", "rewards"})
        raise FormatError(path, f"{unexpected[0]}.npy", "unexpected member")
    return episode_from_document(document, arrays, steps, path)


def episode_from_document(
    document: EpisodeDocument,
    arrays: dict[str, NDArray[Any]],
    steps: dict[str, NDArray[Any]],
    path: str | Path,
) -> Episode:
    """Return the episode of a document, of ``observations``, ``actions``, ``rewards``, and steps.

    Raises:
        FormatError: They do not fit each other, or hold NaN or an infinity; ``path`` is blamed.
    """
    if document.seed is not None and document.seed < 0:
        raise FormatError(path, "seed", f"must be >= 0, got {document.seed}")
    try:
        check_finite("observations", arrays["observations"])
        check_finite("rewards", arrays["rewards"])
        return Episode(
            **arrays,
            terminated=document.terminated,
            truncated=document.truncated,
            seed=document.seed,
            ending=document.ending,
            is_success=document.is_success,
            kept=document.kept,
            comment=document.comment,
            steps=steps,
            extras=document.extras,
            has_rewards=document.has_rewards,
        )
    except InvalidArgumentError as error:
        raise FormatError(path, "", str(error)) from None
