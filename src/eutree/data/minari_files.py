"""Demonstrations as Minari datasets, and back (extra ``minari``).

Facts that Minari has no place for (names and units, endings, comments) travel as documents in the
metadata, under the key ``eutree``, and step records travel in ``infos``, so that an export is
imported again to the bit. Other readers see an ordinary dataset. Discarded episodes, and
episodes without a step, are not exported.
"""

import copy
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.data.episode import Episode
from eutree.data.files import (
    STEPS,
    DemonstrationsDocument,
    EpisodeDocument,
    demonstrations_document,
    episode_document,
    episode_from_document,
)
from eutree.errors import EutreeError, FileError, FormatError, InvalidArgumentError, needed, warn
from eutree.files.documents import decode_document, encode_document
from eutree.files.schema_document import environment_from_document, schema_from_document
from eutree.schema import EnvironmentSpec, Feature, Schema

KEY = "eutree"
ENV_SPEC = "env_spec"  # Minari's own key, read by ``recover_environment``

_ID = re.compile(r"(?:[-_\w]+/)*[-_\w]+-v\d+")
_Content = tuple[tuple[Episode, ...], Schema, EnvironmentSpec | None, str]


def read_minari(dataset_id: str) -> _Content:
    """Return the fields of the ``Demonstrations`` in Minari's local folder, in their order.

    Raises:
        FileError: There is no such dataset; it can be fetched with ``minari download``.
        FormatError: Its spaces are not a flat observation and a discrete action.
        MissingExtraError: Minari is not installed.
    """
    minari, name = _minari(), f"minari:{_checked_id(dataset_id)}"
    with _as_format_errors(name):
        try:
            dataset = minari.load_dataset(dataset_id)
        except FileNotFoundError:
            reason = f"no such dataset here; get it with: minari download {dataset_id}"
            raise FileError("read", name, reason) from None
        metadata = dataset.storage.metadata
        space = _space(dataset.observation_space, name)
        action_space = _space(dataset.action_space, name)
        if action_space["type"] != "Discrete":
            raise FormatError(name, "action_space", f"must be Discrete, got {action_space['type']}")
        schema, environment, expert = _header(dataset, metadata, space, action_space["n"], name)
        notes = dataset.storage.get_episode_metadata(dataset.episode_indices)
        pairs = zip(dataset.iterate_episodes(), notes, strict=True)
        episodes = tuple(
            _episode(data, note, action_space["start"], f"{name} episode {number}")
            for number, (data, note) in enumerate(pairs)
        )
    return episodes, schema, environment, expert


def write_minari(dataset_id: str, content: _Content) -> None:
    """Write a new dataset, ``eutree/evasion2/human-v0`` say, into Minari's local folder.

    With it goes the environment, for ``recover_environment``. Where it is not registered, or cannot
    be written as text, there is a warning and the dataset stores none.

    Raises:
        FileError: The dataset exists, or cannot be written.
        MissingExtraError: Minari is not installed.
    """
    minari, name = _minari(), f"minari:{_checked_id(dataset_id)}"
    recorded, schema, environment, expert = content
    episodes = [episode for episode in recorded if episode.kept and len(episode)]
    if not episodes:
        raise InvalidArgumentError(f"cannot write {name}: there is no kept episode with a step")
    buffers = [_buffer(number, episode) for number, episode in enumerate(episodes)]
    notes = [{KEY: encode_document(episode_document(episode)).decode()} for episode in episodes]
    header = demonstrations_document(schema, environment, expert)
    gymnasium_spaces = import_module("gymnasium").spaces  # comes with Minari
    low, high = np.array([(feature.low, feature.high) for feature in schema.features]).T
    metadata = {KEY: encode_document(header).decode()}
    if environment is not None:
        metadata |= _env_spec(environment, name)
    with _quiet():
        try:
            dataset = minari.create_dataset_from_buffers(
                dataset_id,
                buffers,
                observation_space=gymnasium_spaces.Box(low, high, dtype=np.float64),
                action_space=gymnasium_spaces.Discrete(schema.n_actions),
                algorithm_name=expert,
                jpeg_encoding=False,
            )
            dataset.storage.update_metadata(metadata)
            dataset.storage.update_episode_metadata(notes)
        except (OSError, ValueError, TypeError, AssertionError) as error:
            raise FileError("write", name, str(error) or type(error).__name__) from error


def _env_spec(environment: EnvironmentSpec, name: str) -> dict[str, str]:
    """Return the spec for Minari to make the environment: Gymnasium's, with arguments, as text.

    Only registered ids are looked up. The environment is not made, as Minari itself would: an
    environment may need its arguments, and its spaces need not be those of the features.
    """
    registry = import_module("gymnasium").registry  # comes with Minari; learners never see it
    spec = copy.deepcopy(registry.get(environment.id))
    try:
        if spec is None:
            raise ValueError(f"{environment.id} is not registered; import the module that does so")
        if "action_grid" in environment.arguments:
            raise ValueError("Minari cannot store a wrapper, and its actions are laid on a grid")
        arguments = dict(environment.arguments)
        for field in ("max_episode_steps", "disable_env_checker"):  # gymnasium.make's own
            setattr(spec, field, arguments.pop(field, getattr(spec, field)))
        spec.kwargs.update(arguments)
        return {ENV_SPEC: spec.to_json()}
    except (TypeError, ValueError) as error:
        warn(f"{name} stores no env_spec: {error}")
        return {}


