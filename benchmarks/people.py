"""Simulated people at the recorder: what they show, what `fit` makes of it, what practice adds.

    python benchmarks/people.py [--task evasion] [--folders 60] [--first 1000] [--keep FILE]
    python benchmarks/people.py --task new-evasion --folders 24 --first 2000 [--keep FILE]
    python benchmarks/people.py --learn people|nothing [--learned 400] [...]
    python benchmarks/people.py --task paper-evasion --save people --folders 5

A *person* is a style of playing with hands of flesh: decides by what was to be seen some 150 to
350 ms ago, misjudges distances, lapses now and then into holding the last key, and may miss the
first decision, which falls while the countdown still fades. A *folder* is what one person recorded
in 15 episodes. Folder k is drawn from the seed k alone: 0 to 999 are for tuning, the rest for
reports. Whoever wants to teach a learner like a person in a test takes ``person(task, k)``.

For each folder a line is printed: what the person reaches in many episodes and in the folder; the
tree of C4.5 release 8; what ``eutree.fit`` returns alone, after the person has watched it in ten
episodes and taken over where it was wrong, and after 100 episodes of practice, each played in the
same further episodes. Steps are those of an episode; minutes are the person's, at speed 1, with
the countdowns. ``new-evasion`` has six further styles, some of which change as they play; what
such a person reaches is counted in sessions of 15 episodes, each begun afresh. ``--learn people``
prints what ``eutree.learn`` makes of the tree of release 8, of a folder as bad as it may be, in
half of ``--learned`` episodes and in all;
``--learn nothing`` what it makes of nothing, with the folders' numbers as seeds. (An episode of
CartPole has up to 500 decisions: ``--task cartpole --learned 100``.) ``--keep`` names a file of
finished folders: a run that is started again goes on from there. ``--save`` names a folder in which
what the people recorded is written, and no more: ``eutree reproduce search --demos`` takes it.
"""

import argparse
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.arrays import Booleans, Floats, Integers
from eutree.data import Episode
from eutree.evaluation import Evaluation
from eutree.interaction import GuardedEnv, episode_seed
from eutree.recording.scenes import Course

