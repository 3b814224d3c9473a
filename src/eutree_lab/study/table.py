"""The table of a study: results of each person and of their trees; means with intervals."""

import csv
import io
import re
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError, shown
from eutree.evaluation import evaluate, mean_interval
from eutree.files.schema_document import environment_from_document
from eutree.fitting import Person
from eutree.fitting.page_views import value
from eutree.interaction.making import make
from eutree.policies import TreePolicy
from eutree_lab.study.archive import DEMOS, TREES, PersonDocument, archives, read_person, unpack
from eutree_lab.study.plan import PERSON

Cell = str | float | None
OWN = "own"
_FORMULA = re.compile(r"(?![+-][\d.]+\Z)\s*[=+\-@]")  # to a spreadsheet; -0.5 is a number
DIFFERENCES = (("taken-over", "fitted"), ("practised", "taken-over"), ("practised", OWN))


@dataclass(frozen=True)
class StudyTable:
    """Results of a study.

    Attributes:
        rows: One for each person who took part to the end, by column; None where nothing is known.
        questions: The questions, by the column of their answers.
    """

    rows: tuple[dict[str, Cell], ...]
    questions: dict[str, str]

    @property
    def columns(self) -> list[str]:
        """The heads of the columns."""
        return list(self.rows[0])

    def means(self) -> dict[str, tuple[float, float, float, int]]:
        """Return mean, both ends of its 95 % interval, and number, of each column of numbers.

        Differences are paired, person by person: ``"practised less own"``.
        """
        found = {name: [row[name] for row in self.rows] for name in self.columns}
        for above, below in DIFFERENCES:
            pairs = zip(found[above], found[below], strict=True)
            found[f"{above} less {below}"] = [
                a - b if isinstance(a, float) and isinstance(b, float) else None for a, b in pairs
            ]
        numbers = {name: [c for c in cells if isinstance(c, float)] for name, cells in
                   found.items()}  # fmt: skip
        return {
            name: (float(np.mean(cells)), *mean_interval(cells), len(cells))
            for name, cells in numbers.items()
            if cells
        }

    def to_csv(self) -> str:
        """Return the rows as comma-separated values; text that a spreadsheet runs behind a '."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: _quoted(row[name]) for name in row} for row in self.rows)
        return text.getvalue()

    def __str__(self) -> str:
        """Return the table, the means below it, and the questions."""
        heads, rows = self.columns, [[_said(row[name]) for name in self.columns]
                                     for row in self.rows]  # fmt: skip
        widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
        lines = ["  ".join(map(str.rjust, line, widths)) for line in (heads, *rows)]
        lines += ["", f"{len(rows)} people; mean, 95 % interval"]
        for name, (mean, low, high, n) in self.means().items():
            interval = f" ({_said(low)} to {_said(high)})" if n > 1 else ""
            lines.append(f"{name}: {_said(mean)}{interval}, {n}")
        return "\n".join([*lines, "", *(f"{k}: {text}" for k, text in self.questions.items())])


def study_table(study: Path, *, episodes: int = 500, seed: int = 1_000_003) -> StudyTable:
    """Return the table of all people of a study who took part to the end.

    Each tree plays further episodes, the same for all: those of the study chose between trees. A
    file of another name that is no archive of a person is left out, with a warning.

    Args:
        study: The folder with the archives.
        episodes: How many episodes each tree plays.
        seed: Seed of these episodes.

    Raises:
        InvalidArgumentError: There is no archive, or two of one person, or they are not of one
            study.
        FormatError: What a person did is damaged: the means would be of the others alone.
    """
    rows, known, places = [], list[PersonDocument](), dict[str, str]()
    for path in archives(study):
        with TemporaryDirectory() as name:
            person = (unpack if PERSON.fullmatch(path.stem) else read_person)(path, Path(name))
            if person is None:
                continue
            if (other := places.setdefault(person.person, path.name)) != path.name:
                both = f"{shown(other)} and {shown(path.name)}"
                raise InvalidArgumentError(f"{study} must hold each person once, got one in {both}")
            rows.append(_row(person, Path(name), episodes, seed))
        known.append(person)
    if not rows:
        raise InvalidArgumentError(f"{study} must hold what people did, got no .zip of a person")
    if len({person.protocol for person in known}) > 1:
        raise InvalidArgumentError(f"{study} must hold one study; these people had several")
    asked = known[0].plan.questions
    return StudyTable(tuple(rows), {_answer(k): q.text for k, q in enumerate(asked)})


def _row(person: PersonDocument, folder: Path, episodes: int, seed: int) -> dict[str, Cell]:
    demos = Demonstrations.load(folder / DEMOS)
    own = Person.of(demos)
    driven = [episode for episode in demos if episode.by_hand is not None]
    by_hand = sum(int(np.sum(e.by_hand)) for e in driven if e.by_hand is not None)
    steps = sum(map(len, driven))
    row: dict[str, Cell] = {"person": person.person}
    row[OWN] = None if own.whole is None else float(value(own.whole))
    row |= _reached(person, folder, episodes, seed)
    row["steps shown"] = float(demos.n_transitions - steps)
    row["by hand"], row["watched"] = float(by_hand), float(steps - by_hand)
    row["minutes"] = sum(person.seconds.values()) / 60.0
    for place, question in enumerate(person.plan.questions):
        answer = person.answers[place] if place < len(person.answers) else ""
        is_number = question.points and answer in question.options
        row[_answer(place)] = float(answer) if is_number else answer or None
    return row


def _reached(person: PersonDocument, folder: Path, episodes: int, seed: int) -> dict[str, Cell]:
    """Return the merit of each tree in further episodes, by its name."""
    spec = environment_from_document(person.environment, folder)
    if spec is None:
        raise InvalidArgumentError(f"the environment of {person.person} is not known")
    found: dict[str, Cell] = dict.fromkeys(TREES)
    with closing(make(spec)) as env:
        for name in TREES:
            path = folder / f"{name}.json"
            if path.exists():
                tree = TreePolicy.load(path)
                found[name] = float(value(evaluate(tree, env, episodes=episodes, seed=seed)))
    return found


def _answer(place: int) -> str:
    return f"answer {place + 1}"


def _said(cell: Cell) -> str:
    if not isinstance(cell, float):
        return " ".join((cell or "-").split())
    return f"{cell:.0f}" if abs(cell) >= 1000.0 else f"{cell:.3g}"


def _quoted(cell: Cell) -> Cell:
    return f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell
