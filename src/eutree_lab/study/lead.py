"""A study: the same parts for each person, one after the other, on the recorder's page.

Consent, practice, demonstrations, watching the tree, taking over, questions: each part begins when
the one before is over, and only its own buttons are obeyed. The page shows the fields of ``view``.
"""

import os
import secrets
import shutil
import tomllib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import msgspec

from eutree.data import Demonstrations
from eutree.errors import FileError, InvalidArgumentError, shown
from eutree.files import locked, make_folder, read_document, write_bytes, write_document
from eutree.files.schema_document import environment_to_document
from eutree.fitting.page_tree import PageTree
from eutree.interaction.making import make
from eutree.recording import Recorder, SessionSettings
from eutree.recording.events import Away, Command, Event
from eutree.recording.play import COUNTDOWN, FINISHED, OPENING, PLAYING, REVIEW
from eutree.recording.views import never_ends
from eutree.schema import EnvironmentSpec
from eutree_lab.study import archive
from eutree_lab.study import plan as parts
from eutree_lab.study.plan import Counts, Files, StudyPlan, is_whole, open_plan, plan_files, usual

if TYPE_CHECKING:
    import gymnasium

    from eutree.recording.scenes import Programme
    from eutree.recording.tree_making import Show, TreeView


@contextmanager
def conduct(
    study: Path,
    spec: EnvironmentSpec,
    env: "gymnasium.Env[Any, Any]",
    *,
    person: str | None = None,
    keys: str | None = None,
    pace: SessionSettings,
) -> "Iterator[tuple[Recorder, StudyTree, Study]]":
    """Yield the recorder of a person of a study, the maker of their tree, and their guide.

    Args:
        study: The folder of the study; missing files in it are made.
        spec: How to make the environment again.
        env: The environment, made with ``render_mode="rgb_array"``.
        person: The code of the person to go on with; None for a new person.
        keys: Meaning of the keys, as text; None for the environment's own.
        pace: Decisions per second, and whether the sensed numbers are shown.

    Raises:
        InvalidArgumentError: There is no such person to go on with, the environment need not end,
            or the study is another one than those before have taken part in.
        RunFolderError: Another recorder leads this person.
        FormatError: The plan is not valid.
    """
    if never_ends(env):
        raise InvalidArgumentError(
            f"{spec} must end by itself: give a limit, for example --env-arg max_episode_steps=200"
        )
    files = plan_files(study)
    plan, _, protocol = open_plan(study, spec, keys, pace.fps, pace.hud, files=files)
    _check_same(study, protocol)
    if person is not None and not (parts.PERSON.fullmatch(person) and (study / person).is_dir()):
        raise InvalidArgumentError(f"{study} has no person {shown(person)} to go on with")
    folder = make_folder(study / (person or secrets.token_hex(4)))
    settings = replace(pace, target=plan.episodes, seed=plan.seed, viewer="browser", makes=True)
    with _held(folder), ExitStack() as at_the_end:
        recorder = Recorder(env, folder / archive.DEMOS, keys=keys, settings=settings)
        maker = StudyTree(folder, spec, plan)
        guide = Study(recorder, maker, plan, protocol, files)
        at_the_end.callback(guide.clear)
        yield recorder, maker, guide


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Hold the lock of a person's folder; it goes with the lock where nothing else is in it."""
    descriptor = locked(folder, "another recorder leads this person")
    try:
        yield
    finally:
        os.close(descriptor)  # some systems delete no file that is open
        if not any(path.is_file() and path.name != ".lock" for path in folder.rglob("*")):
            shutil.rmtree(folder, ignore_errors=True)


def _check_same(study: Path, protocol: str) -> None:
    """Raise InvalidArgumentError if an earlier person took part in another study."""
    records = study.glob(f"{'[0-9a-f]' * 8}/{archive.PERSON_FILE}")
    for path in (*archive.archives(study), *records):
        with TemporaryDirectory() as name:
            known = archive.read_person(path, Path(name))
        if known is not None and known.protocol != protocol:
            raise InvalidArgumentError(
                f"{study} must be the same for each person, and {known.person} took part with "
                "another environment, option, study.toml or consent.md: begin a new folder"
            )


