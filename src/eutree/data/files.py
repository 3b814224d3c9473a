"""A folder of demonstrations: a header, one archive for each episode, journals of running ones.

    demos/
        demonstrations.json      schema, environment, expert
        episode-00000.npz        a finished episode, written atomically
        episode-00001.journal    the episode that is being recorded, or that a crash left

A number is taken by making the journal, which fails if the file exists: so two recorders in one
folder never write the same episode. Nothing else lists the episodes; the folder itself does.
"""

import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.data.episode import Episode
from eutree.data.journal import EpisodeJournal, recover_episode
from eutree.errors import FileError, FormatError, InvalidArgumentError, blamed
from eutree.features import Derivation
from eutree.files import Document, atomic, read_document
from eutree.files.arrays import MAX_ARCHIVE, decode_archive, encode_archive
from eutree.files.documents import encode_document
from eutree.files.schema_document import (
    EnvironmentDocument,
    SchemaDocument,
    environment_from_document,
    environment_to_document,
    plain_json,
    schema_from_document,
    schema_to_document,
)
from eutree.schema import EnvironmentSpec, Schema
from eutree.validation import check_finite

_ARRAYS = {"observations": "<f8", "actions": "<i8", "rewards": "<f8"}
STEPS = "steps_"  # before the name of an array of ``Episode.steps``


class EpisodeDocument(Document, frozen=True, kw_only=True, omit_defaults=True):
    """The facts in an episode's file beside its arrays."""

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


_SAID = [n for n in EpisodeDocument.__struct_fields__ if n not in Document.__struct_fields__]


def episode_to_bytes(episode: Episode) -> bytes:
    """Return the content of the episode's file; the same episode gives the same bytes.

    Raises:
        InvalidArgumentError: An observation or a reward is not finite.
    """
    check_finite("observations", episode.observations)
    check_finite("rewards", episode.rewards)
    arrays = {name: getattr(episode, name) for name in _ARRAYS}
    arrays |= {STEPS + name: array for name, array in episode.steps.items()}
    data = encode_archive(arrays, episode_document(episode))
    if len(data) > MAX_ARCHIVE:  # never write a file too large to read
        raise InvalidArgumentError(f"{len(data):,} bytes are more than the {MAX_ARCHIVE:,} allowed")
    return data


def episode_document(episode: Episode) -> EpisodeDocument:
    """Return the facts to be written beside the arrays."""
    said = {name: getattr(episode, name) for name in _SAID}
    return EpisodeDocument(**said | {"extras": plain_json(episode.extras, "extras")})


def episode_from_bytes(data: bytes, path: str | Path) -> Episode:
    """Return the episode that the bytes hold, all rules checked; ``path`` is for the messages."""
    document, arrays = decode_archive(data, EpisodeDocument, path)
    for name, element_type in _ARRAYS.items():
        if name not in arrays:
            raise FormatError(path, f"{name}.npy", "missing")
        if arrays[name].dtype.str != element_type:
            reason = f"must hold {np.dtype(element_type)}, got {arrays[name].dtype}"
            raise FormatError(path, f"{name}.npy", reason)
    if unexpected := sorted(n for n in arrays.keys() - _ARRAYS if not n.startswith(STEPS)):
        raise FormatError(path, f"{unexpected[0]}.npy", "unexpected member")
    return episode_from_document(document, arrays, path)


def episode_from_document(
    document: EpisodeDocument, arrays: dict[str, NDArray[Any]], path: str | Path
) -> Episode:
    """Return the episode of a document and of its arrays, which are named as in its file.

    Raises:
        FormatError: They do not fit each other, or hold NaN or an infinity; ``path`` is blamed.
    """
    if document.seed is not None and document.seed < 0:
        raise FormatError(path, "seed", f"must be >= 0, got {document.seed}")
    with blamed(path):
        check_finite("observations", arrays["observations"])
        check_finite("rewards", arrays["rewards"])
        said: dict[str, Any] = {name: getattr(document, name) for name in _SAID}
        said |= {name: arrays[name] for name in _ARRAYS}
        named = sorted(name for name in arrays if name.startswith(STEPS))
        return Episode(**said, steps={name.removeprefix(STEPS): arrays[name] for name in named})


HEADER = "demonstrations.json"

_EPISODE = re.compile(r"episode-(\d{5,9})\.(npz|journal)")


class DemonstrationsDocument(Document, frozen=True, kw_only=True):
    """The header of a folder of demonstrations."""

    FORMAT: ClassVar[str] = "eutree/demonstrations"
    VERSION: ClassVar[int] = 1

    environment: EnvironmentDocument | None
    schema: SchemaDocument
    expert: str


