"""How a machine's log is read: columns, times, text, actions, empty cells, unmarked episodes."""

import re
from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from eutree.arrays import Floats
from eutree.data.episode import ALLOWED
from eutree.errors import InvalidArgumentError
from eutree.schema import Feature, Schema
from eutree.validation import check_listed, check_measures

KNOWN = (
    "episode", "step", "action", "action_name", "reward", "terminated", "truncated", "seed",
    "ending", "is_success", "kept",
)  # fmt: skip
MASKED = (*KNOWN, ALLOWED)  # of a table in which an action is masked
HOLD, LEAVE_OUT = "hold", "drop"
SMALL = 18  # indices of actions below it are indices, whichever are missing: so many has Atari
INDEX = re.compile(r"[0-9]{1,5}")
TIMES = tuple(  # of a time that cannot be read, for a message
    f"{day} {hour}"
    for day in ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%Y/%m/%d", "%d.%m.%y")
    for hour in ("%H:%M", "%H:%M:%S", "%I:%M %p")
)
_SECONDS = {"s": 1, "min": 60, "h": 3600, "d": 86400}
_SPAN = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h|d)?")
_UNIT = re.compile(r"(?P<name>.*\S)\s+\((?P<unit>[^()]*)\)")
_DATE = re.compile(r"\s*\d{1,4}[-./]\d{1,2}[-./]\d{1,4}")
_TRUTH = {"": None, "true": True, "false": False, "1": True, "0": False}
_NOTHING = ("", "nan", "na", "n/a", "null")


@dataclass(frozen=True, kw_only=True)
class LogFormat:
    """How a machine's log is to be read as episodes.

    Attributes:
        drop: Columns that are no features.
        nominal: Columns of text, a choice of categories: each category becomes a feature that is 1
            where it is chosen, ``"mode is auto"``, of a one-hot group; of two categories one
            feature is enough, 1 at the later one by the alphabet.
        missing: The meaning of an empty cell: ``"hold"``, the value before it in the episode; a
            number; ``"drop"``, the row is left out, and the episode ends before it, since its last
            action's successor is not known. Refused if "".
        time: Column of the time, which is no feature: seconds, or ISO 8601.
        time_format: Its form as ``datetime.strptime`` has it, where it is another.
        episode_gap: Seconds between two rows after which a new episode begins.
        one_episode: All rows are one episode.
        ends_in_place: An episode that terminated keeps the last action that no row follows: it
            ended where that was taken, as far as is known.
        actions: Names of the actions in the order of their indices, where the order matters.
    """

    drop: tuple[str, ...] = ()
    nominal: tuple[str, ...] = ()
    missing: str = ""
    time: str = ""
    time_format: str = ""
    episode_gap: float | None = None
    one_episode: bool = False
    ends_in_place: bool = False
    actions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("drop", "nominal", "actions"):
            object.__setattr__(self, name, check_listed(name, getattr(self, name)))
        object.__setattr__(self, "missing", str(self.missing))  # a number as it is, too
        if self.missing not in ("", HOLD, LEAVE_OUT) and not is_quantity(self.missing):
            raise InvalidArgumentError(
                f"missing must be {HOLD}, {LEAVE_OUT} or a number, got {self.missing!r}"
            )
        check_measures(self, "episode_gap", low=0.0, low_open=True)
        if self.one_episode and self.episode_gap is not None:
            raise InvalidArgumentError("one_episode has no gap between episodes: give one of them")
        if "" in self.actions:
            raise InvalidArgumentError(f"actions must be names, got {', '.join(self.actions)!r}")
        if (self.episode_gap is not None or self.time_format) and not self.time:
            raise InvalidArgumentError("time must name the column that a gap is seen in, got ''")

    def columns_of(self, found: Sequence[str], own: Mapping[str, str]) -> list[str]:
        """Return a table's columns by the names that we know them by; "" of one that is left out.

        ``own`` are the columns of the known names, where they have others.
        """
        if not found:
            raise InvalidArgumentError("the file is empty: the first line must name the columns")
        for name in (*own.values(), *filter(None, (*self.drop, *self.nominal, self.time))):
            if name not in found:
                raise InvalidArgumentError(f"there is no column {name!r} in {found}")
        known = {theirs: name for name, theirs in own.items()}
        drop = {*self.drop} - {self.time}
        columns = ["" if column in drop else known.get(column, column) for column in found]
        for name in ("episode", "action"):
            if name not in columns and not (name == "episode" and (self.time or self.one_episode)):
                reason = (
                    f"there is no column {name!r} in {found}; required are 'episode' and 'action', "
                    "or columns named by --episode-column and --action-column "
                    "(in Python columns={'episode': ..., 'action': ...})"
                )
                if name == "episode":
                    reason += (
                        "; where nothing marks the episodes, --time COLUMN, with --episode-gap 1h "
                        "for those that a pause divides, or --one-episode"
                    )
                if len(found) == 1:
                    reason += "; and what separates the values by --delimiter"
                raise InvalidArgumentError(reason)
        twice = sorted({name for name in columns if name and columns.count(name) > 1})
        if twice:
            names = ", ".join(map(repr, twice))
            also = " (leave out the other by --drop)" if set(twice) & own.keys() else ""
            raise InvalidArgumentError(f"two columns have the same name: {names}{also}")
        if self.time and self.time not in columns:
            raise InvalidArgumentError(f"time must be a column of its own, got {self.time!r}")
        for name in self.nominal:
            if name in MASKED or name not in columns:
                raise InvalidArgumentError(f"nominal must be a column of a feature, got {name!r}")
        if self.one_episode and "episode" in columns:
            raise InvalidArgumentError(
                "one_episode is for a table without a column of the episodes"
            )
        return columns

    def seconds(self, text: str) -> float:
        """Return the time in a cell of the column ``time``, in seconds; without a zone it is UTC.

        Raises:
            InvalidArgumentError: The cell holds no time.
        """
        try:
            stamp, form = text.strip(), self.time_format
            if not form and is_quantity(text):
                return float(text)
            moment = datetime.strptime(stamp, form) if form else datetime.fromisoformat(stamp)
            return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
        except (ValueError, OverflowError, OSError):
            wanted = self.time_format or "seconds, or as 2026-03-01 14:05:00"
            fits = next((form for form in TIMES if _has_form(text, form)), TIMES[0])
            raise InvalidArgumentError(
                f"{self.time} must be a time, {wanted}, got {text!r}"
                f"; another form is told by --time-format '{fits}'"
            ) from None


