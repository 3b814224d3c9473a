"""A learning run: its state between two episodes, and the step from one episode to the next.

A run gathers episodes; after every gathering phase it expands the tree (Table 1); every so often
it evaluates the frozen policy on episodes of their own. All randomness of an episode comes from
the run's seed and the episode's number, so a run can go on from any episode boundary with nothing
but its learner.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, ClassVar, Protocol

import numpy as np

from eutree.arrays import Floats
from eutree.evaluation import CurvePoint, Evaluation
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import success_of
from eutree.interaction.requests import Request, StepAnswer
from eutree.learners import Learner, Method, Problem, Start, Step
from eutree.policies import TreePolicy
from eutree.training.asking import Questions
from eutree.training.progress import GatheredEpisodes
from eutree.validation import check_integer, check_seed

TRAINING_STREAM = 2
EXPLORATION_STREAM = 3
EXPANSION_STREAM = 4
EVALUATION_STREAM = 5
START_STREAM = 6

Evaluator = Callable[[TreePolicy, int], Evaluation]  # (policy, seed) -> evaluation


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How long a run is and when it pauses.

    Attributes:
        episodes: Episodes of experience in all.
        evaluate_every: Episodes between two frozen evaluations; the first is before episode 0.
        seed: Seed of the run.
    """

    episodes: int = 400
    evaluate_every: int = 20
    seed: int = 0

    def __post_init__(self) -> None:
        check_integer("episodes", self.episodes, low=0)
        check_integer("evaluate_every", self.evaluate_every, low=1)
        check_seed(self.seed)


@dataclass(frozen=True, eq=False)
class Beginning:
    """What a run begins with: how is learned, what, and from where.

    Attributes:
        method: How is learned.
        problem: What is learned.
        start: Where learning begins.
    """

    method: Method
    problem: Problem
    start: Start

    def learner(self) -> Learner:
        """Return the learner at its start."""
        return self.method.start(self.problem, self.start)


class Listener(Protocol):
    """Who is told what happens in a run, and may end it."""

    def gathering_begins(self) -> None:
        """Take note that the first episode of a gathering phase begins."""
        ...

    def step_taken(self, step: Step) -> bool:
        """Take note of a step; return False to end the run."""
        ...

    def gathering_ends(self) -> None:
        """Take note that an expansion follows."""
        ...


