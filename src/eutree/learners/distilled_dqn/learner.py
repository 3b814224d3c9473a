"""The learner of ``distilled-dqn``: the stages that it goes through, one after the other."""

from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError
from eutree.features import Derivation
from eutree.learners.declared import Declared, arrays_of, give_back
from eutree.learners.distilled_dqn.races import MOST_PRUNED, ImaginedChallengers, RacedTree, Races
from eutree.learners.distilled_dqn.state import Stage, parts_of, sizes_with
from eutree.learners.distilled_dqn.teaching import (
    DAgger,
    Experience,
    NetworkTeacher,
    Students,
    best_of,
)
from eutree.learners.episode_buffer import EpisodeBuffer, random_action, store
from eutree.learners.history import History
from eutree.learners.learner import (
    Arrays,
    Decisions,
    Figures,
    Needs,
    Problem,
    Start,
    Step,
    Update,
    ValuingPolicy,
)
from eutree.neural import DoubleDQNSettings
from eutree.neural.double_dqn import n_weights
from eutree.policy_search.model_trust import ModelTrust
from eutree.validation import check_amounts, check_integer, check_measures, check_number
from eutree.world_model.action_trees import from_decision_tree, n_leaves, to_decision_tree
from eutree.world_model.ensemble import EnsembleSettings

FEWEST_PRUNED = 2
EPISODES_PER_CHALLENGER = 30  # that must be affordable for one more challenger
MANY_EPISODES = 200  # affordable: enough for looks that are far apart
LOOKS = (8, 20, 40, 72, 136)
SHORT_LOOKS = (4, 10, 20, 40)
ALL_TIME_BEST = 2  # that meet the policy again in every race
LAST_ENTRANTS = 5


@dataclass(frozen=True, kw_only=True)
class DistilledDQN:
    """The choices of this method.

    Attributes:
        max_leaves: Most leaves of the policy.
        leaf_price: Return that a leaf must earn, as a share of the mean size of a return shown.
        steps: Environment steps to learn in, where the run has no budget of steps itself.
        teacher_share: Share of the steps in which the teacher acts.
        teacher_steps: Most steps that it learns from.
        learning_share: Share of the steps that it learns from: beyond its own, those of the trees
            that follow; 0 for its own alone.
        dagger_share: Share of the steps in which DAgger gathers.
        last_share: Share of the steps that is kept for the last races.
        sums: Most weighted sums of features that trees may ask for: those by which the teacher
            decides, found when DAgger has gathered; 0 for features alone.
        exploration: Chance of a random action of the teacher at first.
        last_exploration: The same from a fifth of its steps on.
        demonstration_updates: Updates of the teacher before its first step; at most one for each
            transition shown.
        teacher: How the teacher learns.
        world_model: How the world model is fitted.
    """

    name: ClassVar[str] = "distilled-dqn"
    needs: ClassVar[Needs] = Needs(
        gathering=True, starts=("demos", "tree+demos"), asks_teacher=True, chance_will_do=True
    )
    gathering_episodes: ClassVar[int] = 1

    max_leaves: int = 34
    leaf_price: float = 0.002
    steps: int = 500_000
    teacher_share: float = 0.5
    teacher_steps: int = 180_000
    learning_share: float = 0.0
    dagger_share: float = 0.08
    last_share: float = 0.2
    sums: int = 0
    exploration: float = 0.3
    last_exploration: float = 0.02
    demonstration_updates: int = 2_000
    teacher: DoubleDQNSettings = field(default_factory=DoubleDQNSettings)
    world_model: EnsembleSettings = field(default_factory=EnsembleSettings)

    def __post_init__(self) -> None:
        check_amounts(self, max_leaves=2, steps=1, teacher_steps=1, demonstration_updates=1)
        check_integer("sums", self.sums, low=0)
        check_number("leaf_price", self.leaf_price, low=0.0)
        check_measures(self, "teacher_share learning_share dagger_share", low=0.0, high=1.0)
        check_measures(self, "last_share exploration last_exploration", low=0.0, high=1.0)

    def start(self, problem: Problem, start: Start) -> "DistilledDQNLearner":
        """Return a learner at its start.

        Raises:
            InvalidArgumentError: Sums are asked for of observations that hold the past.
        """
        if self.sums and (problem.history or problem.past_actions):
            raise InvalidArgumentError(
                f"sums must be 0 where trees remember the past (history), got {self.sums}"
            )
        return DistilledDQNLearner(self, problem, start)

    def restore(self, problem: Problem, start: Start, state: Arrays) -> "DistilledDQNLearner":
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        return give_back(
            self.start(problem, start), parts_of(start, self.sums, self.world_model), state
        )

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return the declaration of a ``state()``."""
        d, n_actions = problem.n_features, problem.n_actions
        return problem.declare(
            *parts_of(start, self.sums, self.world_model),
            **sizes_with(0, d, n_actions, self.world_model),
            weights=n_weights(d, self.teacher.hidden, n_actions * self.teacher.quantiles),
            members=self.world_model.members,
            shown=sum(map(len, start.episodes)),
            n_shown=len(start.episodes),
        )

    def budget(self, steps: int | None) -> "StepBudget":
        """Return how a run divides its steps; None for the method's own number of them."""
        total = self.steps if steps is None else steps
        own, shared = int(self.teacher_share * total), int(self.learning_share * total)
        teacher, learning = (min(n, self.teacher_steps) for n in (own, max(own, shared)))
        dagger = int(self.dagger_share * total)
        return StepBudget(total, teacher, learning, dagger, self.last_share * total)


