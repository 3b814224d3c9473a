"""A run: its state between two phases, and the step from one to the next.

All that is random in an episode, an update or a race follows from the run's seed and a number, so
a run can go on from any boundary with nothing but its learner and its position. Events tell what
happened; they never decide what comes.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.evaluation import CurvePoint, Evaluation
from eutree.interaction import episode_seed
from eutree.interaction.episode import ending_of, success_of
from eutree.interaction.requests import Request, StepAnswer
from eutree.interaction.seeding import Stream
from eutree.learners import Step
from eutree.learners.learner import KnowsItsModel
from eutree.learners.model_planning import transitions_of
from eutree.learners.model_trust import ModelTrust
from eutree.policies import TreePolicy
from eutree.training.asking import Questions
from eutree.training.beginning import (
    Arena,
    Beginning,
    Listener,
    generator_of,
    seed_of_next,
)
from eutree.training.judging import Judgement, judged
from eutree.training.phases import Phase, Plan, Position, due
from eutree.training.progress import GatheredEpisodes
from eutree.training.proposals import key
from eutree.training.search import STARTS, PolicySearch, SearchState


class Run:
    """A run in progress.

    Args:
        beginning: How is learned, what, and from where.
        plan: How long it is, and what happens when.
        arena: Where it acts; None for recorded episodes alone.
        stop: Asked before every step; True ends the run at the last finished episode.
        questions: Asks somebody to act where the learner is unsure; None asks nobody.

    Attributes:
        beginning: What the run began with.
        learner: The learner.
        plan: How long the run is.
        at: Where it stands.
        phase: What is under way, or was last.
        curve: Evaluations so far.
        events: What happened so far: updates, evaluations, races, and what the listener recorded.
        gathered: Return, length and success of each episode so far.
        search: The policy search; None before it begins.
        kept: With ``keep_success`` the policy that success must not fall from, and its successes.
        result: What the race ended with; None before.
        first: The policy that it began with.
        judgement: The result against the start; None before it is known.
        listener: Who is told of each step, if anyone.
        recorded: What the listener measured since the last finished episode, by name.
        stopped: Whether ``stop`` or the listener ended the run.
        whole: Whether the learner is between two phases, so that a checkpoint may be saved; False
            while, and after, an interruption struck in the middle of one.
    """

    def __init__(
        self,
        beginning: Beginning,
        plan: Plan,
        arena: Arena | None,
        *,
        stop: Callable[[], bool] = lambda: False,
        questions: Questions | None = None,
    ) -> None:
        self.beginning = beginning
        self.learner = beginning.learner()
        self.plan = plan
        self.at = Position()
        self.phase = Phase.GATHER
        self.curve: list[CurvePoint] = []
        self.events: list[dict[str, Any]] = []
        self.gathered = GatheredEpisodes()
        self.search: PolicySearch | None = None
        self.kept: tuple[TreePolicy, int] | None = None
        self.result: TreePolicy | None = None
        self.judgement: Judgement | None = None
        self.listener: Listener | None = None
        self.recorded: dict[str, float | int | None] = {}
        self.stopped = False
        self.whole = True
        self._last_evaluated: tuple[tuple[bytes, int], Evaluation] | None = None
        self._arena = arena
        self._stop = stop
        self._questions = questions
        self._gathering = False
        self._steps_of_episode, self._return = 0, 0.0
        self._observations: list[Floats] = []  # of the present episode
        self._requests: list[dict[str, Any]] = []  # of the present episode
        self._clock = time.monotonic()
        self.first = self.policy()

    @property
    def episode(self) -> int:
        """Episodes gathered so far."""
        return self.at.episode

    @property
    def steps(self) -> int:
        """Environment steps gathered so far, those of racing apart."""
        return self.at.steps

    @property
    def challengers(self) -> int:
        """Trees that were put to the test so far, by the learner or in the race."""
        return self.at.challengers + (0 if self.search is None else self.search.state.tried)

    @property
    def num_timesteps(self) -> int:
        """Steps so far: gathered, raced, and those of the running episode."""
        return self.at.steps + self.at.racing_steps + self._steps_of_episode

    @property
    def finished(self) -> bool:
        """Whether everything that the plan asks for happened; or the run was stopped."""
        return self.stopped or self._due() is None

    def advance(self) -> None:
        """Go through the phase that is due: one episode, one update, one evaluation.

        Raises:
            EnvironmentFault: The environment broke its contract; the learner is as it was before
                the episode.
        """
        if self._stop():
            self.stopped = True
            return
        phase = self._due()
        if phase is None:
            return
        self.phase, self.whole = phase, False
        {
            Phase.GATHER: self._gather,
            Phase.UPDATE: self._update,
            Phase.EVALUATE: self._evaluate,
            Phase.RACE: self._race,
            Phase.JUDGE: self._judge,
        }[phase]()
        self.whole = True
        self._take_time()

    def model_trust(self) -> ModelTrust | None:
        """Return how the learner's world model orders trees; None where it has none, or no idea."""
        learner = self.learner
        return learner.model_trust() if isinstance(learner, KnowsItsModel) else None

    def policy(self) -> TreePolicy:
        """Return the present policy, frozen."""
        if self.search is not None:
            return self.search.incumbent
        return self._best() if self.kept is None else self.kept[0]

    def _best(self) -> TreePolicy:
        """Return what the race ended with or, before that, what was learned."""
        return self._learned() if self.result is None else self.result

    def _learned(self) -> TreePolicy:
        return self.learner.decisions().policy(self.beginning.problem)

    def _due(self) -> Phase | None:
        return due(
            self.plan,
            self.at,
            gathering_episodes=self.beginning.method.gathering_episodes,
            max_episode_steps=self.beginning.problem.max_episode_steps,
        )

    def _take_time(self) -> None:
        """Count the seconds of the clock, if they are a budget."""
        now = time.monotonic()
        if self.plan.seconds is not None:
            self._move(seconds=self.at.seconds + now - self._clock)
        self._clock = now

    def _move(self, **changes: Any) -> None:
        self.at = replace(self.at, **changes)

    @property
    def _acting(self) -> Arena:
        if self._arena is None:
            raise InvalidArgumentError("env must be given to act in, got None")
        return self._arena

    def _gather(self) -> None:
        """Let the learner act for one episode (Table 1, data gathering phase)."""
        if self.listener is not None and not self._gathering:
            self.listener.gathering_begins()
        self._gathering = True
        seed = seed_of_next(self.learner, self.plan.seed, self.episode)
        observation = self._acting.env.reset(seed)
        self.learner.start_episode(
            observation, generator_of(self.plan.seed, Stream.EXPLORATION, self.episode)
        )
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
            shown = sum(request["n_shown"] for request in self._requests)
            self._move(teacher_steps=self.at.teacher_steps + shown)
            self.events += self._requests
            self._requests = []
            self._note_what_was_recorded()
        return not ended

    def _step(self, action: int, *, shown: bool) -> StepAnswer:
        """Take a step in the environment; let the learner and the listener know."""
        answer = self._acting.env.step(action)
        observation, reward, terminated, truncated, info = answer
        step = Step(action, reward, observation, terminated, truncated, info, shown)
        self.learner.observe(step)
        self._observations.append(step.observation)
        self._steps_of_episode += 1
        self._return += step.reward
        if step.terminated or step.truncated:
            self.learner.end_episode()
            self._finish_episode(info)
        self._tell(step)
        return answer

    def _tell(self, step: Step) -> None:
        if self.listener is not None:
            self.stopped = not self.listener.step_taken(step)

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
            self._acting.env,
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
        length = self._steps_of_episode
        self.gathered.append(self._return, length, success_of(info))
        self._move(
            episode=self.at.episode + 1,
            steps=self.at.steps + length,
            longest=max(self.at.longest, length),
            judged=False,
        )
        self._steps_of_episode, self._return = 0, 0.0

    def _note_what_was_recorded(self) -> None:
        if self.recorded:
            self._note("record", {"values": dict(self.recorded)})
            self.recorded.clear()

    def _note(self, event: str, facts: dict[str, Any]) -> None:
        here = {"event": event, "episode": self.episode, "steps": self.num_timesteps}
        self.events.append(here | facts)

    def _update(self) -> None:
        """Let the learner learn from what is stored, and note the splits that it made."""
        self._gathering_ends()
        gathers = self.plan.gathers
        number = self.episode if gathers else self.at.updates
        update = self.learner.update(generator_of(self.plan.seed, Stream.EXPANSION, number))
        splits = [
            {"leaf": split.leaf, "feature": split.feature, "threshold": split.threshold}
            for split in update.splits
        ]
        tried = update.figures.get("challengers")
        self._move(
            updates=self.at.updates + 1,
            updated_at=self.episode,
            settled=not splits,
            challengers=self.at.challengers + (tried if isinstance(tried, int) else 0),
        )
        n_leaves = self.learner.decisions().tree.n_leaves
        self._note("expansion", {"splits": splits, "n_leaves": n_leaves, **update.figures})

    def _gathering_ends(self) -> None:
        if self.listener is not None and self._gathering:
            self.listener.gathering_ends()
            self._note_what_was_recorded()
        self._gathering = False

    def _evaluate(self) -> None:
        """Freeze the policy and evaluate it, on the same episodes at each point of the run."""
        policy = self._best()
        self.whole = True  # evaluating changes nothing of the run
        evaluation = self._evaluated(policy, Stream.EVALUATION)
        self.whole = False
        if self.plan.keep_success:
            policy, evaluation = self._kept(policy, evaluation)
        point = CurvePoint(
            episode=self.episode,
            steps=self.num_timesteps,
            success_rate=evaluation.success_rate,
            mean_return=evaluation.mean_return,
            n_leaves=policy.n_leaves,
        )
        self.curve.append(point)
        self._move(evaluated_at=self.episode)
        self._note("evaluation", vars(point) | {"mean_length": evaluation.mean_length})

    def _kept(self, policy: TreePolicy, evaluation: Evaluation) -> tuple[TreePolicy, Evaluation]:
        """Return the policy if it succeeds as often as the kept one, in the same episodes."""
        count = None if evaluation.successes is None else int(evaluation.successes.sum())
        if count is None:
            raise InvalidArgumentError(
                "keep_success needs an environment that reports success (info['is_success'])"
            )
        if self.kept is not None and count < self.kept[1]:
            self._note("kept", {"successes": self.kept[1], "successes_refused": count})
            return self.kept[0], self._evaluated(self.kept[0], Stream.EVALUATION)
        self.kept = policy, count
        return policy, evaluation

    def _evaluated(self, policy: TreePolicy, stream: int) -> Evaluation:
        """Evaluate a policy; the one that was evaluated last needs no other run of its episodes."""
        asked = key(policy), stream
        if self._last_evaluated is None or self._last_evaluated[0] != asked:
            self._last_evaluated = asked, self._evaluated_anew(policy, stream)
        return self._last_evaluated[1]

    def _evaluated_anew(self, policy: TreePolicy, stream: int) -> Evaluation:
        seed = episode_seed(self.plan.seed, 0, stream)
        return self._acting.evaluator(policy, seed)

    def _race(self) -> None:
        """Run one episode of the policy search."""
        search = self._searching()
        self.whole = True  # a search is stored as it stood between two stages
        won = search.state.won
        over = self.plan.seconds is not None and self.at.seconds >= self.plan.seconds
        heat = None if over else search.next_heat()
        if search.state.won > won or heat is None:
            self._note_race(search.state)
        if heat is None:
            self._end_race(search)
            return
        episode = self._run_episode(*heat)
        if episode is not None:
            search.heat_run(episode)
            self._move(racing_steps=self.at.racing_steps + len(episode))
            self._note_what_was_recorded()

    def _end_race(self, search: PolicySearch) -> None:
        self.result, self.search = search.incumbent, None
        self._gathering_ends()
        tried = self.at.challengers + search.state.tried
        self._move(raced=True, evaluated_at=-1, challengers=tried)

    def _searching(self) -> PolicySearch:
        if self.search is None:
            self.search = self.new_search()
        if self.listener is not None and not self._gathering:
            self.listener.gathering_begins()
            self._gathering = True
        return self.search

    def new_search(self) -> PolicySearch:
        """Return the policy search at its start: from the present policy and all that is stored."""
        if self.plan.race is None:
            raise InvalidArgumentError("race_steps must be above 0 to race, got 0")
        policy = self.policy()
        return PolicySearch(
            policy,
            transitions_of(self.learner.history, policy.schema.n_actions),
            replace(self.plan.race, keep_success=self.plan.keep_success),
            seed=self.plan.seed,
            max_episode_steps=self.beginning.problem.max_episode_steps,
        )

    def _note_race(self, state: SearchState) -> None:
        facts = {"n_leaves": state.incumbent.n_leaves, "tried": state.tried, "won": state.won}
        self._note("race", facts)

    def _run_episode(self, tree: TreePolicy, start: int) -> Episode | None:
        """Run a tree from one of the race's starts; None if the run was stopped in between."""
        block = episode_seed(self.plan.seed, start // STARTS, Stream.RACING)
        observation = self._acting.env.reset(episode_seed(block, start % STARTS))
        observations, actions, rewards = [observation], [], []
        terminated = truncated = False
        info: dict[str, Any] = {}
        try:
            while not (terminated or truncated):
                if self.stopped or self._stop():
                    self.stopped = True
                    return None
                # The environment has the history already: its observations are the features.
                action = int(tree.actions[tree.tree.leaf_of(observation.tolist())])
                observation, reward, terminated, truncated, info = self._acting.env.step(action)
                observations.append(observation)
                actions.append(action)
                rewards.append(reward)
                self._steps_of_episode += 1
                self._tell(Step(action, reward, observation, terminated, truncated, info))
        finally:
            self._steps_of_episode = 0
        return Episode(
            observations=np.array(observations),
            actions=np.array(actions),
            rewards=np.array(rewards),
            terminated=terminated,
            truncated=truncated and not terminated,
            ending=ending_of(info, terminated=terminated),
            is_success=success_of(info),
        )

    def _judge(self) -> None:
        """Compare the result with the start, on episodes that chose nothing."""
        policy, first = self.policy(), self.first
        self.whole = True
        if key(policy) == key(first):
            judgement = Judgement.same(challengers=self.challengers)
        else:
            pair = (self._evaluated(one, Stream.JUDGING) for one in (first, policy))
            judgement = judged(*pair, challengers=self.challengers)
        self.whole = False
        self.judgement = judgement
        self._move(judged=True)
        self._note("judgement", judgement.facts())