class LearningRun:
    """A run in progress.

    Args:
        beginning: How is learned, what, and from where.
        env: The environment it gathers in.
        schedule: How long, and when to evaluate.
        evaluator: How to evaluate a frozen policy.
        stop: Asked before every step; True ends the run at the last finished episode.
        questions: Asks somebody to act where the learner is unsure; None asks nobody.

    Attributes:
        beginning: What the run began with.
        learner: The learner.
        schedule: How long, and when to evaluate.
        episode: Episodes gathered so far.
        steps: Environment steps gathered so far.
        curve: Evaluations so far.
        events: What happened so far: expansions, evaluations, and what the listener recorded.
        gathered: Return, length and success of each episode so far.
        listener: Who is told of each step, if anyone.
        recorded: What the listener measured since the last finished episode, by name.
        stopped: Whether ``stop`` or the listener ended the run.
        whole: Whether the learner is between two steps of the run, so that a checkpoint may be
            saved; False while, and after, an interruption struck in the middle of one.
    """

    EVENT_NUMBERS: ClassVar[tuple[str, ...]] = ("episode",)

    def __init__(
        self,
        beginning: Beginning,
        env: GuardedEnv,
        schedule: Schedule,
        evaluator: Evaluator,
        *,
        stop: Callable[[], bool] = lambda: False,
        questions: Questions | None = None,
    ) -> None:
        self.beginning = beginning
        self.learner = beginning.learner()
        self.schedule = schedule
        self.episode = 0
        self.steps = 0
        self.curve: list[CurvePoint] = []
        self.events: list[dict[str, Any]] = []
        self.gathered = GatheredEpisodes()
        self.listener: Listener | None = None
        self.recorded: dict[str, float | int | None] = {}
        self.stopped = False
        self.whole = True
        self._gathering = False
        self._steps_of_episode, self._return = 0, 0.0
        self._env = env
        self._evaluator = evaluator
        self._stop = stop
        self._questions = questions
        self._observations: list[Floats] = []  # of the present episode
        self._requests: list[dict[str, Any]] = []  # of the present episode

    @property
    def finished(self) -> bool:
        """Whether all episodes are gathered and what is due after them is done; or it stopped."""
        return self.stopped or (self._at_end and self._due() is None)

    def advance(self) -> None:
        """Make the expansion or the evaluation that is due, or else gather one episode.

        What is due follows from the events so far: a run can go on from between any two of these.

        Raises:
            EnvironmentFault: The environment broke its contract; the learner is as it was before
                the episode.
        """
        if self._stop():
            self.stopped = True
            return
        self.whole = False
        (self._due() or self._gather)()
        self.whole = True

    @property
    def _at_end(self) -> bool:
        return self.episode >= self.schedule.episodes

    def _due(self) -> Callable[[], None] | None:
        """Return what is due after the present episode: an expansion, an evaluation or nothing."""
        now = takewhile(lambda event: event["episode"] == self.episode, reversed(self.events))
        made = {event["event"] for event in now} - {"record"}
        gathered = self.episode % self.beginning.method.gathering_episodes == 0 or self._at_end
        if gathered and self.episode and not made:
            return self._expand
        if self.episode % self.schedule.evaluate_every == 0 or self._at_end:
            return None if "evaluation" in made else self._evaluate
        return None

    def policy(self) -> TreePolicy:
        """Return the present policy, frozen."""
        return self.learner.decisions().policy(self.beginning.problem)

    @property
    def num_timesteps(self) -> int:
        """Steps so far, those of the running episode included."""
        return self.steps + self._steps_of_episode

    def _gather(self) -> None:
        """Let the learner act for one episode (Table 1, data gathering phase)."""
        if self.listener is not None and not self._gathering:
            self.listener.gathering_begins()
        self._gathering = True
        seed = episode_seed(self.schedule.seed, self.episode, TRAINING_STREAM)
        observation = self._env.reset(seed)
        self.learner.start_episode(observation, self._generator(EXPLORATION_STREAM))
        self._observations, self._requests = [observation], []
        try:
            while not self.stopped and self._act():
                pass
        except Exception:
            self._forget_episode()
            self.whole = True
            raise
        if self.stopped:
            self._forget_episode()

    def _act(self) -> bool:
        """Take one step, or let somebody act for a stretch; return whether the episode goes on."""
        if self._stop():
            self.stopped = True
            return False
        reason = self._reason_to_ask()
        if not (reason and self._ask(reason)):
            self._step(self.learner.act(), shown=False)
        ended = self._steps_of_episode == 0  # which finishing an episode leaves behind
        if ended:
            self.events += self._requests
            self._requests = []
            self._note_what_was_recorded()
        return not ended

    def _step(self, action: int, *, shown: bool) -> StepAnswer:
        """Take a step in the environment; let the learner and the listener know."""
        answer = self._env.step(action)
        observation, reward, terminated, truncated, info = answer
        step = Step(action, reward, observation, terminated, truncated, info, shown)
        self.learner.observe(step)
        self._observations.append(observation)
        self._steps_of_episode += 1
        self._return += reward
        if terminated or truncated:
            self.learner.end_episode()
            self._finish_episode(info)
        if self.listener is not None:
            self.stopped = not self.listener.step_taken(step)
        return answer

    def _reason_to_ask(self) -> str:
        """Return why somebody is to be asked now, or ""."""
        if self._questions is None:
            return ""
        return self._questions.reason(
            self.learner, self._observations[-1], self._n_requests, len(self._requests)
        )

    @property
    def _n_requests(self) -> int:
        """Requests of the run so far."""
        asked = [event for event in self.events if event["event"] == "request"]
        return len(asked) + len(self._requests)

    def _ask(self, reason: str) -> bool:
        """Let somebody act for a stretch; return whether they took a step."""
        questions = self._questions
        if questions is None:
            return False
        steps = self.num_timesteps
        request = Request(
            number=self._n_requests + 1,
            of=questions.asking.max_requests,
            episode=self.episode,
            step=self._steps_of_episode,
            reason=reason,
            observations=np.array(self._observations),
            max_steps=questions.asking.max_steps,
        )
        facts = questions.ask(
            request,
            self._observations,
            self._env,
            self.learner,
            lambda action: self._step(action, shown=True),
            lambda: self.stopped,
        )
        here = {"event": "request", "episode": request.episode, "steps": steps}
        self._requests.append(here | facts)
        return bool(facts["n_shown"])

    def _forget_episode(self) -> None:
        """Be as before the episode, unless it was finished."""
        self.learner.discard_episode()
        self._steps_of_episode, self._return = 0, 0.0
        self._requests = []
        self.recorded.clear()

    def _finish_episode(self, info: dict[str, Any]) -> None:
        self.gathered.append(self._return, self._steps_of_episode, success_of(info))
        self.steps += self._steps_of_episode
        self.episode += 1
        self._steps_of_episode, self._return = 0, 0.0

    def _note_what_was_recorded(self) -> None:
        if self.recorded:
            self._note("record", {"values": dict(self.recorded)})
            self.recorded.clear()

    def _note(self, event: str, facts: dict[str, Any]) -> None:
        here = {"event": event, "episode": self.episode, "steps": self.steps}
        self.events.append(here | facts)

    def _expand(self) -> None:
        """Run an expansion phase (Table 1) and note the splits that it made."""
        if self.listener is not None:
            self.listener.gathering_ends()
            self._note_what_was_recorded()
        self._gathering = False
        update = self.learner.update(self._generator(EXPANSION_STREAM))
        splits = [
            {"leaf": split.leaf, "feature": split.feature, "threshold": split.threshold}
            for split in update.splits
        ]
        n_leaves = self.learner.decisions().tree.n_leaves
        self._note("expansion", {"splits": splits, "n_leaves": n_leaves, **update.figures})

    def _evaluate(self) -> None:
        """Freeze the policy and evaluate it on episodes of their own."""
        policy = self.policy()
        seed = episode_seed(self.schedule.seed, self.episode, EVALUATION_STREAM)
        self.whole = True  # evaluating changes nothing of the run
        evaluation = self._evaluator(policy, seed)
        self.whole = False
        point = CurvePoint(
            episode=self.episode,
            steps=self.steps,
            success_rate=evaluation.success_rate,
            mean_return=evaluation.mean_return,
            n_leaves=policy.n_leaves,
        )
        self.curve.append(point)
        self._note("evaluation", vars(point) | {"mean_length": evaluation.mean_length})

    def _generator(self, stream: int) -> np.random.Generator:
        return generator_of(self.schedule.seed, stream, self.episode)


def generator_of(seed: int, stream: int, number: int) -> np.random.Generator:
    """Return the generator of one episode or expansion of a run."""
    return np.random.default_rng(np.random.SeedSequence((seed, stream, number)))
