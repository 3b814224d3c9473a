"""The plan of a run, of all that is asked of it: how is learned, and for how long.

Where no method is named, the one measured to be best for such a task learns. Planning in model
trees does much with little experience where features are few, and finds nothing to try where they
are many: imagined returns there order no trees any more. Nor do they where an angle is observed as
its cosine and sine, which turn into each other. A network as teacher needs steps, the more the
fewer features there are for it to be ahead, and demonstrations that fix its scales
(docs/results/auto.md has the tasks and figures, and from-nothing.md an angle's). Where both could
learn the sentence says which the other is.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.data import Demonstrations
from eutree.display import counted
from eutree.errors import InvalidArgumentError
from eutree.evaluation.evaluate import vector_form
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import EpisodeSteps, Stream
from eutree.interaction.spaces import spec_of
from eutree.learners import DEFAULT, Method, Start
from eutree.learners import method as method_of
from eutree.learners.episode_buffer import random_action
from eutree.learners.registry import checked_method
from eutree.training.evaluations import ProvenFirst
from eutree.training.handover import handover_for
from eutree.training.phases import MANY, Plan, curve_of, generator_of, is_dear
from eutree.training.proposals import SearchSettings
from eutree.training.run_folder import SHOWN
from eutree.training.values import Asked, Budget
from eutree.validation import check_integer, check_listed

# Steps that a teacher needs, by the number of features from which on; fewer features are planned.
ENOUGH_STEPS = {12: 20_000, 6: 90_000}
ENOUGH_FOR_ANGLES = 10_000  # where fewer features have a cosine and sine among them
ENOUGH_SHOWN = 5  # demonstrations

TEACHING = "distilled-dqn"

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class ChosenMethod:
    """A method and why it was chosen.

    Attributes:
        method: The method.
        reason: One sentence; "" where a method was named.
        alternative: Name of the other method that could learn; "" where there is none.
    """

    method: Method
    reason: str
    alternative: str = ""

    def said(self) -> str:
        """Return the reason with the alternative."""
        if not self.alternative:
            return self.reason
        return f"{self.reason}; the other is method {self.alternative!r}"


def default_for(
    shown: Demonstrations | None,
    steps: int | None,
    *,
    teacher: bool = False,
    features: int | None = None,
    turns: Callable[[], bool] = lambda: False,
) -> ChosenMethod:
    """Return the method that learns where none is named, and why.

    ``steps`` are the budget, None where it is counted otherwise. ``features`` is how many the
    environment has, if a run may show itself what nobody has shown, and ``turns`` tells whether two
    of them are an angle's cosine and sine, as far as that is not seen in what was shown.
    """
    if teacher:
        return ChosenMethod(method_of(TEACHING), "distilled-dqn learns: it asks the teacher")
    known = features if shown is None else shown.schema.n_features
    if known is None or (shown is not None and len(shown) < ENOUGH_SHOWN):
        return _planning(f"a network as teacher would need {ENOUGH_SHOWN} demonstrations")
    enough = next((n for k, n in ENOUGH_STEPS.items() if known >= k), None)
    many = counted(known, "feature")
    why = f"{many} are many for planning"
    few_turn = enough is None and steps is not None
    if few_turn and (turns() if shown is None else _turns(shown.observations)):
        enough, why = ENOUGH_FOR_ANGLES, "planning does little with an angle's cosine and sine"
    few = f"{many} {'is' if known == 1 else 'are'} few enough for it"
    if steps is None:
        return _planning(few if enough is None else "a network as teacher needs a budget of steps")
    if enough is None:
        return _planning(few, open_=True)
    if steps < enough:
        return _planning(
            f"of {many} a network as teacher would need {enough} steps, not {steps}", open_=True
        )
    reason = f"distilled-dqn learns: {why}, and {steps} steps are enough for a teacher of its own"
    return ChosenMethod(method_of(TEACHING), reason, DEFAULT.name)


def _turns(observations: Floats) -> bool:
    """Return whether two features, shape [n, d], are an angle's cosine and sine wherever it was."""
    moving = (observations != observations[:1]).any(axis=0)
    moving &= (np.abs(observations) <= 1.0).all(axis=0) & (observations % 1.0 != 0.0).any(axis=0)
    if moving.sum() < 2:
        return False
    from eutree.world_model.ensemble import circles_of  # and networks: few have an angle

    return circles_of(observations, np.flatnonzero(moving).tolist()).size > 0


@cache
def say(sentence: str) -> None:
    """Say once in a process which method was chosen, where a plain script's user sees it."""
    logger.warning("%s", sentence)


