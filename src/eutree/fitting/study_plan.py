"""What a study asks of each person: the same episodes, the same questions, one consent text.

A study's folder holds ``study.toml`` and ``consent.md``; both are written with the usual content
where they are missing. Once a person has taken part neither may change, nor the environment.
"""

import hashlib
import re
import tomllib
from pathlib import Path

import msgspec

from eutree.errors import FormatError
from eutree.files import make_folder, read_bytes, write_text

PLAN, CONSENT = "study.toml", "consent.md"
PERSON = re.compile(r"[0-9a-f]{8}")  # what a person is called
MAX_TEXT = 1 << 20  # bytes of a file that a researcher writes
MAX_ANSWER = 400  # characters

USUAL_PLAN = """\
# The same for each person. Change it before the first one begins.
seed = 0         # of all episodes: each person meets the same starts
practice = 2     # episodes to get used to the keys; no tree learns from them
episodes = 15    # that the person shows
watched = 5      # episodes in which the person watches the tree, failures first
taken_over = 5   # episodes in which the person may take over
practises = true # whether the tree practises by itself while the person answers

# A question has a scale (low, high, points), choices, or neither: then it is answered in words.
[[questions]]
text = "The tree drives as I would have driven."
low = "not at all"
high = "exactly"
points = 7

[[questions]]
text = "I could tell in advance what the tree would do."
low = "never"
high = "always"
points = 7

[[questions]]
text = "I would let the tree do this in my place."
low = "certainly not"
high = "certainly"
points = 7
"""
USUAL_CONSENT = """\
# Would you like to take part?

You show a computer how something is done, by keys or buttons. It makes a small program of what you
showed, a decision tree. You watch the tree do the same, put it right where it is wrong, and answer
a few questions. That takes about fifteen minutes.

- Stored is what you did in the task, how long each part took, what the tree made of it, and your
  answers, under a random code. It may be published so.
- Not stored is who you are: no name, no address of your computer, no browser, no date, no time of
  day.
- You may stop whenever you like. *Delete what I did*, at the top of the page, deletes all of it.
"""


class Question(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A question to each person.

    Attributes:
        text: The question, or a statement to agree with.
        low: What the first point of a scale means.
        high: What the last point of a scale means.
        points: Points of the scale; 0 where there is none.
        choices: What can be chosen; empty where there is nothing to choose.
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
        """What may be answered; empty for words."""
        return self.choices or tuple(str(point + 1) for point in range(self.points))


class StudyPlan(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is the same for each person.

    Attributes:
        seed: Seed of all episodes.
        practice: Episodes that no tree learns from.
        episodes: Episodes that the person shows.
        watched: Most episodes in which the person watches the tree.
        taken_over: Episodes in which the person may take over from the tree.
        practises: Whether the tree practises by itself in the end.
        questions: What each person is asked.
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


def open_plan(folder: Path, *settings: object) -> tuple[StudyPlan, str, str]:
    """Return the plan of a study, the consent text, and a digest of all that must not change.

    Args:
        folder: The study; made if it is missing, and so are its two files.
        settings: What else is the same for each person: the environment, its keys and its pace.

    Raises:
        FormatError: A file says what it cannot mean.
        FileError: A file cannot be read or written.
    """
    make_folder(folder)
    for name, usual in ((PLAN, USUAL_PLAN), (CONSENT, USUAL_CONSENT)):
        if not (folder / name).exists():
            write_text(folder / name, usual)
    path = folder / PLAN
    data, consent = (read_bytes(folder / name, limit=MAX_TEXT) for name in (PLAN, CONSENT))
    try:
        plan = msgspec.convert(tomllib.loads(data.decode()), StudyPlan)
        text = consent.decode()
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, msgspec.ValidationError) as error:
        raise FormatError(path, "", str(error)) from None
    digest = hashlib.sha256(repr((data, consent, *map(str, settings))).encode()).hexdigest()
    return plan, text, digest[:16]
