"""The data gathering phase: one episode in which the learner acts, or somebody whom it asks."""

from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.interaction import GuardedEnv
from eutree.interaction.episode import success_of
from eutree.interaction.requests import Request, StepAnswer
from eutree.learners import Learner, Step
from eutree.learners.learner import HasTeacher
from eutree.training.asking import Questions
from eutree.training.progress import GatheredEpisodes
from eutree.training.run_state import RunState


class GatheringEpisode:
    """One episode of experience, from its reset to its end.

    Args:
        learner: Who acts, and learns from each step what it will.
        env: Where.
        state: Where the run stands; moved on when the episode is over.
        gathered: The episodes so far; this one is added when it is over.
        questions: Asks somebody to act where the learner is unsure; None asks nobody.
        room: Steps left of the budget, at which an episode without a known limit is cut short; None
            for no such budget.
    """

    def __init__(
        self,
        learner: Learner,
        env: GuardedEnv,
        state: RunState,
        gathered: GatheredEpisodes,
        questions: Questions | None,
        *,
        room: int | None = None,
    ) -> None:
        self._learner = learner
        self._env = env
        self._state = state
        self._gathered = gathered
        self._questions = questions
        self._room = room
        self._return = 0.0
        self._is_over = False
        self._observations: list[Floats] = []
        self._requests: list[dict[str, Any]] = []

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
        """Take one step, or let somebody act for a stretch; return whether the episode goes on."""
        state = self._state
        if state.must_stop():
            return False
        reason = self._reason_to_ask()
        if not (reason and self._ask(reason)):
            self._step(self._learner.act(), shown=False)
        if self._is_over:
            state.move(teacher_steps=state.at.teacher_steps + self._steps_of_teachers())
            state.events += self._requests
            self._requests = []
            state.note_what_was_recorded()
        return not self._is_over

    def _step(self, action: int, *, shown: bool) -> StepAnswer:
        """Take a step in the environment; let the learner and the listener know."""
        try:
            observation, reward, terminated, truncated, info = self._env.step(action)
        except KeyboardInterrupt:  # before the learner knows of the step: all else is whole
            self._give_up()
            raise
        if self._state.steps_of_episode + 1 == self._room:
            truncated = not terminated
        step = Step(action, reward, observation, terminated, truncated, info, shown)
        self._learner.observe(step)
        self._observations.append(step.observation)
        self._state.steps_of_episode += 1
        self._return += step.reward
        if step.terminated or step.truncated:
            self._learner.end_episode()
            self._finish(info)
        self._state.step_taken(step)
        return observation, reward, terminated, truncated, info

    def _reason_to_ask(self) -> str:
        """Return why somebody is to be asked now, or ""."""
        if self._questions is None:
            return ""
        return self._questions.reason(
            self._learner,
            self._observations[-1],
            episode=self._state.at.episode,
            before=self._n_requests(),
            in_episode=len(self._requests),
        )

    def _n_requests(self) -> int:
        """Return the number of requests of the run so far."""
        asked = [event for event in self._state.events if event["event"] == "request"]
        return len(asked) + len(self._requests)

    def _ask(self, reason: str) -> bool:
        """Let somebody act for a stretch; return whether they took a step."""
        questions, state = self._questions, self._state
        if questions is None:
            return False
        steps = state.num_timesteps
        request = Request(
            number=self._n_requests() + 1,
            of=questions.asking.max_requests,
            episode=state.at.episode,
            step=state.steps_of_episode,
            reason=reason,
            observations=np.array(self._observations),
            max_steps=questions.asking.max_steps,
            intended=self._env.schema.actions[
                questions.intended_action(self._learner, self._observations[-1])
            ],
        )
        facts = questions.ask(
            request,
            self._observations,
            self._env,
            self._learner,
            lambda action: self._step(action, shown=True),
            lambda: state.stopped,
        )
        here = {"event": "request", "episode": request.episode, "steps": steps}
        self._requests.append(here | facts)
        return bool(facts["n_shown"])

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
        return sum(request["n_shown"] for request in self._requests)

    def _give_up(self) -> None:
        """Be as before the episode, so that all before it is saved."""
        self._forget()
        self._state.whole = True

    def _forget(self) -> None:
        """Be as before the episode, unless it was finished."""
        self._learner.discard_episode()
        self._state.steps_of_episode = 0
        self._requests = []
        self._state.recorded.clear()
