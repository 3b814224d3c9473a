"""Is a person's time better spent taking over from the tree, or recording in advance?

    python benchmarks/taking_over.py --tune            # ways of taking over, on styles for tuning
    python benchmarks/taking_over.py [--seeds 15]      # the way chosen, on other styles and seeds
    python benchmarks/taking_over.py --by-playing      # the same, trees chosen as `fit` chooses

The people are those of ``people.py``, with hands of flesh, and three further styles. A person who
*records* plays on until so many steps are recorded. A person who *takes over* records three
episodes; then the tree drives, the person watches, notices four of five disagreements, holds the
keys for some steps and hands back. After each episode C4.5 is fitted to all that is known. Both
are compared at the same number of steps in which the person acted, demonstrations included; the
steps only watched are told beside. No tree practises.

What the person let pass may count as approval, with a weight; not so the steps right before a
correction or before a failure. A correction may weigh more than what was recorded in advance.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import eutree
from eutree.arrays import Booleans, Floats
from eutree.data import Demonstrations, Episode
from eutree.fitting.fit import mend, race
from eutree.fitting.playing import Player
from eutree.interaction import GuardedEnv, episode_seed
from eutree.learners.starts import SETTINGS, fitted_trees, promising
from people import (
    JUDGING_SEED,
    TASKS,
    Margins,
    Person,
    Traits,
    Wants,
    _looks_ahead,
    _waits,
    divided,
    hesitant,
)

CHECKED = (120, 200, 300)  # steps in which the person acted
FIRST_SHOWN = 3  # episodes recorded before the tree drives
NOTICED = 0.8  # chance that a disagreement is seen in time
MOST_EPISODES = 200  # that somebody watches
JUDGED = 300
Draw = Callable[[Traits, np.random.Generator], Wants]


@dataclass(frozen=True)
class Way:
    """How a person takes over, and what the tree makes of it.

    Attributes:
        approval: Weight of a step that was let pass.
        strength: Weight of a correction; a step recorded in advance weighs 1.
        hold: Steps for which the person goes on once the keys are held.
        spoilt: Steps before a correction, and before a failure, that count as no approval.
    """

    approval: float = 0.3
    strength: float = 1.0
    hold: int = 2
    spoilt: int = 0


WAYS = {
    "corrections alone": Way(approval=0.0),
    "corrections weigh 3": Way(approval=0.0, strength=3.0),
    "approval 0.3": Way(),
    "approval 0.3, hold 5": Way(hold=5),
    "approval 0.3, weigh 3": Way(strength=3.0),
    "approval 0.3, 2 spoilt": Way(spoilt=2),
    "approval 0.3, hold 5, 2 spoilt": Way(hold=5, spoilt=2),
    "approval 0.3, weigh 2, hold 3, 2 spoilt": Way(strength=2.0, hold=3, spoilt=2),
    "approval 0.3, weigh 2, hold 5, 2 spoilt": Way(strength=2.0, hold=5, spoilt=2),
    "approval 1, hold 3, 2 spoilt": Way(approval=1.0, hold=3, spoilt=2),
    "approval 1, hold 5, 2 spoilt": Way(approval=1.0, hold=5, spoilt=2),
    "approval 1, weigh 2, hold 3, 2 spoilt": Way(1.0, strength=2.0, hold=3, spoilt=2),
    "approval 1, weigh 3, hold 3, 3 spoilt": Way(1.0, strength=3.0, hold=3, spoilt=3),
    "approval 0.5, weigh 2, hold 3, 3 spoilt": Way(0.5, strength=2.0, hold=3, spoilt=3),
}
CHOSEN = "approval 1, hold 3, 2 spoilt"


def _drawn(near: float, far: float, t: Traits, g: np.random.Generator) -> Margins:
    return Margins.drawn(near, far, t, g)


EVASION = TASKS["evasion"]
TUNING: Mapping[str, Draw] = {
    name: EVASION.styles[name] for name in ("waits", "looks-ahead", "over-careful")
}
REPORTED: Mapping[str, Draw] = {
    "brisk": EVASION.styles["brisk"],
    "slows-early": EVASION.styles["slows-early"],
    "tails": lambda t, g: _looks_ahead(_drawn(3.5, 7.5, t, g)),
    "divided": lambda t, g: divided(_drawn(3.0, 8.6, t, g), g),
    "hesitant": lambda t, g: hesitant(_drawn(5.0, 8.6, t, g)),
    "tired": lambda t, g: _waits(_drawn(3.2, 8.8, t, g)),
}


class Hands:
    """A person of a style, in front of the environment.

    Args:
        style: Name of the style.
        draw: Makes what the style wants.
        seed: Seed of the person and of the starts.

    Attributes:
        acted: Steps in which the person acted.
    """

    def __init__(self, style: str, draw: Draw, seed: int) -> None:
        self.generator = np.random.default_rng(np.random.SeedSequence((seed, 29)))
        g = self.generator
        self._delay = 0.2 if style == "tired" else float(g.uniform(0.15, 0.35))
        self._tires = style == "tired"
        traits = Traits(
            delay=self._delay,
            noise=float(g.uniform(0.1, 0.5)),
            lapse=float(g.uniform(0.0, 0.08)),
            misses_first=bool(g.random() < 0.5),
        )
        self._person = Person(style, draw(traits, g), EVASION, traits, g)
        self.acted = 0

    def begin(self) -> None:
        """Sit before a new episode."""
        self._state: Any = None

    def wants(self, observation: Floats, held: int) -> int:
        """Return the action wanted; ``held`` is the one under way."""
        if self._tires:
            late = self._delay + 0.3 * min(self.acted / 300.0, 1.0)
            self._person.traits = replace(self._person.traits, delay=late)
        if self._state is not None:
            self._state = (self._state[0], np.array(held))
        action, self._state = self._person.predict(observation, self._state)
        return int(action)


@dataclass
class Known:
    """What is known so far: episodes, and a weight for each of their steps."""

    episodes: list[Episode] = field(default_factory=list)
    weights: list[Floats] = field(default_factory=list)
    by_hand: list[Booleans] = field(default_factory=list)

    def add(self, episode: Episode, weights: Floats, by_hand: Booleans) -> None:
        """Take in an episode."""
        self.episodes.append(episode)
        self.weights.append(weights)
        self.by_hand.append(by_hand)


class Teaching:
    """A person, an environment, and what has been shown.

    Args:
        style: Name of the style.
        draw: Makes what the style wants.
        seed: Seed of the person and of the starts.
    """

    def __init__(self, style: str, draw: Draw, seed: int) -> None:
        self.env = EVASION.make()
        self._guarded = GuardedEnv(self.env)
        self.hands, self.known, self._seed = Hands(style, draw, seed), Known(), seed
        self.watched = 0

    def episode(self, tree: eutree.TreePolicy | None, way: Way) -> None:
        """Play one episode: the person alone, or the tree with the person beside it."""
        hands, env = self.hands, self._guarded
        observation = env.reset(episode_seed(self._seed, 5000 + len(self.known.episodes)))
        hands.begin()
        seen, actions, rewards, by_hand = [observation], [], [], []
        left, held = 0, 0
        while True:
            wanted = hands.wants(observation, held)
            proposed = wanted if tree is None else tree.act(observation)
            if left == 0 and wanted != proposed and hands.generator.random() < NOTICED:
                left = way.hold
            mine = tree is None or left > 0
            left = max(left - 1, 0)
            held = wanted if mine else proposed
            observation, reward, terminated, truncated, info = env.step(held)
            hands.acted += mine
            self.watched += not mine
            seen.append(observation)
            actions.append(held)
            rewards.append(reward)
            by_hand.append(mine)
            if terminated or truncated:
                break
        success = bool(info.get("is_success"))
        episode = Episode(
            observations=np.array(seen), actions=np.array(actions), rewards=np.array(rewards),
            terminated=terminated, truncated=truncated and not terminated, is_success=success,
            ending=str(info.get("ending", "")),
        )  # fmt: skip
        acted = np.array(by_hand)
        self.known.add(episode, _weights(acted, success, tree is None, way), acted)

    def demonstrations(self) -> Demonstrations:
        """Return all that is known, approval included."""
        kept = self.known.episodes
        return Demonstrations(tuple(kept), self._guarded.schema, self._guarded.spec)

    def weights(self, steps: int) -> Floats:
        """Return the weight of each step up to so many that the person acted in."""
        acted = np.cumsum(np.concatenate(self.known.by_hand))
        return np.concatenate(self.known.weights) * (acted <= steps)

    def tree(self, steps: int = 10**6) -> eutree.TreePolicy:
        """Return what C4.5 of release 8 makes of all that is known up to so many steps."""
        return eutree.fit_expert_tree(self.demonstrations(), weights=self.weights(steps))

    def chosen(self, steps: int) -> eutree.TreePolicy:
        """Return the tree chosen by playing, as ``fit`` does, from weighted candidates."""
        shown, weights = self.demonstrations(), self.weights(steps)
        found = fitted_trees(shown, settings=SETTINGS, histories=(0, 1))
        challengers = []
        for entry in promising(found, 8):
            past = entry.policy.history
            known = shown.with_history(past) if past else shown
            policy = eutree.fit_expert_tree(known, settings=entry.settings, weights=weights)
            challengers.append(replace(entry, policy=replace(policy, history=past)))
        player = Player(self.env, self._seed)
        best, played = race(challengers, player, 600)
        return mend(best, played, shown, player, 60)[0].policy


def _weights(by_hand: Booleans, success: bool, alone: bool, way: Way) -> Floats:
    """Return the weights of an episode's steps."""
    if alone:
        return np.ones(len(by_hand))
    weights = np.where(by_hand, way.strength, way.approval)
    begins = np.flatnonzero(by_hand[1:] & ~by_hand[:-1]) + 1
    ends = [*begins.tolist(), *([] if success else [len(by_hand)])]
    for end in ends:
        before = np.arange(max(end - way.spoilt, 0), end)
        weights[before[~by_hand[before]]] = 0.0
    return weights


