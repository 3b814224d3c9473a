"""Simulated people at the recorder: what they show, what `fit` makes of it, what practice adds.

    python benchmarks/people.py [--task evasion] [--folders 60] [--first 1000] [--keep FILE]
    python benchmarks/people.py --learn people|nothing [--learned 400] [...]
    python benchmarks/people.py --task paper-evasion --save people --folders 5

A *person* is a style of playing with hands of flesh: decides by what was to be seen some 150 to
350 ms ago, misjudges distances, lapses now and then into holding the last key, and may miss the
first decision, which falls while the countdown still fades. A *folder* is what one person recorded
in 15 episodes. Folder k is drawn from the seed k alone: 0 to 999 are for tuning, the rest for
reports. Whoever wants to teach a learner like a person in a test takes ``person(task, k)``.

For each folder a line is printed: what the person reaches in many episodes and in the folder; the
tree of C4.5 release 8; what ``eutree.fit`` returns alone and after 100 episodes of practice, each
played in the same further episodes. ``--learn people`` prints what ``eutree.learn`` makes of the
tree of release 8, of a folder as bad as it may be, in half of ``--learned`` episodes and in all;
``--learn nothing`` what it makes of nothing, with the folders' numbers as seeds. (An episode of
CartPole has up to 500 decisions: ``--task cartpole --learned 100``.) ``--keep`` names a file of
finished folders: a run that is started again goes on from there. ``--save`` names a folder in which
what the people recorded is written, and no more: ``eutree reproduce search --demos`` takes it.
"""

import argparse
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.arrays import Booleans, Floats, Integers

ROOT = Path(__file__).resolve().parent.parent
FIRST_REPORTED = 1000
EPISODES = 15  # of a folder
JUDGED = 500  # episodes that say how good a person or a tree is
JUDGING_SEED = 77
# What is seen [..., d], how it moves [..., d], the action of the key that is held [...]: an action.
Wants = Callable[[Floats, Floats, Integers], Integers]


@dataclass(frozen=True)
class Traits:
    """What makes a person's hands slower and less sure than a script.

    Attributes:
        delay: Seconds from the picture to the key.
        noise: Standard deviation of what is misjudged, in the task's own measure (Evasion: m).
        lapse: Chance that a decision is slept through and the last key stays.
        misses_first: Whether the first decision is over before the person has reacted.
    """

    delay: float = 0.2
    noise: float = 0.25
    lapse: float = 0.02
    misses_first: bool = False


@dataclass(frozen=True)
class Task:
    """What people are asked to show.

    Attributes:
        make: Makes the environment.
        interval: Seconds between two decisions, as the person lives them.
        spread: What a noise of 1 means in each attribute, shape [d].
        idle: The action without a key.
        styles: Ways of playing, by name.
    """

    make: Callable[[], gymnasium.Env[Any, Any]]
    interval: float
    spread: tuple[float, ...]
    idle: int
    styles: Mapping[str, Callable[[Traits, np.random.Generator], Wants]]