def _planning(reason: str, *, open_: bool = False) -> ChosenMethod:
    return ChosenMethod(DEFAULT, f"planning learns: {reason}", TEACHING if open_ else "")


def _begins_at_angles(env: GuardedEnv, seeds: Sequence[int]) -> bool:
    """Return whether a few features may be, and at the starts are, an angle's cosine and sine."""
    features = env.schema.features
    allowed = sum(one.low >= -1.0 and one.high <= 1.0 and not one.is_integer for one in features)
    if allowed < 2 or len(features) >= min(ENOUGH_STEPS):
        return False
    return _turns(np.array([env.reset(seed) for seed in seeds]))


EPISODES = 400  # where no budget is named


def shown_by_chance(
    asked: Asked,
    method: str | Method | None,
    start: str | None,
    env: gymnasium.Env[Any, Any],
    *,
    seed: int,
) -> tuple[ChosenMethod, Demonstrations | None]:
    """Return the method and, if it needs demonstrations, a few episodes of random actions.

    They fix a network's scales as well as a person's do. A run that goes on has them in its folder.
    """
    guarded = GuardedEnv(env, strict=asked.strict)
    schema, folder = guarded.schema, asked.folder
    seeds = [episode_seed(seed, number, Stream.RECORDING) for number in range(ENOUGH_SHOWN)]
    turns = partial(_begins_at_angles, guarded, seeds)
    choice = _choice_of(method, start, asked, None, features=schema.n_features, turns=turns)
    if start is not None or not choice.method.needs.chance_will_do:
        return choice, None
    begins = f"it begins from {ENOUGH_SHOWN} episodes of random actions, for nothing is shown"
    choice = replace(choice, reason="; ".join(filter(None, (choice.reason, begins))))
    if folder is not None and folder.resume and (kept := Path(folder.path) / SHOWN).exists():
        return choice, Demonstrations.load(kept)
    chance, episodes = generator_of(seed, Stream.START, 0), []
    for begun in seeds:
        steps = EpisodeSteps(guarded, guarded.reset(begun))
        while not steps.is_over:
            steps.take(random_action(chance, schema.n_actions, guarded.allowed))
        episodes.append(steps.episode(begun))
    return choice, Demonstrations(tuple(episodes), schema, guarded.spec, expert="random actions")


def planned(
    asked: Asked,
    method: str | Method | ChosenMethod | None,
    start: str | None,
    demonstrations: Demonstrations | None,
    env: gymnasium.Env[Any, Any] | None,
    *,
    seed: int,
) -> tuple[ChosenMethod, Plan]:
    """Return how is learned and how long, once all that is asked is known to be possible."""
    schedule = asked.evaluation
    words = {"evaluate_every": schedule.every, "evaluation_episodes": schedule.episodes}
    for word, number in words.items():
        if number is not None:
            check_integer(word, number, low=1)
    budget, handover, minutes = asked.budget, asked.handover, asked.budget.minutes
    if env is None:
        _check_acts_nowhere(asked)
    races, keeps = budget.race_steps, handover.keep_success
    choice = _choice_of(method, start, asked, demonstrations, offline=env is None)
    chosen = _bounded(choice.method, asked)
    race = SearchSettings(steps=races, max_leaves=handover.max_leaves, keep_success=keeps)
    expected = _expected(budget, demonstrations, env)
    usual = EPISODES if budget.is_open else MANY  # only where nothing else ends the run
    decides = keeps or handover.prefer_proven is not None
    every, played = curve_of(schedule.every, schedule.episodes, expected, decides=decides)
    plan = Plan(
        episodes=budget.episodes if budget.episodes is not None else usual,
        steps=budget.steps,
        seconds=None if minutes is None else 60.0 * minutes,
        evaluate_every=every,
        evaluation_episodes=played,
        is_dear=is_dear(expected),
        gathers=env is not None,
        race=race if races else None,
        keep_success=keeps,
        handover=handover_for(chosen, handover),
        monotone=check_listed("monotone", asked.monotone),
        seed=seed,
    )
    if handover.prefer_proven is not None:
        if env is None or plan.handover is None or not plan.handover.has_front:
            raise InvalidArgumentError(
                "prefer_proven needs several trees to choose among: a front or, with learn_runs, "
                "several runs"
            )
        ProvenFirst(spec_of(env), handover.prefer_proven)
    return replace(choice, method=chosen), plan