ROOT = Path(__file__).resolve().parent.parent
FIRST_REPORTED = 1000
EPISODES = 15  # of a folder
WATCHED, NOTICED, HOLD = 10, 0.8, 3  # episodes; share of disagreements; steps a key is then held
BETWEEN = 4.0  # seconds between two episodes: the countdown, and a look at the end
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
        remembers: Whether a way of playing remembers what was: then only one episode is played at a
            time, and in sessions.
    """

    make: Callable[[], gymnasium.Env[Any, Any]]
    interval: float
    spread: tuple[float, ...]
    idle: int
    styles: Mapping[str, Callable[[Traits, np.random.Generator], Wants]]
    remembers: bool = False


def _tired(own: Traits, decisions: int) -> Traits:
    """React later and later, by 0.3 s after 300 decisions."""
    return replace(own, delay=own.delay + 0.3 * min(decisions / 300.0, 1.0))


def _learning(own: Traits, decisions: int) -> Traits:
    """Misjudge and lapse a lot at first, and be as good as one gets after 100 decisions."""
    strange = 1.0 - min(decisions / 100.0, 1.0)
    return replace(own, noise=own.noise + 0.8 * strange, lapse=own.lapse + 0.2 * strange)


CHANGING = {"tired": _tired, "learning": _learning}  # styles whose traits change as they play


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
        self._own, self._decisions = traits, 0
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
        if self.__name__ in CHANGING:
            self.traits = CHANGING[self.__name__](self._own, self._decisions)
            self._decisions += 1
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


def divided(margins: Margins, generator: np.random.Generator) -> Wants:
    """Wait at a line, but look at one opponent only for a step or two, now and then."""
    wait, glance = _waits(margins), [0, 0]  # steps left, the opponent looked at

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        if glance[0] == 0 and generator.random() < 0.25:
            glance[:] = int(generator.integers(1, 3)), int(generator.integers(1, 3))
        if glance[0] > 0:
            glance[0] -= 1
            seen = seen.copy()
            seen[..., 3 - glance[1]] = 12.0
        return wait(seen, moved, held)

    return wants


def hesitant(margins: Margins) -> Wants:
    """Stop far from a line, and let the first chance pass."""
    state = {"at": 0.0, "line": -1, "was_near": False, "chances": 0}

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        position = float(seen[0])
        if position < state["at"] - 2.0:
            state.update(line=-1, was_near=False, chances=0)
        state["at"] = position
        ahead = margins.ahead(seen)
        lines = np.flatnonzero((ahead > margins.last) & (ahead <= margins.near))
        if not lines.size:
            return np.array(GO)
        line = int(lines[0])
        if line != state["line"]:
            state.update(line=line, was_near=False, chances=0)
        near = bool(abs(seen[1 + line]) < margins.far)
        state["chances"] += state["was_near"] and not near
        state["was_near"] = near
        patient = state["chances"] < (2 if line == 0 else 1)
        return np.array(STOP if near or (patient and held == STOP) else GO)

    return wants


def _by_waiting(margins: Margins, *, least: int, tires_by: float) -> Wants:
    """Wait at a line for ``least`` steps in any case, then as the patience lasts.

    With each further step of waiting an opponent may be nearer by ``tires_by`` [m], down to 4 m.
    """
    waited = [0]

    def wants(seen: Floats, moved: Floats, held: Integers) -> Integers:
        distance = margins.ahead(seen)
        at_line = (distance > margins.last) & (distance <= margins.near)
        far = max(margins.far - tires_by * max(waited[0] - 2, 0), 4.0)
        near = (at_line & (np.abs(seen[1:]) < far)).any()
        stops = near or (at_line.any() and waited[0] < least)
        waited[0] = waited[0] + 1 if stops else (waited[0] if at_line.any() else 0)
        return np.array(STOP if stops else GO)

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


def _new_styles() -> Mapping[str, Callable[[Traits, np.random.Generator], Wants]]:
    """Return further ways of playing Evasion, all of which took no part in any choice."""
    drawn = Margins.drawn
    return {
        "divided": lambda t, g: divided(drawn(3.0, 8.6, t, g), g),
        "hesitant": lambda t, g: hesitant(drawn(5.0, 8.6, t, g)),
        "tired": lambda t, g: _waits(drawn(3.2, 8.8, t, g)),
        "learning": lambda t, g: _waits(drawn(3.0, 8.6, t, g)),
        "impatient": lambda t, g: _by_waiting(drawn(3.0, 8.8, t, g), least=0, tires_by=0.8),
        "stop-sign": lambda t, g: _by_waiting(drawn(3.0, 8.4, t, g), least=1, tires_by=0.0),
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
    "new-evasion": replace(
        _evasion("eutree/Evasion2-v0", LINES), styles=_new_styles(), remembers=True
    ),
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
    taken_over: float = float("nan")
    by_hand: int = 0  # steps in which the person took over
    watched: int = 0  # further steps of those episodes
    steps: tuple[float, float, float] = (0.0, 0.0, 0.0)  # person, fitted, practised
    minutes: tuple[float, float] = (0.0, 0.0)  # recording, watching

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
            _figure(self.taken_over),
            f"{self.by_hand} of {self.by_hand + self.watched}",
            _figure(self.practised),
            ", ".join(f"{value:.1f}" for value in self.steps),
            " + ".join(f"{value:.1f}" for value in self.minutes),
        )
        return f"| {' | '.join(map(str, cells))} |"


HEAD = """| folder | style | delay, noise, lapses | person | shown | release 8 | leaves | `fit` | \
warnings | taken over | by hand | `fit --practise 100` | steps | minutes |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"""


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

    def plays(policy: Any) -> Any:
        return eutree.evaluate(policy, env, episodes=judged, seed=JUDGING_SEED)

    demonstrations = folder(task, number)
    practised = eutree.fit(demonstrations, env, episodes=episodes, practise=100, seed=number)
    alone = practised.before_practice
    assert alone is not None
    corrected = take_over(task, number, demonstrations, alone.policy)
    taken = eutree.fit(corrected, env, episodes=episodes, seed=number).policy
    driven = [episode for episode in corrected if episode.by_hand is not None]
    by_hand = int(sum(episode.by_hand.sum() for episode in driven))
    watched = sum(map(len, driven)) - by_hand
    hands = person(task, number)
    own = _sessions(task, number, judged) if TASKS[task].remembers else plays(hands)
    fitted, better = plays(alone.policy), plays(practised.policy)
    shown = alone.person
    return Line(
        number=number,
        style=hands.__name__,
        traits=hands.traits,
        person=_merit(own),
        shown=shown.mean_return if shown.success_rate is None else shown.success_rate,
        release_8=_merit(plays(eutree.fit_expert_tree(demonstrations))),
        leaves=alone.policy.n_leaves,
        fitted=_merit(fitted),
        warnings=alone.warnings,
        practised=_merit(better),
        taken_over=_merit(plays(taken)),
        by_hand=by_hand,
        watched=watched,
        steps=tuple(one.mean_length for one in (own, fitted, better)),
        minutes=(
            _minutes(task, demonstrations.n_transitions, EPISODES),
            _minutes(task, by_hand + watched, WATCHED),
        ),
    )


def _minutes(task: str, steps: int, episodes: int) -> float:
    return (steps * TASKS[task].interval + episodes * BETWEEN) / 60.0


def _sessions(task: str, number: int, judged: int) -> Any:
    """Return what a person reaches who changes as they play: in many sessions, each the first."""
    shown = [
        episode
        for session in range(judged // EPISODES)
        for episode in eutree.record(
            TASKS[task].make(), person(task, number), episodes=EPISODES, seed=10**6 + session
        )
    ]
    return Evaluation(
        returns=np.array([episode.undiscounted_return for episode in shown]),
        lengths=np.array([len(episode) for episode in shown]),
        endings=np.array([episode.ending for episode in shown]),
        successes=np.array([episode.is_success for episode in shown], dtype=bool),
    )


def take_over(
    task: str, number: int, shown: eutree.Demonstrations, tree: eutree.TreePolicy
) -> eutree.Demonstrations:
    """Return the demonstrations after a person watched the tree drive and stepped in.

    As in the recorder's page: what was let pass counts, and C4.5 is fitted after each episode.
    """
    env, hands = TASKS[task].make(), person(task, number)
    generator = np.random.default_rng(np.random.SeedSequence((number, 31)))
    known = shown
    for watched in range(WATCHED):
        episode = _driven(env, hands, tree, episode_seed(number, 5000 + watched), generator)
        known = replace(known, episodes=(*known.episodes, episode))
        tree = eutree.fit_expert_tree(known)
    return known


def _driven(
    env: gymnasium.Env[Any, Any],
    hands: Person,
    tree: eutree.TreePolicy,
    seed: int,
    generator: np.random.Generator,
) -> Episode:
    """Return an episode in which a tree drove and a person took over."""
    guarded = GuardedEnv(env)
    observations, actions, rewards, by_hand = [guarded.reset(seed)], [], [], []
    state, left, course = None, 0, Course(tree)
    while True:
        wanted, state = hands.predict(observations[-1], state)
        proposed = course.decide(observations[-1], guarded.allowed)
        if left == 0 and wanted != proposed and generator.random() < NOTICED:
            left = HOLD
        by_hand.append(left > 0)
        left = max(left - 1, 0)
        actions.append(int(wanted if by_hand[-1] else proposed))
        state = (state[0], np.array(actions[-1]))  # what is under way
        observation, reward, terminated, truncated, info = guarded.step(actions[-1])
        observations.append(observation)
        rewards.append(reward)
        if terminated or truncated:
            return Episode(
                observations=np.array(observations), actions=np.array(actions),
                rewards=np.array(rewards), terminated=terminated,
                truncated=truncated and not terminated, seed=seed,
                is_success=info.get("is_success"), ending=str(info.get("ending", "")),
                steps={"by_hand": np.array(by_hand)},
            )  # fmt: skip


def summary(lines: list[Line]) -> str:
    """Return the figures of all folders."""
    own, shown, plain, fitted, taken, practised = (
        np.array([getattr(entry, name) for entry in lines])
        for name in ("person", "shown", "release_8", "fitted", "taken_over", "practised")
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
    trees = (("release 8", plain), ("fit", fitted), ("taken over", taken), ("practised", practised))
    for name, tree in trees:
        rows.append(
            f"{name}: mean {tree.mean():.3f}, worst {tree.min():.3f}, as good as the person in "
            f"{as_good(tree, own).mean():.0%} of folders, as what was shown in "
            f"{as_good(tree, shown).mean():.0%}"
        )
    steps, minutes = (np.mean([getattr(e, name) for e in lines], axis=0).round(1)
                      for name in ("steps", "minutes"))  # fmt: skip
    rows.append(f"steps of person, fit, practised {steps}; minutes recording, watching {minutes}")
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
    plural = {name: tuple(known[name]) for name in ("warnings", "steps", "minutes")}
    return Line(**{**known, **plural, "traits": Traits(**known["traits"])})


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