class Study:
    """Leads one person through a study; a ``Guide``.

    Args:
        recorder: Records into the folder ``demos`` of the person's folder.
        maker: Makes the tree.
        plan: The plan, the same for each person.
        protocol: Digest of all that is the same for each person.
        files: Plan and text as they were read; kept with the person who agrees.
    """

    def __init__(
        self, recorder: Recorder, maker: "StudyTree", plan: StudyPlan, protocol: str, files: Files
    ) -> None:
        self._recorder, self._maker, self._plan = recorder, maker, plan
        self._session, self._protocol, self._files = recorder.session, protocol, files
        self._consent = files[parts.CONSENT_TEXT].decode("utf-8-sig")
        self._counts = Counts(recorder.session, plan)
        self._folder = recorder.folder.path.parent
        self._parts = [
            part for part in parts.PARTS if getattr(plan, parts.COUNTED.get(part, "episodes"))
        ]
        self._words = tomllib.loads(usual(parts.WORDS))
        self._seconds: dict[str, float] = {}
        self.answers = [""] * len(plan.questions)
        self.part = parts.CONSENT
        self._begun = self._is_started = True
        self._asks = self._leaves = self._is_packed = False
        self._now: float | None = None
        self._due: float | None = None
        self._next_store, self._stored = 0.0, list[object]()
        self._versions = archive.versions()
        self._go_back()

    # ---- buttons and answers of the person

    def hear(self, name: str, place: int = 0, text: str = "") -> None:
        """Take in a button of the study's own: see ``_view``."""
        if (name == "delete" and self._asks) or (name == "decline" and self.part == parts.CONSENT):
            self._delete()
        elif name in ("withdraw", "stay"):
            self._asks = name == "withdraw" and self.part not in (parts.CONSENT, parts.DELETED)
        elif name == "answer" and self.part == parts.QUESTIONS and place < len(self.answers):
            options = self._plan.questions[place].options
            if not text or not options or text in options:
                self.answers[place] = text[: parts.MAX_ANSWER]
        elif name == "agree" and self.part == parts.CONSENT:
            for file, data in self._files.items():
                write_bytes(self._folder / file, data)
            self._go_on()
        elif name == "begin" and not self._begun:
            self._begun, self._is_started = True, False
        elif name == "send" and self.part == parts.QUESTIONS:
            self._go_on()
        elif name == "leave":
            self._leaves = self.part == parts.THANKS

    # ---- the course of the study

    def advance(self, now: float) -> list[Event]:
        """Go on to the next part if this one is over; return the session's next events."""
        if self._now is not None:
            self._seconds[self.part] = self._seconds.get(self.part, 0.0) + now - self._now
        self._now = now
        if self.part == parts.DELETED:
            return []
        is_new = self.part not in (parts.CONSENT, parts.THANKS) and self._stored != self._news()
        if is_new and now >= self._next_store:  # not at each letter
            self._next_store = now + 1.0
            with suppress(FileError):
                self._store()
        session, is_on = self._session, self._begun and not self._asks
        if is_on and self._is_over(now):
            self._go_on()
            is_on = self._begun
        goes_on = is_on and not self._counts.is_enough(self.part)
        session.allowed = parts.ALLOWED.get(self.part, ()) if goes_on else ()
        if self._asks:
            moves = session.state in (COUNTDOWN, PLAYING)
            moves = moves or (session.driving.is_on and not session.driving.waits)
            return [Away("The study waits for you.")] if moves else []
        return self._wanted(now) if is_on else []

    def _is_over(self, now: float) -> bool:
        """Return whether the present part is over."""
        session, driving = self._session, self._session.driving
        enough = self._counts.is_enough(self.part)
        if self.part in (parts.PRACTICE, parts.SHOWING):
            if self.part == parts.PRACTICE:
                self._counts.set_practice_aside()
            return enough and self._was_read(now, session.state in (OPENING, REVIEW))
        if self.part == parts.MAKING:
            shown = driving.is_on if self._plan.watched else driving.can_correct
            return shown or self._maker.failed
        if self.part in (parts.WATCHING, parts.CORRECTING):
            return not driving.is_on and (enough or self.part == parts.WATCHING)
        return self.part == parts.WAITING and not session.wishes.is_busy and not self._work()

    def _wanted(self, now: float) -> list[Event]:
        """Return the events that begin or end a part."""
        session, driving = self._session, self._session.driving
        if self._leaves:
            session.allowed = ("finish",)
            return [Command("finish")]
        if not self._is_started and session.state in (OPENING, REVIEW):
            self._is_started = True
            return [Command("start")]
        if self.part == parts.MAKING and not session.wishes.is_busy and not self._maker.results:
            session.wishes.express("make")
        if self.part == parts.CORRECTING:
            enough = self._counts.is_enough(self.part)
            if driving.is_on == enough and (not enough or self._was_read(now, driving.waits)):
                session.allowed = (*parts.ACTING, "correct", "finish")
                return [Command("finish" if enough else "correct")]
        answers = self.part in (parts.QUESTIONS, parts.WAITING)
        if answers and not session.wishes.is_busy and self._work():
            session.wishes.express(self._work())
        return []

    def _work(self) -> str:
        """Return the next wish for a tree, while the person answers; empty without one."""
        known = self._maker.names
        if self._maker.failed or archive.FITTED not in known:
            return ""
        if archive.TAKEN_OVER not in known and self._counts.n_driven:
            return "make"
        return "practise" if self._plan.practises and archive.PRACTISED not in known else ""

    def _was_read(self, now: float, is_shown: bool) -> bool:
        """Return whether the end of an episode has been shown for long enough."""
        if not is_shown:
            self._due = None
        elif self._due is None:
            self._due = now + (1.0 if self.part == parts.CORRECTING else parts.READ)
        return self._due is not None and now >= self._due

    def _go_on(self) -> None:
        """Begin the next part; the record so far is stored."""
        rest = self._parts[self._parts.index(self.part) + 1 :]
        skipped = (parts.WATCHING, parts.CORRECTING) if self._maker.failed else ()
        self.part = next(part for part in rest if part not in skipped)
        self._begun = self.part not in (parts.PRACTICE, parts.SHOWING, parts.CORRECTING)
        self._due = None
        self._store()
        if self.part == parts.THANKS:
            archive.pack(self._folder, self._folder.parent)
            self._is_packed = True

    def _news(self) -> list[object]:
        """Return what is stored as soon as it changes."""
        return [*self.answers, len(self._session.episodes)]

    def _store(self) -> None:
        document = archive.PersonDocument(
            person=self._folder.name,
            protocol=self._protocol,
            environment=environment_to_document(self._recorder.folder.environment),
            plan=self._plan,
            versions=self._versions,
            seconds={part: round(seconds, 2) for part, seconds in self._seconds.items()},
            results=list(self._maker.results),
            answers=list(self.answers),
            part=self.part,
        )
        write_document(self._folder / archive.PERSON_FILE, document)
        self._stored = self._news()

    def _go_back(self) -> None:
        """Go on where a recorder that died has left the person."""
        path = self._folder / archive.PERSON_FILE
        if not path.exists():
            return
        known = read_document(path, archive.PersonDocument)
        self._seconds, self._maker.results[:] = dict(known.seconds), known.results
        self.answers, self.part = list(known.answers), known.part
        if self.part == parts.THANKS:  # which may not have been packed
            self.part = parts.WAITING
        enough = self._counts.is_enough
        for place, episode in enumerate(self._session.episodes):
            if not is_whole(episode):
                self._session.recording.mark(place, kept=False, comment="interrupted")
        if self.part in (parts.WATCHING, parts.CORRECTING):
            is_done = self._counts.n_driven and enough(parts.CORRECTING)
            self.part = parts.QUESTIONS if is_done else parts.MAKING
        if self.part == parts.MAKING:
            self._maker.results.clear()
        if self.part == parts.PRACTICE:
            self._counts.set_practice_aside()
        self._begun = self.part not in (parts.PRACTICE, parts.SHOWING) or enough(self.part)

    # ---- the end

    @property
    def is_withdrawn(self) -> bool:
        """Whether the person had all of it deleted."""
        return self.part == parts.DELETED

    @property
    def is_finished(self) -> bool:
        """Whether the person took part to the end, and their results are in one archive."""
        return self.part == parts.THANKS and self._is_packed

    def _delete(self) -> None:
        self._asks, self.part = False, parts.DELETED
        self._recorder.close()
        self._session.play.state = FINISHED
        self.clear()

    def clear(self) -> None:
        """Delete files that need not stay: all of them without consent, or once it is withdrawn.

        What somebody agreed to give stays until it is in their archive.
        """
        if self.part == parts.DELETED:
            self._folder.with_suffix(".zip").unlink(missing_ok=True)
        agreed = self.part != parts.CONSENT or (self._folder / archive.PERSON_FILE).exists()
        if not agreed or self.part == parts.DELETED or self.is_finished:
            shutil.rmtree(self._folder, ignore_errors=True)
        elif self.part != parts.CONSENT:  # how long the part took until now
            with suppress(FileError):
                self._store()

    # ---- fields of the page

    def view(self) -> dict[str, Any]:
        """Return the page's fields of the study, in JSON's types."""
        card = "asked" if self._asks else self.part
        text = self._words[card].get("text", "")
        if not self._begun and self.part == self._parts[1] and not self._asks:
            text = "{task}\n\n" + text
        numbers = {
            name: f"{count} {'episode' if count == 1 else 'episodes'}"
            for name, count in msgspec.structs.asdict(self._plan).items()
            if isinstance(count, int)
        }
        is_card = self._asks or not self._begun or self.part not in parts.ALLOWED
        asks = self.part == parts.QUESTIONS and not self._asks
        on_it = self._words[card if self._asks or self._begun else "told"]
        return {
            "part": card,
            "place": self._parts.index(self.part) + 1 if self.part in self._parts else 0,
            "of": len(self._parts),
            "title": self._words[card]["title"],
            "text": self._consent if self.part == parts.CONSENT else text.format(
                **numbers, person=self._folder.name, task=self._session.task
            ),
            "is_card": is_card,
            "buttons": on_it.get("buttons", []),
            "allowed": list(self._session.allowed or ()),
            "label": self._counts.label(self.part),
            "works": self.part in (parts.MAKING, parts.WAITING),
            "tells": self.part in (parts.MAKING, parts.WAITING, parts.THANKS) and not self._asks,
            "questions": msgspec.to_builtins(self._plan.questions) if asks else [],
            "answers": list(self.answers) if asks else [],
            "may_withdraw": self.part not in (parts.CONSENT, parts.DELETED) and not self._asks,
        }  # fmt: skip