def _expected(
    budget: Budget, demonstrations: Demonstrations | None, env: gymnasium.Env[Any, Any] | None
) -> int | None:
    """Return how many episodes a run will have, about, those of a race included.

    None where they run side by side, and where that cannot be known: how long one will be is known
    from the demonstrations, or from the environment's limit.
    """
    if env is None or vector_form(env) is not None:
        return None
    length = None if env.spec is None else env.spec.max_episode_steps
    if demonstrations is not None and len(demonstrations):
        length = max(demonstrations.n_transitions // len(demonstrations), 1)
    if length is None:
        return None if budget.race_steps else budget.episodes
    counts = [] if budget.episodes is None else [budget.episodes + budget.race_steps // length]
    counts += [] if budget.steps is None else [budget.steps // length]
    return min(counts, default=EPISODES if budget.is_open else None)


def check_races(plan: Plan, start: Start) -> None:
    """Raise InvalidArgumentError for a race that would have nothing to go by."""
    if plan.race_steps and not (plan.episodes or start.episodes):
        raise InvalidArgumentError(
            "race_steps needs stored transitions: give demonstrations or at least one episode"
        )
    if plan.steps is not None and plan.race_steps > plan.steps:
        raise InvalidArgumentError(
            f"race_steps must be at most steps, {plan.steps}, got {plan.race_steps}"
        )
    if plan.race_steps and plan.race_steps == plan.steps and not start.episodes:
        raise InvalidArgumentError(
            f"race_steps must be less than steps, {plan.steps}, without demonstrations, "
            f"got {plan.race_steps}"
        )


def check_monotone(plan: Plan, method: Method) -> None:
    """Raise InvalidArgumentError for rules about features that sums may be made of."""
    if plan.monotone and (sums := getattr(method, "sums", 0)):
        raise InvalidArgumentError(
            f"sums must be 0 with monotone rules: they change with the features, got {sums}"
        )


def _check_acts_nowhere(asked: Asked) -> None:
    """Raise InvalidArgumentError for wishes that need an environment to act in."""
    if races := asked.budget.race_steps:
        raise InvalidArgumentError(
            f"race_steps must be 0 without an environment to run them in, got {races}"
        )
    for name in ("steps", "minutes"):
        if (limit := getattr(asked.budget, name)) is not None:
            raise InvalidArgumentError(f"{name} must be None without an environment, got {limit}")
    if asked.handover.keep_success:
        raise InvalidArgumentError("keep_success must be False without an environment, got True")
    if asked.handover.against is not None:
        raise InvalidArgumentError("against needs an environment to act in")
    if asked.starts:
        raise InvalidArgumentError("starts must be empty without an environment to begin there")


def _choice_of(
    method: str | Method | ChosenMethod | None,
    start: str | None,
    asked: Asked,
    shown: Demonstrations | None,
    *,
    offline: bool = False,
    features: int | None = None,
    turns: Callable[[], bool] = lambda: False,
) -> ChosenMethod:
    """Return the method that is meant, and why where nobody said so; that is said aloud, too."""
    if isinstance(method, ChosenMethod):
        return method
    if method not in (None, "auto"):
        own = method_of(method) if isinstance(method, str) else checked_method(method)
        return ChosenMethod(own, "")
    only_planning = (
        asked.budget.race_steps,
        asked.handover.keep_success,
        asked.history,
        asked.max_transitions,
    )
    if offline or any(only_planning) or start not in (None, "demos", "tree+demos"):
        return ChosenMethod(method_of("corrected" if offline else "default"), "")
    teacher = asked.teacher is not None
    choice = default_for(shown, asked.budget.steps, teacher=teacher, features=features, turns=turns)
    if choice.alternative:
        say(choice.said())
    return choice


def _bounded(method: Method, asked: Asked) -> Method:
    """Return a method with the bounds on its memory and on the leaves that it ends with.

    Where a race sees to the leaves a planner knows no limit: the trials of its explorers are the
    history to which the race's models are fitted (``docs/decisions/racing.md``).
    """
    changes: dict[str, Any] = {}
    if (most := asked.max_transitions) is not None:
        if not hasattr(method, "max_transitions"):
            raise InvalidArgumentError(
                f"max_transitions must be None for method {method.name!r}, got {most}"
            )
        changes["max_transitions"] = most
    if (leaves := asked.handover.max_leaves) is not None:
        check_integer("max_leaves", leaves, low=2)
        planner = getattr(method, "planner", None)
        if hasattr(method, "max_leaves"):
            changes["max_leaves"] = leaves
        elif planner is not None and not asked.budget.race_steps:
            improvement = replace(planner.improvement, max_leaves=leaves)
            changes["planner"] = replace(planner, improvement=improvement)
        elif not asked.budget.race_steps:
            raise InvalidArgumentError(
                f"max_leaves must be None for method {method.name!r} without race_steps, "
                f"got {leaves}"
            )
    return cast(Method, replace(cast(Any, method), **changes)) if changes else method
