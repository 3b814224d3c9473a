"""A tree drives in the recorder's picture: the episodes it shows, and the outcome of each.

The episodes are those that judged the tree, from the same seeds, so a failure that was counted is
a failure that is seen. Failures come first. Why an episode failed is found by playing: which one
decision, taken otherwise for a few steps, would have led to a better end.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.data import Episode
from eutree.interaction import GuardedEnv, run_episode
from eutree.interaction.acting import Actor
from eutree.interaction.episode import EpisodeSteps
from eutree.policies import TreePolicy
from eutree.trees.text import Digits, printable

MOST_SCENES, MOST_FAILURES = 8, 6
HELD = (1, 2, 3, 5, 8)  # steps for which another action is tried
TRIED_STEPS = 12  # decisions before the end that are tried
PLAYED_STEPS = 20_000  # of an environment, at most, to find out about one failure
FEW = 4  # features in a sentence


@dataclass(frozen=True)
class Scene:
    """An episode to show."""

    seed: int  # of its reset
    why: str = ""  # the cause of its failure, in a sentence; empty if none, or none is known


@dataclass(frozen=True, eq=False)
class Programme:
    """A tree, and the episodes in which it is to be seen.

    Attributes:
        policy: The tree that drives.
        scenes: The episodes, failures first; none where there is nothing to watch.
        note: A sentence on all of them: ``"4 of 200 episodes failed"``.
        refit: Makes the tree of all that is stored by now; None where nobody may take over.
    """

    policy: TreePolicy
    scenes: tuple[Scene, ...] = ()
    note: str = ""
    refit: Callable[[], TreePolicy] | None = None


def worst_first(returns: Floats, successes: Sequence[bool] | None) -> tuple[list[int], int]:
    """Return which of E episodes to show, and how many of them come first because they failed."""
    failed = np.zeros(len(returns), bool) if successes is None else ~np.asarray(successes)
    order = np.lexsort((returns, ~failed)).tolist()
    n_failed = min(int(failed.sum()), MOST_FAILURES)
    rest = order[int(failed.sum()) :]
    chosen = order[:n_failed] + rest[-max(2, 3 - n_failed) :] if n_failed else order[:3]
    return chosen[:MOST_SCENES], n_failed


def missing(
    policy: TreePolicy, seeds: Sequence[int], successes: Sequence[bool], env: GuardedEnv
) -> Scene | None:
    """Return an episode with a situation never shown, named in ``why``; None if none is found.

    It is a failure in which one decision, taken otherwise, would have led to success. The seeds are
    those of episodes that the tree of all demonstrations so far has played in ``env``.
    """
    failed = [seed for seed, success in zip(seeds, successes, strict=True) if not success]
    for seed in failed[:MOST_FAILURES]:
        why = next(_reasons(run_episode(env, policy, seed), policy, env), "")
        if why:
            count = f"The tree of what you have shown so far fails in {len(failed)} of {len(seeds)}"
            return Scene(seed, f"{count} episodes, for example: {why[0].lower()}{why[1:]}")
    return None


def explained(scene: Scene, policy: TreePolicy, env: GuardedEnv) -> Scene:
    """Return the scene with a sentence on the cause of its failure, found by playing it otherwise.

    Raises:
        EnvironmentFault: The environment broke its contract.
    """
    shown = run_episode(env, policy, scene.seed)
    return replace(scene, why=next(_reasons(shown, policy, env), "") or _last_words(shown, policy))


class Course:
    """The decisions of a tree in one episode, and the way through the tree that each one takes."""

    def __init__(self, policy: TreePolicy) -> None:
        self.policy = policy
        self._digits = Digits(policy.schema, policy.tree)
        self._state: Floats | None = None
        self.action = 0
        self.nodes: tuple[int, ...] = ()
        self.tests: tuple[str, ...] = ()

    def decide(self, observation: Floats, allowed: Booleans | None = None) -> int:
        """Return the action at an observation, shape [d]; ``nodes`` and ``tests`` say why."""
        policy = self.policy
        action, self._state = policy.predict(observation, self._state, action_masks=allowed)
        seen = observation if self._state is None else self._state[: policy.features.n_features]
        self.nodes = policy.tree.path(policy.tree.leaf_of(seen.tolist()))
        self.tests = tuple(self._test(node, float(seen[policy.tree.feature[node]]))
                           for node in self.nodes[:-1])  # fmt: skip
        self.action = int(action)
        return self.action

    def _test(self, node: int, value: float) -> str:
        """Return one test of the way, with the value sensed: ``"position 6.2 m ≤ 7.1"``."""
        tree, feature = self.policy.tree, int(self.policy.tree.feature[node])
        cut = float(tree.threshold[node])
        words = self._digits.at_most if value <= cut else self._digits.above
        test = words(feature, cut).replace("<=", "≤").replace(">=", "≥")
        return f"{_valued(self.policy, feature, value)} {test}"


def _valued(policy: TreePolicy, feature: int, value: float) -> str:
    of = policy.schema.features[feature]
    return f"{printable(of.name)} {of.text(value)}" + (f" {printable(of.unit)}" if of.unit else "")


def _reasons(shown: Episode, policy: TreePolicy, env: GuardedEnv) -> Iterator[str]:
    """Yield the decisions that would have been better, the one nearest to the end first."""
    length, played = len(shown), 0
    for step in _suspects(shown, policy):
        taken = int(shown.actions[step])
        for other in range(policy.schema.n_actions):
            for held in HELD if other != taken else ():
                if played > PLAYED_STEPS:
                    return
                again = _otherwise(shown, step, other, held, policy, env)
                played += len(again)
                if _is_better(again, shown):
                    yield _sentence(shown, step, other, held, again, policy)
        if step < length - TRIED_STEPS:
            return


def _suspects(shown: Episode, policy: TreePolicy) -> list[int]:
    """Return the decisions to try: the last ones; where one leaf decided to the end, its first."""
    length = len(shown)
    last = list(range(length - 1, max(length - 1 - TRIED_STEPS, -1), -1))
    if not shown.truncated:
        return last
    leaves = policy.tree.leaf_index(shown.with_features(policy.features).observations[:-1])
    elsewhere = np.flatnonzero(leaves != leaves[-1])
    return [int(elsewhere[-1]) + 1 if elsewhere.size else 0, *last]


def _otherwise(
    shown: Episode, step: int, other: int, held: int, policy: TreePolicy, env: GuardedEnv
) -> Episode:
    """Play the episode again, with another action for some steps from one on."""
    steps, actor = EpisodeSteps(env, env.reset(shown.seed)), Actor(policy, env)
    while not steps.is_over:
        at, action = len(steps), actor.act(steps.present, env.allowed)
        if at < step + held:
            action = other if at >= step else int(shown.actions[at])
        if env.allowed is not None and not env.allowed[action]:
            action = int(env.allowed.argmax())
        steps.take(action)
    return steps.episode(shown.seed)


def _is_better(again: Episode, shown: Episode) -> bool:
    if shown.is_success is None:
        gain = again.undiscounted_return - shown.undiscounted_return
        return gain > 0.1 * abs(shown.undiscounted_return)
    return bool(again.is_success)


def _sentence(
    shown: Episode, step: int, other: int, held: int, again: Episode, policy: TreePolicy
) -> str:
    names = policy.schema.actions
    taken = int(shown.actions[step])
    stays = shown.truncated and (shown.actions[step:] == taken).all()
    did = (
        f"From step {step + 1} on it took only {printable(names[taken])}"
        if stays
        else f"At step {step + 1} it took {printable(names[taken])}"
    )
    where = _circumstances(shown, step, policy)
    whole = f"it would have earned {again.undiscounted_return:.4g}, not " \
            f"{shown.undiscounted_return:.4g}"  # fmt: skip
    then = whole if shown.is_success is None else f"the end would have been {again.ending!r}"
    how_long = "there" if held == 1 else f"for {held} steps"
    return f"{did}{where}. With {printable(names[other])} {how_long}, {then}."


def _last_words(shown: Episode, policy: TreePolicy) -> str:
    """Return the last decision in words, where no single decision would have been better."""
    names, step = policy.schema.actions, len(shown) - 1
    return (
        f"The last decision was {printable(names[int(shown.actions[step])])}"
        f"{_circumstances(shown, step, policy)}. No single decision of the last ones, taken "
        "otherwise, would have helped: it went wrong earlier."
    )


def _circumstances(shown: Episode, step: int, policy: TreePolicy) -> str:
    """Return the values sensed then, those first that the tree tests: `` with ...``."""
    rows, schema = shown.with_features(policy.features).observations, policy.schema
    seen, before = rows[step], rows[max(step - 1, 0)]
    path = policy.tree.path(policy.tree.leaf_of(seen.tolist()))[:-1]
    asked = list(dict.fromkeys(int(policy.tree.feature[node]) for node in reversed(path)))
    few = schema.n_features <= FEW
    named = [*asked, *(f for f in range(schema.n_features) if few and f not in asked)][:FEW]
    parts = [
        _valued(policy, f, float(seen[f])) + _trend(float(seen[f]), float(before[f])) for f in named
    ]
    only = ", ".join(printable(schema.features[f].name) for f in asked)
    unasked = f" (it asked for {only} alone)" if asked and len(asked) < len(named) else ""
    return f" with {', '.join(parts)}{unasked}" if parts else ""


def _trend(value: float, before: float) -> str:
    """Return whether a quantity with two signs comes near; the rest is in the numbers."""
    return " and nearing 0" if value * before > 0.0 and abs(value) < abs(before) else ""


def scenes(
    policy: TreePolicy,
    seeds: Sequence[int],
    returns: Floats,
    successes: Sequence[bool] | None,
    env: GuardedEnv,
) -> Programme:
    """Return the scenes of a tree that has played episodes, worst first, failures explained.

    Seeds, returns and successes (None if not reported) are those of its episodes, [E] each.
    """
    chosen, n_failed = worst_first(returns, successes)
    found = [Scene(seeds[k]) for k in chosen]
    failures = [explained(scene, policy, env) for scene in found[:n_failed]]
    count = 0 if successes is None else int((~np.asarray(successes)).sum())
    note = f"{count} of {len(seeds)} episodes failed" if count else "no failure seen"
    note = f"the lowest of {len(seeds)} returns" if successes is None else note
    return Programme(policy, (*failures, *found[n_failed:]), note)
