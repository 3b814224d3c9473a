"""The episodes of a run: those in which the learner acts, and those of the race at the end."""

import inspect
from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np

from eutree.data import Episode
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import EpisodeSteps, Stream, success_of
from eutree.learners import Learner, Step
from eutree.learners.learner import ActsAmongAllowed, ChoosesStarts, HasTeacher
from eutree.policies import TreePolicy
from eutree.training.phases import Plan, RunState, generator_of
from eutree.training.progress import GatheredEpisodes
from eutree.training.raced_episodes import STARTS
from eutree.training.search import PolicySearch
from eutree.validation import check_integer


def gather(
    learner: Learner,
    env: GuardedEnv,
    state: RunState,
    gathered: GatheredEpisodes,
    *,
    seed: int,
    number: int,
    room: int | None,
) -> None:
    """Go through an episode of experience, or back to before it if the run is stopped within it.

    When the episode is over, the run's state is moved on and the episode is added to those
    gathered. One without a known limit is cut short after ``room`` steps, those left of the budget;
    None for no such budget.

    Raises:
        EnvironmentFault: The environment broke its contract; the learner is as it was before the
            episode.
    """

    def forget(*, whole: bool) -> None:
        """Be as before the episode, unless it was finished; if whole, all before it is saved."""
        learner.discard_episode()
        state.steps_of_episode = 0
        state.recorded.clear()
        state.whole = state.whole or whole

    knows_masks = bool(inspect.signature(learner.act).parameters)
    act_among = cast(ActsAmongAllowed, learner).act
    generator = generator_of(seed, Stream.EXPLORATION, number)
    state.whole = True  # until it has begun
    env.episode = number - 1  # a run that goes on has had others before
    observation = env.reset(_seed_of_next(learner, seed, number))
    state.whole = False
    learner.start_episode(observation, generator)
    earned, is_over, most = 0.0, False, env.schema.n_actions - 1
    try:
        while not is_over and not state.must_stop():
            allowed = env.allowed
            action = act_among(allowed) if knows_masks and allowed is not None else learner.act()
            if type(action) is not int or not 0 <= action <= most:  # a step is a few microseconds
                action = check_integer("what act of the method returns", action, high=most)
            if allowed is not None and not allowed[action]:
                action = int(generator.choice(np.flatnonzero(allowed)))
            try:
                observation, reward, terminated, truncated, info = env.step(action)
            except KeyboardInterrupt:  # before the learner knows of the step: all else is whole
                forget(whole=True)
                raise
            if state.steps_of_episode + 1 == room:
                truncated = not terminated
            step = Step(action, reward, observation, terminated, truncated, info, allowed)
            learner.observe(step)
            state.steps_of_episode += 1
            earned += reward
            is_over = terminated or truncated
            if is_over:
                learner.end_episode()
                length = _finished(state)
                gathered.append(earned, length, success_of(info))
            state.step_taken(step)
            if is_over:
                if isinstance(learner, HasTeacher) and learner.teacher_acts:
                    state.move(teacher_steps=state.at.teacher_steps + length)
                state.note_what_was_recorded()
    except Exception:
        forget(whole=True)
        raise
    if state.stopped:
        forget(whole=False)


def _seed_of_next(learner: Learner, seed: int, episode: int) -> int:
    """Return the seed of the next episode, or of the start at which a learner compares trees."""
    number = learner.next_start() if isinstance(learner, ChoosesStarts) else None
    if number is None:
        return episode_seed(seed, episode, Stream.TRAINING)
    return episode_seed(seed, number, Stream.COMPARING)


def _finished(state: RunState) -> int:
    """Count the episode that has ended; return its length."""
    length = state.steps_of_episode
    state.move(
        episode=state.at.episode + 1,
        steps=state.at.steps + length,
        longest=max(state.at.longest, length),
        fronted=False,
        judged=False,
    )
    state.steps_of_episode = 0
    return length


class Racing:
    """Runs the episodes that the policy search asks for, counted and noted in the run's state.

    Attributes:
        search: The policy search; None before it begins and after its end.
        result: The policy at the end of the race; None before.
    """

    def __init__(self, plan: Plan, state: RunState) -> None:
        self._plan = plan
        self._state = state
        self.search: PolicySearch | None = None
        self.result: TreePolicy | None = None

    @property
    def challengers(self) -> int:
        """Trees that were put to the test so far in the race under way."""
        return 0 if self.search is None else self.search.state.tried

    def run(self, search: PolicySearch, env: GuardedEnv) -> None:
        """Run one episode of the policy search, or end it."""
        self.search, state = search, self._state
        state.gathering_begins()
        state.whole = True  # a search is stored as it stood between two stages
        run = None if self._plan.time_is_over(state.at) else search.next_run()
        now = search.state
        if now.won > self._noted or run is None:
            self._noted = now.won
            facts = {"n_leaves": now.incumbent.n_leaves, "tried": now.tried, "won": now.won}
            state.note("race", facts)
        if run is None:
            self._end(search)
            return
        episode = self._run_episode(*run, env, self._plan.race_steps - state.at.racing_steps)
        if episode is not None:
            search.take(episode)
            state.move(racing_steps=state.at.racing_steps + len(episode))
            state.note_what_was_recorded()
        elif not state.stopped:  # longer than any before: it decides nothing
            state.move(racing_steps=self._plan.race_steps)
            self._end(search)

    @cached_property
    def _noted(self) -> int:
        """Wins that events tell of: a run that was stopped after one may go on before its event."""
        return max((one["won"] for one in self._state.events if one["event"] == "race"), default=0)

    def _end(self, search: PolicySearch) -> None:
        self.result, self.search = search.result, None
        self._state.gathering_ends()
        tried = self._state.at.challengers + search.state.tried
        self._state.move(raced=True, evaluated_at=-1, challengers=tried)

    def _run_episode(
        self, tree: TreePolicy, start: int, env: GuardedEnv, room: int
    ) -> Episode | None:
        """Run a tree from one of the race's starts; None if the run or its room ends before."""
        state = self._state
        block = episode_seed(self._plan.seed, start // STARTS, Stream.RACING)
        steps = EpisodeSteps(env, env.reset(episode_seed(block, start % STARTS)))
        try:
            while not steps.is_over:
                if state.must_stop() or len(steps) == room:
                    return None
                # The environment has the history already: its observations are the features.
                action = tree.act(tree.derivation.behind(steps.present).tolist(), env.allowed)
                said = steps.take(action)
                state.steps_of_episode += 1
                observation, reward, terminated, truncated, info = said
                state.step_taken(Step(action, reward, observation, terminated, truncated, info))
        finally:
            state.steps_of_episode = 0
        episode = steps.episode()
        return replace(episode, observations=tree.derivation.behind(episode.observations))
