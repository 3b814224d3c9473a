"""The plan of a study: the same parts, episodes and questions for all, one consent text.

A study's folder holds ``study.toml`` and ``consent.md``; both are written with the usual content
where they are missing. Once a person has taken part neither may change, nor the environment.
"""

import hashlib
import re
import tomllib
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from eutree.errors import FormatError
from eutree.files import make_folder, read_bytes, write_text

if TYPE_CHECKING:
    from eutree.data import Episode
    from eutree.recording import Session

PLAN, CONSENT_TEXT = "study.toml", "consent.md"
PERSON = re.compile(r"[0-9a-f]{8}")  # the code of a person
Files = dict[str, bytes]  # the two files, as they were read
MAX_TEXT = 1 << 20  # bytes of a file that a researcher writes
MAX_ANSWER = 400  # characters


class Question(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A question to each person.

    Attributes:
        text: The question, or a statement to agree with.
        low: Meaning of the first point of a scale.
        high: Meaning of the last point of a scale.
        points: Points of the scale; 0 where there is none.
        choices: The choices; empty where there are none.
    """

    text: str
    low: str = ""
    high: str = ""
    points: int = 0
    choices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.points and (self.choices or not 2 <= self.points <= 11):
            raise ValueError("a question has 2 to 11 points, or choices")

    @property
    def options(self) -> tuple[str, ...]:
        """The possible answers; empty for words."""
        return self.choices or tuple(str(point + 1) for point in range(self.points))


class StudyPlan(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The plan, the same for each person.

    Attributes:
        seed: Seed of all episodes.
        practice: Episodes that no tree learns from.
        episodes: Episodes that the person shows.
        watched: Most episodes in which the person watches the tree.
        taken_over: Episodes in which the person may take over from the tree.
        practises: Whether the tree practises by itself in the end.
        questions: Questions to each person.
    """

    seed: int = 0
    practice: int = 2
    episodes: int = 15
    watched: int = 5
    taken_over: int = 5
    practises: bool = True
    questions: tuple[Question, ...] = ()

    def __post_init__(self) -> None:
        if min(self.seed, self.practice, self.watched, self.taken_over) < 0 or self.episodes < 1:
            raise ValueError("numbers must not be negative, and episodes at least 1")


def usual(name: str) -> str:
    """Return the text of a file that lies beside this module."""
    return (resources.files(__package__) / name).read_text(encoding="utf-8")


def plan_files(folder: Path) -> Files:
    """Return the two files of a study by their names; what is missing is written."""
    make_folder(folder)
    for name in (PLAN, CONSENT_TEXT):
        if not (folder / name).exists():
            write_text(folder / name, usual(name))
    return {name: read_bytes(folder / name, limit=MAX_TEXT) for name in (PLAN, CONSENT_TEXT)}


def open_plan(
    folder: Path, *settings: object, files: Files | None = None
) -> tuple[StudyPlan, str, str]:
    """Return the plan of a study, the consent text, and a digest of all that must not change.

    Args:
        folder: The study; made if it is missing, and so are its two files.
        settings: The same for each person, too: the environment, its keys and its pace.
        files: Its two files; None to read them now.

    Raises:
        FormatError: A file is not valid.
        FileError: A file cannot be read or written.
    """
    files = plan_files(folder) if files is None else files
    name = CONSENT_TEXT
    try:
        text = files[name].decode("utf-8-sig")
        name = PLAN
        plan = msgspec.convert(tomllib.loads(files[name].decode("utf-8-sig")), StudyPlan)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, msgspec.ValidationError) as error:
        raise FormatError(folder / name, "", str(error)) from None
    facts = (files[PLAN], files[CONSENT_TEXT], *map(str, settings))
    return plan, text, hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


# The parts: their order, the commands obeyed in them, and which of their episodes are done.


CONSENT, PRACTICE, SHOWING, MAKING = "consent", "practice", "showing", "making"
WATCHING, CORRECTING, QUESTIONS, WAITING = "watching", "correcting", "questions", "waiting"
THANKS, DELETED = "thanks", "deleted"
PARTS = (
    CONSENT, PRACTICE, SHOWING, MAKING, WATCHING, CORRECTING, QUESTIONS, WAITING, THANKS,
)  # fmt: skip
READ = 2.0  # seconds in which the end of an episode is read
ACTING = ("start", "pause", "wait")
ALLOWED = {  # commands of a person in each part; in all others, none
    PRACTICE: ACTING,
    SHOWING: ACTING,
    WATCHING: ("start", "pause", "end", "redo"),
    CORRECTING: ACTING,
}
# Which number of the plan says how long a part is; without it the part is left out.
COUNTED = {PRACTICE: "practice", WATCHING: "watched", CORRECTING: "taken_over"}
WORDS = "words.toml"  # of the cards: a title, a text and buttons of the study's own


def is_whole(episode: "Episode") -> bool:
    """Return whether the task or its time limit ended the episode."""
    return episode.terminated or episode.truncated


class Counts:
    """Which episodes of the plan are done.

    Args:
        session: Records them.
        plan: Says how many there are to be.
    """

    def __init__(self, session: "Session", plan: StudyPlan) -> None:
        self._session, self._plan = session, plan

    @property
    def n_practised(self) -> int:
        """Episodes of practice."""
        return sum(episode.comment == PRACTICE for episode in self._session.episodes)

    @property
    def n_driven(self) -> int:
        """Whole episodes in which the tree drove and the person could take over."""
        return sum(e.by_hand is not None and is_whole(e) for e in self._session.episodes)

    def is_enough(self, part: str) -> bool:
        """Return whether a part has had all its episodes; False for one without any."""
        found = {
            PRACTICE: self.n_practised,
            SHOWING: self._session.recording.n_kept,
            CORRECTING: self.n_driven,
        }
        return part in found and found[part] >= getattr(self._plan, COUNTED.get(part, "episodes"))

    def set_practice_aside(self) -> None:
        """Let no tree learn from the episodes recorded so far."""
        for place, episode in enumerate(self._session.episodes):
            if episode.kept:
                self._session.recording.mark(place, kept=False, comment=PRACTICE)

    def label(self, part: str) -> str:
        """Return the name of the present episode, where it is not one that counts."""
        if part != PRACTICE:
            return ""
        return f"Practice {min(self.n_practised + 1, self._plan.practice)} of {self._plan.practice}"