class StepBudget(NamedTuple):
    """Environment steps of a run, and how they are divided."""

    total: int  # to learn in
    teacher: int  # in which the teacher acts
    learning: int  # from which it learns: its own, and of those that follow
    dagger: int  # in which DAgger gathers
    last: float  # that are kept for the last races


class DistilledDQNLearner:
    """A learner of this method."""

    def __init__(self, method: DistilledDQN, problem: Problem, start: Start) -> None:
        self._method = method
        self._problem = problem
        self._start = start
        self._budget = budget = method.budget(problem.steps)
        self._episode = EpisodeBuffer()
        self._experience = experience = Experience(problem.n_features, start.episodes)
        history = experience.history
        self.stage = Stage.TEACHER
        self.steps = 0  # in the environment so far, demonstrations apart
        self.network: NetworkTeacher | None = None  # who teaches, if it learns here
        self.teacher: ValuingPolicy
        if start.teacher is not None:
            self.teacher = start.teacher
        else:
            self.network = NetworkTeacher(
                method.teacher,
                problem.n_actions,
                start.episodes,
                history,
                updates=method.demonstration_updates,
                steps=budget.learning,
                generator=np.random.default_rng((problem.n_features, history.size)),
            )
            self.teacher = self.network.policy
        students = Students(
            self.teacher.action_values,
            problem.n_actions,
            lambda: experience.history.columns.get("allowed"),
        )
        tree = from_decision_tree(start.expert.tree, start.expert.actions) if start.expert else None
        if tree is None or n_leaves(tree) > method.max_leaves:
            tree = students.fit(history.observations, method.max_leaves, labels=history.actions)
        self.dagger = DAgger(students, experience, budget.dagger, tree)
        price = method.leaf_price * experience.typical_return
        self.challengers = ImaginedChallengers(
            method.world_model,
            students,
            experience,
            problem.n_actions,
            method.max_leaves,
            partial(_derivation, problem, students),
        )
        self.races = Races(RacedTree(tree, "start"), experience, students, price)
        self._students = students

    @property
    def history(self) -> History:
        """All transitions, the demonstrations first."""
        return self._experience.history

    # Gathering.

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation."""
        self._episode.start(observation, generator)

    def act(self, allowed: Booleans | None = None) -> int:
        """Return the action for the present observation, among those that are allowed, [A]."""
        observation = self._episode.present
        if self.stage is Stage.TEACHER:
            if self._episode.generator.random() < self._exploration():
                return random_action(self._episode.generator, self._problem.n_actions, allowed)
            if self.network is not None:
                return self.network.policy.act(observation, allowed)
            return int(best_of(self.teacher.action_values(observation[np.newaxis])[0], allowed))
        running = self.dagger.tree if self.stage is Stage.DAGGER else self.races.running
        return self._students.act(running, observation, allowed)

    def next_start(self) -> int | None:
        """Return the number of the start of the next episode; None if any will do.

        Episodes from starts of one number begin alike, so that trees can be compared.
        """
        return self.races.next_start()

    def observe(self, step: Step) -> None:
        """Keep a step."""
        self._episode.add(step)

    def end_episode(self) -> None:
        """Store the episode."""
        self.steps += len(self._episode)
        store(self.history, self._episode.finish())

    def discard_episode(self) -> None:
        """Be as before the episode."""
        self._episode.clear()

    # Learning.

    @property
    def stage_name(self) -> str:
        """The name of the present stage, in one or two words."""
        return self.stage.name.lower().replace("_", " ")

    @property
    def teacher_acts(self) -> bool:
        """Whether the present episode is the teacher's."""
        return self.stage is Stage.TEACHER

    def update(self, generator: np.random.Generator) -> Update:
        """Let the teacher learn from the last episode; go on to the next stage when it is time."""
        facts: Figures = {"stage": self.stage.name.lower()}
        learns = self.network is not None and self.network.learn(self.history, generator)
        if learns and self.stage is not Stage.TEACHER:
            # It may say now something else of what it was asked about before.
            self._students.begin(self.dagger.labelled_from)
        if self.stage is Stage.TEACHER:
            facts |= self._taught()
        elif self.stage is Stage.DAGGER:
            facts |= self._gather(generator)
        else:
            facts |= self._raced(generator)
        return Update(figures=facts)

    def decisions(self) -> Decisions:
        """Return the policy."""
        derived = self._students.declared(self._problem.schema)
        tree = to_decision_tree(self.races.policy, self._problem.n_features + len(derived))
        return Decisions(*tree, derived=derived)

    def model_trust(self) -> ModelTrust | None:
        """Return how the world model orders the trees that were really run; None without one."""
        return self.challengers.trust(self.races.trees)

    def _exploration(self) -> float:
        """Return the chance of a random action of the teacher after the steps so far."""
        passed = min(5.0 * self.steps / max(self._budget.teacher, 1), 1.0)
        first, last = self._method.exploration, self._method.last_exploration
        return first + (last - first) * passed

    def _taught(self) -> Figures:
        """Go on to DAgger when the teacher has had its steps."""
        if self.steps >= self._budget.teacher:
            self.dagger.begin(self.steps)
            self.stage = Stage.DAGGER
        return {
            "exploration": self._exploration(),
            "updates": 0 if self.network is None else self.network.policy.updates,
            "return": self._experience.return_of(self._experience.last()),
        }

    def _gather(self, generator: np.random.Generator) -> Figures:
        """Fit DAgger's next tree, if its round is over; race when all rounds are."""
        earned: Figures = {"return": self._experience.return_of(self._experience.last())}
        if not self.dagger.round_is_over(self.steps):
            return earned
        if self.steps - self._budget.teacher >= self._budget.dagger:
            self.dagger.round_from = self.steps
            self.stage = Stage.RACE
            if self._method.sums and self._students.sums is None:
                earned["sums"] = self._students.find_sums(
                    self.history.observations, self._method.sums
                )
            return earned | self._propose(generator)
        return earned | {"labels": self.dagger.next_round(self.steps)}

    def _propose(self, generator: np.random.Generator) -> Figures:
        """Make challengers of the policy, and let them race."""
        affordable = (self._budget.total - self.steps) / self._experience.mean_length
        n_pruned = int(np.clip(affordable / EPISODES_PER_CHALLENGER, FEWEST_PRUNED, MOST_PRUNED))
        races, known = self.races, self.races.best(ALL_TIME_BEST)
        first = len(races.trees)
        races.trees += self.challengers.make(n_pruned, generator)
        self.challengers.imagine(races.trees, races.policy, generator)
        looks = LOOKS if affordable > MANY_EPISODES else SHORT_LOOKS
        # Where not all can be run until the first look, those that the model scores best.
        most = max(int(affordable / looks[0]) - 1, 1)
        challengers = [*range(first, len(races.trees)), *known]
        promising = sorted(challengers, key=lambda one: -races.trees[one].imagined)[:most]
        return races.begin([one for one in challengers if one in promising], looks)

    def _raced(self, generator: np.random.Generator) -> Figures:
        """Take the last episode as one of the race, and go on."""
        facts = self.races.take_last_episode()
        if not facts:
            return {}
        # The longest episode that is possible; without a limit the longest so far.
        longest = self._problem.max_episode_steps or self._experience.longest
        if self.races.is_run:
            facts |= self.races.end(self.model_trust())
            facts |= self._go_on(generator)
        elif self.steps + longest > self._budget.total:
            facts |= self.races.end(self.model_trust())  # not one more episode may fit
        return facts

    def _go_on(self, generator: np.random.Generator) -> Figures:
        """Propose again or, when few steps are left, let the best meet once more."""
        best = self.races.best(LAST_ENTRANTS)
        if self._budget.total - self.steps > self._budget.last or not best:
            return self._propose(generator)
        self.stage = Stage.LAST_RACE
        return self.races.begin(best, LOOKS)

    # Between two episodes.

    def state(self) -> Arrays:
        """Return all that is known; labels and the teacher's replay follow from the history."""
        return arrays_of(self, parts_of(self._start, self._method.sums, self._method.world_model))


def _derivation(problem: Problem, students: Students) -> Derivation:
    """Return how derived features are computed: those of the problem, and sums."""
    return Derivation.of(problem.schema.derive(students.declared(problem.schema)))