@dataclass(frozen=True)
class Course:
    """What one person's teaching reached: a success rate at each of ``CHECKED``."""

    reached: tuple[float, ...]
    watched: tuple[int, ...]


def course(style: str, draw: Draw, seed: int, way: Way | None, *, by_playing: bool) -> Course:
    """Return what comes of recording (no way) or of taking over."""
    teaching = Teaching(style, draw, seed)
    tree, reached, watched = None, [], []
    for number in range(MOST_EPISODES):
        drives = way is not None and number >= FIRST_SHOWN
        teaching.episode(tree if drives else None, way or Way())
        while len(reached) < len(CHECKED) and teaching.hands.acted >= CHECKED[len(reached)]:
            steps = CHECKED[len(reached)]
            found = teaching.chosen(steps) if by_playing else teaching.tree(steps)
            reached.append(_success(found, teaching))
            watched.append(teaching.watched)
        if len(reached) == len(CHECKED):
            return Course(tuple(reached), tuple(watched))
        if way is not None and number >= FIRST_SHOWN - 1:
            tree = teaching.tree()
    # The person found nothing more to correct: what was reached stays.
    found = teaching.chosen(CHECKED[-1]) if by_playing else teaching.tree()
    missing = len(CHECKED) - len(reached)
    reached += missing * [_success(found, teaching)]
    return Course(tuple(reached), (*watched, *(missing * [teaching.watched])))


