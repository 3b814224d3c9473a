"""A session with a folder: its outputs are stored before anything is shown."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium

from eutree.data import DemonstrationFolder, RunningEpisode
from eutree.errors import FileError, FormatError
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import Stream
from eutree.interaction.first_look import look_at
from eutree.recording.events import (
    EpisodeChanged,
    EpisodeEnded,
    EpisodeStarted,
    Event,
    Output,
    SessionSettings,
    StepTaken,
    Tick,
)
from eutree.recording.keys import KeyMap, keys_of_environment, parse_keys
from eutree.recording.session import Session, check_is_seen

PERSON = "a person"


class Recorder:
    """A session whose episodes go into a folder of demonstrations.

    A finished episode is written at once and completely; the running one is in a journal, step by
    step, so that the death of the process loses at most the step in flight. An existing folder of
    the same environment is continued; the journal of a dead recorder becomes an episode that
    ended ``"interrupted"``.

    Args:
        env: The environment, made with ``render_mode="rgb_array"``.
        folder: The folder of the recording.
        keys: The meaning of the keys, as text (``"left=0,right=1"``) or as a map; None for the
            environment's own.
        settings: The session's settings; ``first`` is set to follow the folder's last episode.

    Raises:
        InvalidArgumentError: The folder holds demonstrations of another environment, or the keys
            name an unknown key or action.
        FileError: The folder cannot be written.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        folder: str | Path,
        *,
        keys: str | KeyMap | None = None,
        settings: SessionSettings | None = None,
    ) -> None:
        guarded = GuardedEnv(env)
        if isinstance(keys, str):
            keys = parse_keys(keys, guarded.schema)
        keys = keys or keys_of_environment(env, guarded.schema)
        check_is_seen(guarded)  # before there is a folder
        self.folder = DemonstrationFolder.create(folder, guarded.schema, guarded.spec, PERSON)
        self.recovered = self.folder.recover()
        recorded = sorted(self.folder.read_all().items())
        self._running: RunningEpisode | None = None
        self._failure: FileError | None = None
        settings = settings or SessionSettings()
        look_at(env, None if recorded else episode_seed(settings.seed, 0, Stream.PERSON))
        first = max([settings.first, *(number + 1 for number, _ in recorded)])
        self.session = Session(
            guarded,
            keys=keys,
            settings=replace(settings, first=first),
            recorded=recorded,
            free_start=self.folder.next_number,
        )

    def tick(self, now: float, events: Iterable[Event] = ()) -> Tick:
        """Pass the events to the session; store its outputs, then return its answer."""
        tick = self.session.tick(now, events)
        try:
            for output in tick.outputs:
                self._store(output)
        except FileError as error:
            self._fail(error)
            return self.session.tick(now)
        return tick

    def close(self) -> None:
        """Leave the running episode in its journal, to be found as ``"interrupted"``."""
        if self._running is not None:
            self._running.journal.close()
            self._running = None
            self.folder.recover()

    def raise_failure(self) -> None:
        """Raise the error that ended the session: a fault of the environment or of the folder."""
        failure = self._failure or self.session.fault
        if failure is not None:
            raise failure

    def _fail(self, error: FileError) -> None:
        """End the session: of its episodes there is what was written before the disk was full."""
        self._failure, recording = error, self.session.recording
        numbers = dict.fromkeys(recording.numbers)
        if self._running is not None:
            numbers[self._running.number] = None
            with suppress(FileError):
                self._running.journal.close()
            self._running = None
        with suppress(FileError, FormatError):
            stored = self.folder.read_all()
            recording.numbers = [number for number in numbers if number in stored]
            recording.episodes = [stored[number] for number in recording.numbers]
        self.session.play.trial.is_over = True
        self.session.fail(str(error))

    def _store(self, output: Output) -> None:
        recording = self.session.recording
        if isinstance(output, EpisodeStarted):
            self._running = self.folder.start_episode(
                output.observation, seed=output.seed, extras=output.extras
            )
            recording.number = self._running.number
        elif isinstance(output, EpisodeChanged):
            self.folder.write(recording.numbers[output.index], output.episode)
        elif self._running is not None:
            if isinstance(output, StepTaken):
                self._running.journal.append(**vars(output))
                return
            if isinstance(output, EpisodeEnded):
                self._running.finish(output.episode)
                recording.numbers[output.index] = self._running.number
            else:
                self._running.discard()
            self._running = None