def seconds_of(text: str) -> float:
    """Return how long a span is: ``90``, ``90s``, ``15min``, ``1h``, ``2d``.

    >>> seconds_of("1.5h")
    5400.0
    """
    match = _SPAN.fullmatch(text.strip())
    if match is None:
        raise InvalidArgumentError(
            f"--episode-gap must be a span as 90s, 15min, 1h or 2d, got {text!r}"
        )
    return float(match[1]) * _SECONDS[match[2] or "s"]


def label(column: str) -> str:
    """Return a column's name with its unit in brackets, as a schema has it.

    >>> label("level (m)")
    'level [m]'
    """
    match = _UNIT.fullmatch(column)
    return f"{match['name']} [{match['unit']}]" if match else column


def column_of(feature: Feature) -> str:
    """Return the column of a feature, its unit in brackets; empty ones behind others of its name.

    >>> column_of(Feature("ratio (a/b)"))
    'ratio (a/b) []'
    """
    is_plain = not feature.unit and Feature.from_label(label(feature.name)).name == feature.name
    return feature.name if is_plain else f"{feature.name} [{feature.unit}]"


def is_nothing(text: str) -> bool:
    """Return whether a cell of numbers is empty, or says that there was no value."""
    return text.strip().lower() in _NOTHING


def is_quantity(text: str) -> bool:
    """Return whether a cell holds a finite number."""
    try:
        return abs(float(text)) < float("inf") and "_" not in text
    except ValueError:
        return False


def are_quantities(texts: Collection[str], names: Mapping[str, str]) -> bool:
    """Return whether actions are numbers, such as 0 and 1500, that are no indices.

    Indices are named beside, or small, or half of those up to the largest are there at least.
    """
    if names or not texts or not all(map(is_quantity, texts)):
        return False
    highest = max(map(float, texts))
    if not all(map(INDEX.fullmatch, texts)):
        return highest < 2**53  # above it two whole numbers may be one
    return highest >= max(2 * len(texts), SMALL)


def are_named(texts: Set[str], names: Mapping[str, str], actions: Sequence[str]) -> bool:
    """Return whether actions are said by name: as quantities, or by their names alone."""
    words = texts <= {*actions} and not all(map(INDEX.fullmatch, texts))
    return words or are_quantities(texts, names)


