"""Who teaches the trees of ``distilled-dqn``: a network that learns in the run, or one's own."""

import itertools

import numpy as np

from eutree.arrays import Floats
from eutree.learners.distilled_dqn.choices import DistilledDQNChoices
from eutree.learners.history import TERMINAL, History
from eutree.learners.learner import Arrays, Problem, Start, ValuingPolicy
from eutree.neural import DoubleDQN, Scaling
from eutree.neural.double_dqn import reward_scale_of


class GivenTeacher:
    """A teacher of the user's own, who has learned elsewhere.

    Args:
        policy: The teacher.

    Attributes:
        policy: The same.
        updates: 0; it does not learn here.
    """

    updates = 0

    def __init__(self, policy: ValuingPolicy) -> None:
        self.policy = policy

    def act(self, observation: Floats) -> int:
        """Return its action at an observation [d]."""
        return int(self.policy.action_values(observation[np.newaxis]).argmax())

    def learn(self, history: History, generator: np.random.Generator) -> None:
        """Do nothing."""

    def state(self) -> Arrays:
        """Return nothing: it is given anew to a run that goes on."""
        return {}

    def restore(self, state: Arrays, history: History, *, replay: bool) -> None:
        """Do nothing."""


class NetworkTeacher:
    """A Double DQN that learns from a run's episodes, the demonstrations first.

    Args:
        method: How it learns, and how often before its first step.
        problem: What is learned.
        start: The demonstrations.
        history: They, stored.
        steps: Steps that it is going to learn in.
        generator: Source of its first weights.

    Attributes:
        policy: The network; as a policy it decides by its averaged weights.
    """

    def __init__(
        self,
        method: DistilledDQNChoices,
        problem: Problem,
        start: Start,
        history: History,
        steps: int,
        generator: np.random.Generator,
    ) -> None:
        settings = method.teacher
        self._per_step = settings.updates_per_step
        self._first_updates = min(method.demonstration_updates, history.size)
        self._n_shown = self._known = history.n_episodes
        self.policy = DoubleDQN(
            settings,
            Scaling.of(history.observations),
            problem.n_actions,
            reward_scale=reward_scale_of([e.rewards for e in start.episodes], settings.discount),
            updates=max(self._first_updates + int(self._per_step * steps), 1),
            generator=generator,
        )
        for episode in start.episodes:
            self.policy.add(
                episode.observations,
                episode.actions,
                episode.rewards,
                terminated=episode.terminated,
            )

    @property
    def updates(self) -> int:
        """Updates so far."""
        return self.policy.updates

    def act(self, observation: Floats) -> int:
        """Return its action at an observation [d], by its present weights."""
        return self.policy.act(observation)

    def learn(self, history: History, generator: np.random.Generator) -> None:
        """Learn from the episodes that are new."""
        if not self.updates:
            self.policy.update(self._first_updates, generator)
        first = int(np.searchsorted(history.episodes, self._known))
        self._show(history, self._known, history.n_episodes)
        self._known = history.n_episodes
        self.policy.update(round(self._per_step * (history.size - first)), generator)

    def state(self) -> Arrays:
        """Return its weights, and how many episodes it has learned from."""
        return {"known": np.array([self._known], dtype=np.int64), **self.policy.state()}

    def restore(self, state: Arrays, history: History, *, replay: bool) -> None:
        """Go on from a ``state()``; with ``replay`` it will learn more."""
        self._known = int(state["known"][0])
        self.policy.restore(state)
        if replay:
            self._show(history, self._n_shown, self._known)

    def _show(self, history: History, first: int, last: int) -> None:
        """Store the episodes ``first`` to ``last`` - 1 in the replay."""
        bounds = np.searchsorted(history.episodes, np.arange(first, last + 1)).tolist()
        for begin, end in itertools.pairwise(bounds):
            rows = slice(begin, end)
            ahead = history.next_observations[end - 1 : end]
            self.policy.add(
                np.concatenate([history.observations[rows], ahead]),
                history.actions[rows].astype(np.int64),
                history.rewards[rows],
                terminated=bool(history.entered[end - 1] == TERMINAL),
            )