class Person:
    """Acts like a person in front of the screen; has SB3's ``predict``, for one or a batch.

    What was seen before and the key that is held are the state that ``predict`` hands on.

    Args:
        name: Style, for people to read.
        wants: What the style does about what is seen.
        task: Where.
        traits: How well.
        generator: Source of all misjudgement.
    """

    def __init__(
        self,
        name: str,
        wants: Wants,
        task: Task,
        traits: Traits,
        generator: np.random.Generator,
    ) -> None:
        self.__name__ = name
        self.traits = traits
        self._wants = wants
        self._task = task
        self._generator = generator

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action that the keys mean at the moment of the decision."""
        now = np.asarray(observation, dtype=np.float64)  # [..., d]
        if state is None:
            past, held = (now,), np.full(now.shape[:-1], self._task.idle)
            asleep = np.full(now.shape[:-1], self.traits.misses_first)
        else:
            past, held = (*state[0][-8:], now), state[1]
            asleep = self._generator.random(now.shape[:-1]) < self.traits.lapse
        back = self.traits.delay / self._task.interval
        seen, before = _seen(past, back), _seen(past, back + 1.0)
        error = self.traits.noise * np.array(self._task.spread)
        blurred = seen + error * self._generator.standard_normal(now.shape)
        wanted = self._wants(blurred, seen - before, held)
        held = np.where(asleep, held, wanted)
        return held, (past, held)


def _seen(past: tuple[Floats, ...], back: float) -> Floats:
    """Return what was on the screen ``back`` decisions ago; it stood still before the start."""
    whole = int(back)
    newer, older = (past[max(len(past) - 1 - k, 0)] for k in (whole, whole + 1))
    return newer + (back - whole) * (older - newer)


STOP, GO = 0, 1
OPPONENT_SPEED = 3.2  # m/s
# Where an opponent comes within the collision distance [m], in the two domains.
LINES, PAPER_LINES = (8.0, 18.0), (9.0, 19.0)


@dataclass(frozen=True)
class Margins:
    """Where an Evasion player waits [m]: from ``near`` to ``last`` before a line, until ``far``."""

    near: float
    far: float
    last: float
    lines: tuple[float, float] = LINES

    @classmethod
    def drawn(
        cls,
        near: float,
        far: float,
        traits: Traits,
        generator: np.random.Generator,
        lines: tuple[float, float] = LINES,
    ) -> "Margins":
        """Return margins about these, for somebody who knows by now how late the hands are.

        An opponent moves on while the finger does: who waits for it to get far away has to look
        for a little less. Nearer than ``last`` one has set out to cross.
        """
        shift = generator.uniform(-0.3, 0.3, 2)
        late = OPPONENT_SPEED * traits.delay
        return cls(near + shift[0], far + shift[1] - late, generator.uniform(0.6, 1.2), lines)

    def ahead(self, seen: Floats) -> Floats:
        """Return the distance to each line [m], shape [..., 2]."""
        return np.array(self.lines) - seen[..., :1]

    def waits(self, seen: Floats, nearness: Floats | None = None) -> Booleans:
        """Return at which lines to wait, shape [..., 2]; ``nearness`` takes the place of |y|."""
        distance = self.ahead(seen)
        at_line = (distance > self.last) & (distance <= self.near)
        return at_line & ((np.abs(seen[..., 1:]) if nearness is None else nearness) < self.far)


def _waits(margins: Margins) -> Wants:
    """Wait at a line until its opponent is far from the path."""

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        return np.where(margins.waits(seen).any(axis=-1), STOP, GO)

    return wants


def _looks_ahead(margins: Margins) -> Wants:
    """Wait while the opponent is on the path, or comes: the sensors hide the latter."""

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        distance = np.abs(seen[..., 1:])
        leaves = (seen[..., 1:] * moved[..., 1:] > 0.0) & (distance > 2.2)
        return np.where(margins.waits(seen, distance + 11.0 * leaves).any(axis=-1), STOP, GO)

    return wants


def _stops_early(margins: Margins, early: float, taps: bool) -> Wants:
    """Stop on the way to a line too while its opponent is near: for a step, or as long as it is.

    ``early`` is that distance of the opponent [m].
    """
    wait = _waits(margins)

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        distance = margins.ahead(seen)
        on_the_way = (distance > margins.near) & (distance <= margins.near + 2.6)
        stops = (on_the_way & (np.abs(seen[..., 1:]) < early)).any(axis=-1)
        return np.where(stops & ((held == GO) | (not taps)), STOP, wait(seen, moved, held))

    return wants


def _push(lead: float, center: float = 0.0, slack: float = 0.0) -> Wants:
    """Push to where the pole will be ``lead`` seconds later; ``slack`` keeps the last key."""

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        x, v, angle, turning = np.moveaxis(seen, -1, 0)
        lean = angle + lead * turning + center * (x + 2.0 * v)
        return np.where(np.abs(lean) < slack, held, (lean > 0.0).astype(int))

    return wants


def _pump(low: float, high: float, night: float | None = None) -> Wants:
    """Switch the pump on below ``low`` and off above ``high``; fill to ``night`` while cheap."""

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        level, hour = np.moveaxis(seen, -1, 0)
        by_day = np.where(level < low, 1, np.where(level > high, 0, held))
        cheap = (hour < 6.0) | (hour >= 22.0)
        return by_day if night is None else np.where(cheap, level < night, by_day).astype(int)

    return wants


@cache
def tank() -> ModuleType:
    """Return the module that the tutorial has its reader write."""
    text = (ROOT / "docs" / "tutorial.md").read_text()
    found = re.search(r"<!-- file: tank\.py -->\n```python\n(.*?)```", text, re.S)
    assert found is not None
    module = ModuleType("tank")
    exec(found[1], module.__dict__)
    del gymnasium.registry["Tank-v0"]  # the reader's own may come into the same process
    gymnasium.register("people/Tank-v0", module.Tank)
    return module


def _make_tank() -> gymnasium.Env[Any, Any]:
    tank()
    return gymnasium.make("people/Tank-v0")


def _evasion_styles(
    lines: tuple[float, float],
) -> Mapping[str, Callable[[Traits, np.random.Generator], Wants]]:
    """Return the ways of playing Evasion."""

    def drawn(near: float, far: float, t: Traits, g: np.random.Generator) -> Margins:
        return Margins.drawn(near, far, t, g, lines)

    return {
        "waits": lambda t, g: _waits(drawn(3.0, 8.6, t, g)),
        "brisk": lambda t, g: _waits(drawn(2.8, 7.6, t, g)),
        "looks-ahead": lambda t, g: _looks_ahead(drawn(2.9, 11.0, t, g)),
        "slows-early": lambda t, g: _stops_early(drawn(3.0, 8.6, t, g), 8.0, taps=True),
        "over-careful": lambda t, g: _stops_early(drawn(3.0, 8.8, t, g), 5.0, taps=False),
    }


def _evasion(env: str, lines: tuple[float, float]) -> Task:
    """Return 2-Evasion with the lines at which its people wait."""
    return Task(
        make=lambda: gymnasium.make(env),
        interval=1.0,
        spread=(1.0, 1.0, 1.0),
        idle=0,
        styles=_evasion_styles(lines),
    )


TASKS = {
    "evasion": _evasion("eutree/Evasion2-v0", LINES),
    "paper-evasion": _evasion("eutree/PaperEvasion2-v0", PAPER_LINES),
    "cartpole": Task(
        make=lambda: gymnasium.make("CartPole-v1"),
        interval=0.02 / 0.25,  # at a quarter of its speed
        spread=(0.2, 0.2, 0.05, 0.1),
        idle=0,
        styles={
            "waits": lambda t, g: _push(0.3, slack=0.02),
            "brisk": lambda t, g: _push(0.2),
            "looks-ahead": lambda t, g: _push(0.5),
            "slows-early": lambda t, g: _push(1.0),
            "over-careful": lambda t, g: _push(0.5, center=0.03),
        },
    ),
    "tank": Task(
        make=_make_tank,
        interval=0.5,
        spread=(0.4, 0.0),
        idle=0,
        styles={
            "waits": lambda t, g: _pump(1.2, 3.5),
            "brisk": lambda t, g: _pump(1.0, 2.0),
            "looks-ahead": lambda t, g: _pump(1.0, 1.6, night=3.6),
            "slows-early": lambda t, g: _pump(2.5, 2.5),
            "over-careful": lambda t, g: _pump(2.8, 3.3),
        },
    ),
}


def person(task: str, number: int) -> Person:
    """Return person ``number`` of a task: styles take turns, the traits are drawn."""
    generator = np.random.default_rng(np.random.SeedSequence((number, 13)))
    traits = Traits(
        delay=float(generator.uniform(0.15, 0.35)),
        noise=float(generator.uniform(0.1, 0.5)),
        lapse=float(generator.uniform(0.0, 0.08)),
        misses_first=bool(generator.random() < 0.5),
    )
    chosen = TASKS[task]
    style = list(chosen.styles)[number % len(chosen.styles)]
    return Person(style, chosen.styles[style](traits, generator), chosen, traits, generator)


def folder(task: str, number: int, *, episodes: int = EPISODES) -> eutree.Demonstrations:
    """Return what person ``number`` recorded."""
    env = TASKS[task].make()
    return eutree.record(env, person(task, number), episodes=episodes, seed=number)


@dataclass(frozen=True)
class Line:
    """One folder of the report; results are shares of successes, or mean returns."""

    number: int
    style: str
    traits: Traits
    person: float
    shown: float
    release_8: float
    leaves: int
    fitted: float
    warnings: tuple[str, ...]
    practised: float

    def __str__(self) -> str:
        """Return the line of the table."""
        traits = self.traits
        cells = (
            self.number,
            self.style,
            f"{1000 * traits.delay:.0f} ms, {traits.noise:.2f}, {100 * traits.lapse:.0f} %"
            + (", first missed" if traits.misses_first else ""),
            *(_figure(v) for v in (self.person, self.shown, self.release_8)),
            self.leaves,
            _figure(self.fitted),
            len(self.warnings),
            _figure(self.practised),
        )
        return f"| {' | '.join(map(str, cells))} |"


HEAD = """| folder | style | delay, noise, lapses | person | shown | release 8 | leaves | `fit` | \
warnings | `fit --practise 100` |
|---|---|---|---|---|---|---|---|---|---|"""


def _figure(value: float) -> str:
    return f"{value:.3f}" if abs(value) <= 1.0 else f"{value:.1f}"


def _merit(evaluation: Any) -> float:
    rate = evaluation.success_rate
    return evaluation.mean_return if rate is None else rate


def line(task: str, number: int, *, judged: int, episodes: int) -> Line:
    """Return what came of one folder.

    Args:
        task: The task.
        number: Number of the folder.
        judged: Episodes that say how good a person or a tree is.
        episodes: Passed to ``eutree.fit``.
    """
    env = TASKS[task].make()

    def reached(policy: Any) -> float:
        return _merit(eutree.evaluate(policy, env, episodes=judged, seed=JUDGING_SEED))

    demonstrations = folder(task, number)
    expert = eutree.fit_expert_tree(demonstrations)
    practised = eutree.fit(demonstrations, env, episodes=episodes, practise=100, seed=number)
    alone = practised.before_practice
    assert alone is not None
    hands = person(task, number)
    shown = alone.person
    return Line(
        number=number,
        style=hands.__name__,
        traits=hands.traits,
        person=reached(hands),
        shown=shown.mean_return if shown.success_rate is None else shown.success_rate,
        release_8=reached(expert),
        leaves=alone.policy.n_leaves,
        fitted=reached(alone.policy),
        warnings=alone.warnings,
        practised=reached(practised.policy),
    )


def summary(lines: list[Line]) -> str:
    """Return the figures of all folders."""
    own, shown, plain, fitted, practised = (
        np.array([getattr(entry, name) for entry in lines])
        for name in ("person", "shown", "release_8", "fitted", "practised")
    )

    def as_good(tree: Floats, base: Floats) -> Booleans:
        scale = np.where(np.abs(own) <= 1.0, 1.0, np.abs(own))
        return tree >= base - 0.03 * scale

    silent = sum(
        1
        for entry, good in zip(lines, as_good(fitted, np.minimum(own, shown)), strict=True)
        if not good and not entry.warnings
    )
    rows = [f"{len(lines)} folders; the person {own.mean():.3f} (in the folder {shown.mean():.3f})"]
    for name, tree in (("release 8", plain), ("fit", fitted), ("practised", practised)):
        rows.append(
            f"{name}: mean {tree.mean():.3f}, worst {tree.min():.3f}, as good as the person in "
            f"{as_good(tree, own).mean():.0%} of folders, as what was shown in "
            f"{as_good(tree, shown).mean():.0%}"
        )
    return "\n".join([*rows, f"worse than person and folder without a warning: {silent}"])


@dataclass(frozen=True)
class Learned:
    """What ``eutree.learn`` made of one folder, or of nothing."""

    number: int
    start: float
    halfway: float
    end: float

    def __str__(self) -> str:
        """Return the line of the table."""
        figures = (self.start, self.halfway, self.end)
        return f"| {self.number} | {' | '.join(map(_figure, figures))} |"


LEARNED_HEAD = "| folder | start | {} episodes | {} episodes |\n|---|---|---|---|"


def learned(task: str, number: int, *, judged: int, nothing: bool, episodes: int) -> Learned:
    """Return what is reached at the start, and after half and all of the episodes of learning.

    Args:
        task: The task.
        number: Number of the folder, and the seed.
        judged: Episodes that say how good a tree is.
        nothing: Start from nothing in place of the folder and its tree of release 8.
        episodes: How long to learn; even.
    """
    env = TASKS[task].make()
    demonstrations = None if nothing else folder(task, number)
    expert = None if demonstrations is None else eutree.fit_expert_tree(demonstrations)
    after: dict[int, float] = {}

    def keep(run: Any) -> None:
        if run.episode in (0, episodes // 2, episodes) and run.episode not in after:
            tree = run.policy()
            seen = eutree.evaluate(tree, env, episodes=judged, seed=JUDGING_SEED)
            after[run.episode] = _merit(seen)

    eutree.learn(
        env,
        demonstrations=demonstrations,
        expert=expert,
        episodes=episodes,
        evaluate_every=episodes // 2,
        evaluation_episodes=1,
        seed=number,
        on_progress=keep,
    )
    return Learned(number, after[0], after[episodes // 2], after[episodes])


def learned_summary(rows: list[Learned]) -> str:
    """Return the figures of all folders; where returns are counted, of CartPole's 500."""
    table = np.array([(row.start, row.halfway, row.end) for row in rows])
    full = 0.95 if table.max() <= 1.0 else 475.0
    return (
        f"mean {table.mean(axis=0).round(3)}, worst {table.min(axis=0).round(3)}, "
        f"at least 95 %: {(table >= full).mean(axis=0).round(3)}"
    )


