"""The episodes of a run: those in which the learner acts, and those of the race at the end."""

import inspect
from typing import Any, cast

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.data import Episode
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import EpisodeSteps, Stream, success_of
from eutree.learners import Learner, Step
from eutree.learners.learner import ActsAmongAllowed, ChoosesStarts, HasTeacher
from eutree.policies import TreePolicy
from eutree.training.phases import Plan, RunState
from eutree.training.progress import GatheredEpisodes
from eutree.training.raced_episodes import STARTS
from eutree.training.search import PolicySearch


def seed_of_next(learner: Learner, seed: int, episode: int) -> int:
    """Return the seed of the next episode, or of the start at which a learner compares trees."""
    number = learner.next_start() if isinstance(learner, ChoosesStarts) else None
    if number is None:
        return episode_seed(seed, episode, Stream.TRAINING)
    return episode_seed(seed, number, Stream.COMPARING)


class GatheringEpisode:
    """One episode of experience, from its reset to its end.

    Args:
        learner: Who acts, and learns from each step what it will.
        env: Where.
        state: Where the run stands; moved on when the episode is over.
        gathered: The episodes so far; this one is added when it is over.
        room: Steps left of the budget, at which an episode without a known limit is cut short; None
            for no such budget.
    """

    def __init__(
        self,
        learner: Learner,
        env: GuardedEnv,
        state: RunState,
        gathered: GatheredEpisodes,
        *,
        room: int | None = None,
    ) -> None:
        self._learner = learner
        self._env = env
        self._state = state
        self._gathered = gathered
        self._room = room
        takes_masks = bool(inspect.signature(learner.act).parameters)
        self._among = cast(ActsAmongAllowed, learner) if takes_masks else None
        self._return = 0.0
        self._is_over = False
        self._observations: list[Floats] = []

    def run(self, seed: int, generator: np.random.Generator) -> None:
        """Go through the episode, or back to before it if the run is stopped within it.

        Args:
            seed: Seed of the environment.
            generator: Source of the learner's chance.

        Raises:
            EnvironmentFault: The environment broke its contract; the learner is as it was before
                the episode.
        """
        self._state.whole = True  # until it has begun
        observation = self._env.reset(seed)
        self._state.whole = False
        self._generator = generator
        self._learner.start_episode(observation, generator)
        self._observations = [observation]
        try:
            while not self._state.stopped and self._act():
                pass
        except Exception:
            self._give_up()
            raise
        if self._state.stopped:
            self._forget()

    def _act(self) -> bool:
        """Take one step; return whether the episode goes on."""
        state = self._state
        if state.must_stop():
            return False
        allowed = self._env.allowed
        self._step(self._learner.act() if allowed is None else self._act_among(allowed))
        if self._is_over:
            state.move(teacher_steps=state.at.teacher_steps + self._steps_of_teachers())
            state.note_what_was_recorded()
        return not self._is_over

    def _act_among(self, allowed: Booleans) -> int:
        """Return an allowed action; a random one where the method knows of no masks."""
        action = self._learner.act() if self._among is None else self._among.act(allowed)
        return action if allowed[action] else int(self._generator.choice(np.flatnonzero(allowed)))

    def _step(self, action: int) -> None:
        """Take a step in the environment; let the learner and the listeners know."""
        allowed = self._env.allowed
        try:
            observation, reward, terminated, truncated, info = self._env.step(action)
        except KeyboardInterrupt:  # before the learner knows of the step: all else is whole
            self._give_up()
            raise
        if self._state.steps_of_episode + 1 == self._room:
            truncated = not terminated
        step = Step(action, reward, observation, terminated, truncated, info, allowed)
        self._learner.observe(step)
        self._observations.append(step.observation)
        self._state.steps_of_episode += 1
        self._return += step.reward
        if step.terminated or step.truncated:
            self._learner.end_episode()
            self._finish(info)
        self._state.step_taken(step)

    def _finish(self, info: dict[str, Any]) -> None:
        state, length = self._state, self._state.steps_of_episode
        self._gathered.append(self._return, length, success_of(info))
        state.move(
            episode=state.at.episode + 1,
            steps=state.at.steps + length,
            longest=max(state.at.longest, length),
            judged=False,
        )
        state.steps_of_episode = 0
        self._is_over = True

    def _steps_of_teachers(self) -> int:
        """Return the steps of the episode in which a teacher acted."""
        if isinstance(self._learner, HasTeacher) and self._learner.teacher_acts:
            return len(self._observations) - 1
        return 0

    def _give_up(self) -> None:
        """Be as before the episode, so that all before it is saved."""
        self._forget()
        self._state.whole = True

    def _forget(self) -> None:
        """Be as before the episode, unless it was finished."""
        self._learner.discard_episode()
        self._state.steps_of_episode = 0
        self._state.recorded.clear()


class Racing:
    """Runs what the policy search asks for.

    Args:
        plan: The run's seed, and its seconds.
        state: Where the run stands; what the race runs is counted and noted there.

    Attributes:
        search: The policy search; None before it begins and after its end.
        result: What the race ended with; None before.
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
        won = search.state.won
        heat = None if self._plan.time_is_over(state.at) else search.next_heat()
        if search.state.won > won or heat is None:
            now = search.state
            facts = {"n_leaves": now.incumbent.n_leaves, "tried": now.tried, "won": now.won}
            state.note("race", facts)
        if heat is None:
            self._end(search)
            return
        room = self._plan.race_steps - state.at.racing_steps
        episode = self._run_episode(*heat, env, room)
        if episode is not None:
            search.heat_run(episode)
            state.move(racing_steps=state.at.racing_steps + len(episode))
            state.note_what_was_recorded()
        elif not state.stopped:  # longer than any before: it decides nothing
            state.move(racing_steps=self._plan.race_steps)
            self._end(search)

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
                action = tree.act(steps.present.tolist(), env.allowed)
                said = steps.take(action)
                state.steps_of_episode += 1
                observation, reward, terminated, truncated, info = said
                state.step_taken(Step(action, reward, observation, terminated, truncated, info))
        finally:
            state.steps_of_episode = 0
        return steps.episode()