def _success(tree: eutree.TreePolicy, teaching: Teaching) -> float:
    played = eutree.evaluate(tree, teaching.env, episodes=JUDGED, seed=JUDGING_SEED)
    return float(played.success_rate or 0.0)


def table(
    styles: Mapping[str, Draw], seeds: range, ways: Mapping[str, Way | None], *, by_playing: bool
) -> dict[str, Floats]:
    """Print the rows of all styles and ways; return [seeds, CHECKED] of all styles by way."""
    print("| style | how | " + " | ".join(map(str, CHECKED)) + " | worst at 300 | watched |")
    print("|---|---|" + "---|" * (len(CHECKED) + 2))
    every: dict[str, list[Floats]] = {name: [] for name in ways}
    watched: dict[str, list[int]] = {name: [] for name in ways}
    for style, draw in styles.items():
        for name, way in ways.items():
            found = [course(style, draw, s, way, by_playing=by_playing) for s in seeds]
            figures = np.array([one.reached for one in found])
            every[name].append(figures)
            watched[name] += [one.watched[-1] for one in found]
            seen = np.mean([one.watched[-1] for one in found])
            print(_row(style, name, figures, seen), flush=True)
    for name in ways:
        print(_row("**all**", name, np.concatenate(every[name]), np.mean(watched[name])))
    return {name: np.concatenate(parts) for name, parts in every.items()}


def _row(style: str, name: str, figures: Floats, watched: float) -> str:
    cells = [f"{value:.3f}" for value in figures.mean(axis=0)]
    return (
        f"| {style} | {name} | {' | '.join(cells)} | {figures[:, -1].min():.3f} | {watched:.0f} |"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tune", action="store_true")
    parser.add_argument("--seeds", type=int, default=15)
    parser.add_argument("--by-playing", action="store_true")
    parser.add_argument("--way", choices=WAYS, default=CHOSEN)
    arguments = parser.parse_args()
    alone: dict[str, Way | None] = {"recording alone": None}
    if arguments.tune:
        table(TUNING, range(arguments.seeds), {**alone, **WAYS}, by_playing=arguments.by_playing)
        return
    ways = {**alone, arguments.way: WAYS[arguments.way]}
    seeds = range(1000, 1000 + arguments.seeds)
    figures = table(REPORTED, seeds, ways, by_playing=arguments.by_playing)
    base, taken = figures["recording alone"], figures[arguments.way]
    print(
        f"\nat 200 by taking over {taken[:, 1].mean():.3f}, at 300 recorded {base[:, 2].mean():.3f}"
    )
    print(f"at 300: {taken[:, 2].mean():.3f} for {base[:, 2].mean():.3f}; worst "
          f"{taken[:, 2].min():.3f} for {base[:, 2].min():.3f}")  # fmt: skip


if __name__ == "__main__":
    main()