class Finished:
    """The folders that are done, in a file of JSON lines if there is one.

    Args:
        path: The file; None keeps nothing.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        lines = path.read_text().splitlines() if path is not None and path.exists() else []
        self._known = {entry["number"]: entry for entry in map(json.loads, lines)}

    def get(self, number: int) -> dict[str, Any] | None:
        """Return what came of a folder, if it is known."""
        return self._known.get(number)

    def add(self, entry: Line | Learned) -> None:
        """Keep what came of a folder."""
        if self._path is not None:
            with self._path.open("a") as file:
                file.write(json.dumps(asdict(entry)) + "\n")


def _line_of(known: dict[str, Any]) -> Line:
    traits, warnings = Traits(**known["traits"]), tuple(known["warnings"])
    return Line(**{**known, "traits": traits, "warnings": warnings})


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=TASKS, default="evasion")
    parser.add_argument("--folders", type=int, default=60)
    parser.add_argument("--first", type=int, default=FIRST_REPORTED)
    parser.add_argument("--judged", type=int, default=JUDGED)
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--learn", choices=("people", "nothing"))
    parser.add_argument("--learned", type=int, default=400, help="episodes, an even number")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    task, judged = arguments.task, arguments.judged
    numbers = range(arguments.first, arguments.first + arguments.folders)
    if arguments.save:
        for number in numbers:
            folder(task, number).save(arguments.save / str(number))
        return
    finished = Finished(arguments.keep)
    if arguments.learn:
        print(LEARNED_HEAD.format(arguments.learned // 2, arguments.learned))
        rows = []
        for number in numbers:
            known = finished.get(number)
            nothing = arguments.learn == "nothing"
            row = Learned(**known) if known else learned(
                task, number, judged=judged, nothing=nothing, episodes=arguments.learned
            )  # fmt: skip
            if known is None:
                finished.add(row)
            rows.append(row)
            print(row, flush=True)
        print(f"\n{learned_summary(rows)}")
        return
    print(HEAD)
    lines = []
    for number in numbers:
        known = finished.get(number)
        entry = _line_of(known) if known else line(
            task, number, judged=judged, episodes=arguments.episodes
        )  # fmt: skip
        if known is None:
            finished.add(entry)
        lines.append(entry)
        print(entry, flush=True)
    print(f"\n{summary(lines)}")


if __name__ == "__main__":
    main()