class DemonstrationFolder:
    """An existing folder of demonstrations, to read, to add to and to edit.

    Args:
        path: The path of the folder.

    Raises:
        FormatError: The folder holds no demonstrations, or its header is damaged.
        FileError: The folder is missing or cannot be read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        header = self.path / HEADER
        with atomic.reported("read", path):
            if not self.path.exists():
                raise FileError("read", path, "no such folder of demonstrations")
            if not header.exists():
                reason = f"there is no file {HEADER}"
                if self.path.is_file():
                    reason = "it is no folder, and a log is read by eutree demos import"
                raise FormatError(path, "", f"holds no demonstrations: {reason}")
        document = read_document(header, DemonstrationsDocument)
        self.schema = schema_from_document(document.schema, header)
        self.environment = environment_from_document(document.environment, header)
        self.expert = document.expert

    @classmethod
    def create(
        cls,
        path: str | Path,
        schema: Schema,
        environment: EnvironmentSpec | None = None,
        expert: str = "",
    ) -> "DemonstrationFolder":
        """Make the folder, or open it if it holds demonstrations of the same environment.

        Raises:
            InvalidArgumentError: It holds demonstrations of another environment.
            FileError: It cannot be written.
        """
        folder = Path(path)
        if not (folder / HEADER).exists():
            header, is_new = _header(schema, environment, expert), not folder.exists()
            atomic.make_folder(folder, of=atomic.DEMONSTRATIONS)
            try:
                atomic.write_bytes(folder / HEADER, header)
            except BaseException:
                with suppress(OSError):
                    if is_new:
                        folder.rmdir()
                raise
        opened = cls(folder)
        opened.check_same(schema, environment)
        return opened

    def check_same(self, schema: Schema, environment: EnvironmentSpec | None) -> None:
        """Raise InvalidArgumentError unless the folder is of this schema and environment."""
        if environment_to_document(environment) != environment_to_document(self.environment):
            mine, other = (e or "an unnamed environment" for e in (self.environment, environment))
            raise InvalidArgumentError(
                f"{self.path} holds demonstrations of {mine}, not of {other}; choose another folder"
            )
        are_derived_alike = Derivation.of(self.schema) == Derivation.of(schema)
        if not (are_derived_alike and schema.is_unnamed_form_of(self.schema)):
            raise InvalidArgumentError(
                f"{self.path} holds demonstrations with other features or actions; "
                "choose another folder"
            )

    def numbers(self) -> list[int]:
        """Return the numbers of the finished episodes, in order."""
        return self._numbers("npz")

    def episode_path(self, number: int) -> Path:
        """Return the file of an episode."""
        return self.path / _name(number)

    def read(self, number: int) -> Episode:
        """Read one finished episode.

        Raises:
            InvalidArgumentError: There is no episode of that number.
            FormatError: Its file is damaged.
        """
        if number not in self.numbers():
            raise InvalidArgumentError(f"{self.path} has no episode {number}")
        path = self.episode_path(number)
        data = atomic.read_bytes(path, limit=MAX_ARCHIVE)
        return self._fitting(episode_from_bytes(data, path), path)

    def read_all(self) -> dict[int, Episode]:
        """Read all episodes, those that dead recorders left in their journals included."""
        episodes = {number: self.read(number) for number in self.numbers()}
        for number in self._abandoned():
            path = self._journal_path(number)
            episode = None if number in episodes else recover_episode(path)
            if episode is not None:
                episodes[number] = self._fitting(episode, path)
        return dict(sorted(episodes.items()))

    def append(self, episode: Episode) -> int:
        """Write one more episode and return its number, which no other process has taken."""
        running = self.start_episode(np.zeros(self.schema.n_features))
        try:
            running.finish(episode)
        except BaseException:
            running.discard()
            raise
        return running.number

    def rename(self, schema: Schema) -> None:
        """Give features and actions other names and units; the recorded numbers stay."""
        atomic.write_bytes(self.path / HEADER, _header(schema, self.environment, self.expert))
        self.schema = schema

    def write(self, number: int, episode: Episode) -> None:
        """Write or replace an episode, atomically."""
        if problem := misfit(episode, self.schema):
            raise InvalidArgumentError(f"the episode {problem}")
        atomic.write_bytes(self.episode_path(number), _content(number, episode))

    def start_episode(
        self,
        observation: ArrayLike,
        *,
        seed: int | None = None,
        extras: dict[str, Any] | None = None,
    ) -> "RunningEpisode":
        """Open the journal of a new episode; ``finish`` it when it is over."""
        while True:
            number = self.next_number()
            path = self._journal_path(number)
            try:
                journal = EpisodeJournal(path, observation, seed=seed, extras=extras)
            except FileError as error:
                if isinstance(error.__cause__, FileExistsError):
                    continue  # another process was first
                raise
            if not self.episode_path(number).exists():
                return RunningEpisode(self, number, journal)
            journal.discard()  # it has finished meanwhile

    def recover(self) -> list[int]:
        """Turn the journals of dead recorders into episodes; return their numbers.

        A journal without a step is removed, and so is one whose episode was finished.
        """
        recovered = []
        for number in self._abandoned():
            path = self._journal_path(number)
            episode = None if self.episode_path(number).exists() else recover_episode(path)
            if episode is not None:
                self.write(number, episode)
                recovered.append(number)
            atomic.remove_file(path)
        return recovered

    def _fitting(self, episode: Episode, path: Path) -> Episode:
        """Return the episode of a file if it fits the schema."""
        if problem := misfit(episode, self.schema):
            raise FormatError(path, "", problem)
        return episode

    def _abandoned(self) -> list[int]:
        """Return the numbers of the journals of dead recorders."""
        return [n for n in self._numbers("journal") if not atomic.is_locked(self._journal_path(n))]

    def _journal_path(self, number: int) -> Path:
        return self.path / f"episode-{number:05d}.journal"

    def next_number(self) -> int:
        """Return the number that the next episode will get, by any process."""
        return max(self._numbers("npz") + self._numbers("journal"), default=-1) + 1

    def _numbers(self, kind: str) -> list[int]:
        with atomic.reported("read", self.path):
            names = [path.name for path in self.path.iterdir()]
        matches = filter(None, map(_EPISODE.fullmatch, names))
        return sorted(int(match[1]) for match in matches if match[2] == kind)


class RunningEpisode:
    """An episode under way: its number, its journal, and how to end it."""

    def __init__(self, folder: DemonstrationFolder, number: int, journal: EpisodeJournal) -> None:
        self._folder = folder
        self.number = number
        self.journal = journal

    def finish(self, episode: Episode) -> None:
        """Write the finished episode under its number; the journal goes."""
        self._folder.write(self.number, episode)
        self.journal.discard()

    def discard(self) -> None:
        """Forget the episode; the journal goes."""
        self.journal.discard()


def save_folder(
    path: str | Path,
    episodes: Iterable[Episode],
    schema: Schema,
    environment: EnvironmentSpec | None,
    expert: str,
) -> None:
    """Write a new folder of demonstrations, completely or not at all."""
    files = {HEADER: _header(schema, environment, expert)}
    files |= {_name(number): _content(number, one) for number, one in enumerate(episodes)}
    atomic.write_folder(path, files)


def _name(number: int) -> str:
    return f"episode-{number:05d}.npz"


def _content(number: int, episode: Episode) -> bytes:
    try:
        return episode_to_bytes(episode)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"episode {number}: {error}") from None


def _header(schema: Schema, environment: EnvironmentSpec | None, expert: str) -> bytes:
    return encode_document(demonstrations_document(schema, environment, expert))


def demonstrations_document(
    schema: Schema, environment: EnvironmentSpec | None, expert: str
) -> DemonstrationsDocument:
    """Return the header of demonstrations."""
    return DemonstrationsDocument(
        environment=environment_to_document(environment),
        schema=schema_to_document(schema),
        expert=expert,
    )


def misfit(episode: Episode, schema: Schema) -> str:
    """Return why the episode does not fit the schema, or an empty string."""
    size = episode.observations.shape[1]
    if size != schema.n_features:
        return f"must have observations of {schema.n_features} features, got {size}"
    if len(episode) and (episode.actions.min() < 0 or episode.actions.max() >= schema.n_actions):
        low, high = episode.actions.min(), episode.actions.max()
        return f"must have actions in 0..{schema.n_actions - 1}, got {low}..{high}"
    if (allowed := episode.allowed) is None:
        return ""
    if allowed.shape[1:] != (schema.n_actions,):
        return f"must have masks of {schema.n_actions} actions, got shape {allowed.shape}"
    forbidden = np.flatnonzero(~allowed[np.arange(len(episode)), episode.actions])
    if forbidden.size:
        step = int(forbidden[0])
        return f"must allow the actions taken, but masks action {episode.actions[step]} in {step=}"
    return ""