def _minari() -> Any:
    with needed("minari", "minari"):
        return import_module("minari")


def _checked_id(dataset_id: str) -> str:
    if not _ID.fullmatch(dataset_id):
        raise InvalidArgumentError(
            "the id of a Minari dataset must be made of letters, digits, - and _, with / between "
            f"the parts, and end in a version like -v0; got {dataset_id!r}"
        )
    return dataset_id


@contextmanager
def _quiet() -> Iterator[None]:
    """Ignore Minari's warnings about metadata that we do not give."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@contextmanager
def _as_format_errors(name: str) -> Iterator[None]:
    """Turn any error of Minari and HDF5 on a damaged dataset into a FormatError."""
    with _quiet():
        try:
            yield
        except EutreeError:
            raise
        except Exception as error:
            reason = f"not a readable Minari dataset: {type(error).__name__}: {error}"
            raise FormatError(name, "", reason) from error


def _space(space: Any, name: str) -> dict[str, Any]:
    """Return a space in Minari's own description of it."""
    serialize = import_module("minari.serialization").serialize_space
    description: dict[str, Any] = serialize(space, to_string=False)
    flat = description["type"] in ("Discrete", "MultiDiscrete", "MultiBinary")
    if not flat and not (description["type"] == "Box" and len(description["shape"]) == 1):
        raise FormatError(name, "observation_space", f"must be flat, got {space}")
    return description


def _header(
    dataset: Any, metadata: dict[str, Any], space: dict[str, Any], n_actions: int, name: str
) -> tuple[Schema, EnvironmentSpec | None, str]:
    if KEY in metadata:
        document = decode_document(str(metadata[KEY]).encode(), DemonstrationsDocument, name)
        schema = schema_from_document(document.schema, name)
        return schema, environment_from_document(document.environment, name), document.expert
    spec, environment = dataset.env_spec, None
    if spec is not None:
        arguments = {key: value for key, value in spec.kwargs.items() if key != "render_mode"}
        if spec.max_episode_steps is not None:
            arguments["max_episode_steps"] = spec.max_episode_steps
        environment = EnvironmentSpec(spec.id, arguments, frozenset(arguments))
    actions = Schema.anonymous(1, n_actions).actions
    expert = str(metadata.get("algorithm_name") or dataset.id)
    return Schema(_features(space), actions), environment, expert


def _features(space: dict[str, Any]) -> tuple[Feature, ...]:
    if space["type"] == "Box":
        bounds = list(zip(space["low"], space["high"], strict=True))
    elif space["type"] == "Discrete":
        bounds = [(space["start"], space["start"] + space["n"] - 1)]
    elif space["type"] == "MultiDiscrete":
        bounds = [(low, low + n - 1) for low, n in zip(space["start"], space["nvec"], strict=True)]
    else:
        bounds = [(0, 1)] * int(space["n"])
    is_whole = space["type"] != "Box" or not np.issubdtype(space["dtype"], np.floating)
    return tuple(
        Feature(f"x{i}", low=float(low), high=float(high), is_integer=is_whole)
        for i, (low, high) in enumerate(bounds)
    )


def _episode(data: Any, note: dict[str, Any], first_action: int, name: str) -> Episode:
    observations = np.asarray(data.observations, dtype=np.float64)
    arrays: dict[str, NDArray[Any]] = {
        "observations": observations[:, np.newaxis] if observations.ndim == 1 else observations,
        "actions": np.asarray(data.actions, dtype=np.int64) - first_action,
        "rewards": np.asarray(data.rewards, dtype=np.float64),
    }
    if KEY in note:
        document = decode_document(str(note[KEY]).encode(), EpisodeDocument, name)
        infos = (data.infos or {}).items()
        arrays |= {key: np.asarray(rows) for key, rows in infos if key.startswith(STEPS)}
        return episode_from_document(document, arrays, name)
    terminated = bool(np.any(data.terminations))
    truncated = bool(np.any(data.truncations)) and not terminated
    document = EpisodeDocument(
        seed=note.get("seed"),
        ending="terminated" if terminated else "truncated" if truncated else "",
        terminated=terminated,
        truncated=truncated,
        is_success=None,
        kept=True,
        comment="",
        extras={},
    )
    return episode_from_document(document, arrays, name)


def _buffer(number: int, episode: Episode) -> Any:
    buffer = import_module("minari.data_collector.episode_buffer").EpisodeBuffer
    last = np.arange(len(episode)) == len(episode) - 1
    fits = episode.seed is not None and episode.seed < 2**63
    return buffer(
        id=number,
        seed=episode.seed if fits else None,
        observations=episode.observations,
        actions=episode.actions,
        rewards=episode.rewards,
        terminations=last & episode.terminated,
        truncations=last & episode.truncated,
        infos={STEPS + name: array for name, array in episode.steps.items()} or None,
    )