def action_of(text: str, schema: Schema, by_name: bool) -> int:
    """Return the action of a text: an index, or else a name; if ``by_name``, a name first.

    What is neither may be a level, where the actions set one quantity.
    """
    names = schema.actions
    is_index = INDEX.fullmatch(text) and int(text) < len(names)
    if by_name and text not in names and is_quantity(text):  # 0 and 0.0 are one quantity
        same = (name for name in names if is_quantity(name) and float(name) == float(text))
        text = next(same, text)
    if text in names and (by_name or not is_index):
        return names.index(text)
    if is_index:
        return int(text)
    levels = schema.controls[0].levels if len(schema.controls) == 1 else ()
    if is_quantity(text) and float(text) in levels:
        return levels.index(float(text))
    known = ", ".join(names)
    raise InvalidArgumentError(f"must be one of {known} or its index, got {text!r}")


def truth(row: Mapping[str, str], column: str) -> bool | None:
    """Return what a cell says, true or false; None where it says nothing."""
    text = row.get(column, "").lower()
    if text not in _TRUTH:
        raise InvalidArgumentError(f"{column} must be true or false, got {text!r}")
    return _TRUTH[text]


def hint(text: str, column: str) -> str:
    """Return the remedies for a cell that is no number, to follow "got ...'"."""
    if is_nothing(text):
        return f"; an empty cell is filled by --missing {HOLD} or a number, or its row left out"
    if _DATE.match(text):
        return f"; name the time by --time {column!r}"
    return f"; text is a choice of categories by --nominal {column!r}, or left out by --drop"


def _has_form(text: str, form: str) -> bool:
    try:
        datetime.strptime(text.strip(), form)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class NominalColumn:
    """What is made of a nominal column: a feature for each category, or one code.

    Attributes:
        features: The k features.
        values: Theirs for each text of the column, in the order in which these occurred.
    """

    features: tuple[Feature, ...]
    values: Floats  # [texts, k]

    @classmethod
    def of(cls, column: str, texts: Sequence[str], schema: Schema | None) -> "NominalColumn":
        """Return what a schema has of a column, or else what its texts make: of two a code.

        Raises:
            InvalidArgumentError: A text is none of the categories that the schema has.
        """
        names = tuple(sorted(texts))
        features = _known(column, schema)
        if features:
            names = features[0].categories or tuple(feature.category for feature in features)
        else:
            features = _made(column, names)
        others = [text for text in texts if text not in names]
        if others:
            raise InvalidArgumentError(
                f"{column} must be one of {', '.join(names)}, got {others[0]!r}"
            )
        values = np.eye(len(names))
        if features[0].categories:
            values = features[0].low + np.arange(float(len(names)))[:, None]
        return cls(features, values[[names.index(text) for text in texts]])

    def of_codes(self, codes: Floats) -> Floats:
        """Return the values, [n, k], for texts by their numbers, [n]."""
        return self.values[codes.astype(np.int64)]


def _known(column: str, schema: Schema | None) -> tuple[Feature, ...]:
    """Return the features of a schema that are a column's categories, or their code."""
    known = () if schema is None else schema.features
    return tuple(f for f in known if f.group == column or (f.categories and f.name == column))


def _made(column: str, names: tuple[str, ...]) -> tuple[Feature, ...]:
    if len(names) <= 2:
        return (Feature(column, "", 0.0, len(names) - 1.0, True, names),)
    return tuple(Feature(f"{column} is {name}", "", 0.0, 1.0, True, group=column) for name in names)


def order_of(found: Sequence[Feature], schema: Schema, *, renames: bool = False) -> list[int]:
    """Return which of the features that were found each of a schema is: by name, or by place.

    One that is taken by its place has the schema's unit, if both have one, unless that ``renames``.
    """
    names, wanted = [feature.name for feature in found], list(schema.feature_names)
    if len(names) != len(wanted):
        raise InvalidArgumentError(f"expected {len(wanted)} features, got columns {names}")
    order = [names.index(name) if name in names else k for k, name in enumerate(wanted)]
    if sorted(order) != list(range(len(names))):
        raise InvalidArgumentError(
            f"columns must have the names of the features, {', '.join(wanted)}, or their order, "
            f"got {', '.join(names)}"
        )
    for feature, other in zip(schema.features, (found[k] for k in order), strict=True):
        if not other.is_coded_as(feature):
            wants, has = (", ".join(one.categories) for one in (feature, other))
            raise InvalidArgumentError(
                f"{other.name} must have the categories of {feature.name}, {wants}, got {has}"
            )
        is_same = other.name == feature.name
        if (is_same or not renames) and other.unit and feature.unit not in ("", other.unit):
            here = "" if is_same else f" where {feature.name} is expected"
            helps = "" if is_same else f"; if it is that, name it '{column_of(feature)}'"
            raise InvalidArgumentError(
                f"{other.name} must be in {feature.unit}{here}, got a column in {other.unit}{helps}"
            )
    return order
