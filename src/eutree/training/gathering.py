"""The data gathering phase: one episode in which the learner acts."""

from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.interaction import GuardedEnv
from eutree.interaction.episode import success_of
from eutree.learners import Learner, Step
from eutree.learners.learner import HasTeacher
from eutree.training.progress import GatheredEpisodes
from eutree.training.run_state import RunState


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
        self._step(self._learner.act())
        if self._is_over:
            state.move(teacher_steps=state.at.teacher_steps + self._steps_of_teachers())
            state.note_what_was_recorded()
        return not self._is_over

    def _step(self, action: int) -> None:
        """Take a step in the environment; let the learner and the listener know."""
        try:
            observation, reward, terminated, truncated, info = self._env.step(action)
        except KeyboardInterrupt:  # before the learner knows of the step: all else is whole
            self._give_up()
            raise
        if self._state.steps_of_episode + 1 == self._room:
            truncated = not terminated
        step = Step(action, reward, observation, terminated, truncated, info)
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