class StudyTree(PageTree):
    """Makes the tree of a person of a study.

    It shows neither commands nor a choice, and keeps each tree with its results.

    Args:
        folder: The person's, where the trees are kept; the demonstrations are in it.
        spec: Where the tree plays and practises.
        plan: The plan, the same for each person.
    """

    def __init__(self, folder: Path, spec: EnvironmentSpec, plan: StudyPlan) -> None:
        super().__init__(folder / archive.DEMOS, lambda: make(spec), seed=plan.seed)
        self._person, self._watched = folder, plan.watched
        self.results: list[archive.TreeResult] = []
        self.failed = False

    @property
    def names(self) -> list[str]:
        """Which trees there are."""
        return [result.tree for result in self.results]

    def make(self, show: "Show", stop: Callable[[], bool]) -> None:
        """Make the tree of the demonstrations, or of these and the corrections."""
        name = archive.TAKEN_OVER if archive.FITTED in self.names else archive.FITTED
        of_all = super().make
        watched = self._watched if name == archive.FITTED else -1
        self._keep(name, lambda: of_all(_plainly(show, watched), stop))

    def _known(self) -> Demonstrations:
        """Return what a tree is made of; the first one of what the person showed alone."""
        known = super()._known()
        shown = tuple(episode for episode in known.episodes if episode.by_hand is None)
        return known if archive.FITTED in self.names else replace(known, episodes=shown)

    def practise(self, show: "Show", stop: Callable[[], bool]) -> None:
        """Let the tree learn by itself."""
        if self.best is None:  # a recorder that died had made it, and told its result
            super().make(_plainly(show, -1), stop)
        further = super().practise
        self._keep(archive.PRACTISED, lambda: further(_plainly(show, -1), stop))

    def missing(self) -> None:
        """Return None: each person is told the same."""

    def _keep(self, name: str, work: Callable[[], None]) -> None:
        try:
            work()
        finally:
            self.failed = self.best is None
        if (best := self.best) is not None:
            tree, played = best
            tree.save(self._person / f"{name}.json")
            self.results.append(archive.result_of(name, tree, played))


def _plainly(show: "Show", watched: int) -> "Show":
    """Return a ``Show`` without commands and choices, and with at most so many episodes.

    Args:
        show: Shows it.
        watched: Most episodes to watch; below 0 nothing drives any more.
    """

    def plain(view: "TreeView", programme: "Programme | None" = None) -> None:
        if programme is not None:
            programme = replace(programme, scenes=programme.scenes[:watched])
        view = replace(view, commands=(), ways=(), changes=(), note="", may_gain=False)
        show(view, programme if watched >= 0 else None)

    return plain
