"""The learner of ``distilled-dqn``: the stages that it goes through, one after the other."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.learners.declared import (
    MOST,
    Found,
    Part,
    Stored,
    arrays_of,
    history_parts,
    packed_trees_part,
)
from eutree.learners.distilled_dqn.races import (
    MOST_PRUNED,
    ORIGINS,
    RACED_TREE,
    ImaginedChallengers,
    RacedTree,
    Races,
    packed_raced,
    packed_trees,
    unpacked_raced,
    unpacked_trees,
)
from eutree.learners.distilled_dqn.teaching import (
    DAgger,
    DistilledDQNChoices,
    Experience,
    GivenTeacher,
    NetworkTeacher,
    Students,
)
from eutree.learners.episode_buffer import EpisodeBuffer, random_action
from eutree.learners.history import History
from eutree.learners.learner import (
    Arrays,
    Decisions,
    Figures,
    Problem,
    Start,
    Step,
    Update,
    ValuingPolicy,
)
from eutree.neural import DoubleDQN
from eutree.policy_search.model_trust import ModelTrust
from eutree.world_model.action_trees import from_decision_tree, n_leaves, to_decision_tree
from eutree.world_model.ensemble import N_KINDS, Ensemble

FEWEST_PRUNED = 2
EPISODES_PER_CHALLENGER = 30  # that must be affordable for one more challenger
MANY_EPISODES = 200  # affordable: enough for looks that are far apart
LOOKS = (8, 20, 40, 72, 136)
SHORT_LOOKS = (4, 10, 20, 40)
ALL_TIME_BEST = 2  # that meet the policy again in every race
LAST_ENTRANTS = 5


class Stage(IntEnum):
    """Where a learner is."""

    TEACHER = 0
    DAGGER = 1
    RACE = 2
    LAST_RACE = 3


@dataclass(frozen=True)
class StepBudget:
    """Environment steps, and how they are divided.

    Attributes:
        total: Steps to learn in.
        teacher: Those in which the teacher acts.
        learning: Those from which it learns: its own, and of those that follow.
        dagger: Those in which DAgger gathers.
        last: Those that are kept for the last races.
        longest: Steps of the longest possible episode; None where there is no limit.
    """

    total: int
    teacher: int
    learning: int
    dagger: int
    last: float
    longest: int | None

    @classmethod
    def of(cls, method: DistilledDQNChoices, problem: Problem) -> "StepBudget":
        """Return the budget of a run: its own, or else the method's."""
        total = method.steps if problem.steps is None else problem.steps
        own = int(method.teacher_share * total)
        return cls(
            total,
            min(own, method.teacher_steps),
            min(max(own, int(method.learning_share * total)), method.teacher_steps),
            int(method.dagger_share * total),
            method.last_share * total,
            problem.max_episode_steps,
        )

    def exploration(self, method: DistilledDQNChoices, steps: int) -> float:
        """Return the chance of a random action of the teacher after so many steps."""
        passed = min(5.0 * steps / max(self.teacher, 1), 1.0)
        first, last = method.exploration, method.last_exploration
        return first + (last - first) * passed


class DistilledDQNLearner:
    """A learner of this method.

    Attributes:
        stage: Where it is.
        steps: Environment steps so far, demonstrations apart.
        dagger: DAgger's rounds.
        challengers: The world model, and the trees that it speaks for.
        races: The policy, and the trees that challenged it.
    """

    def __init__(self, method: DistilledDQNChoices, problem: Problem, start: Start) -> None:
        self._method = method
        self._problem = problem
        self._start = start
        self._budget = budget = StepBudget.of(method, problem)
        self._episode = EpisodeBuffer()
        self._experience = experience = Experience(problem.n_features, start.episodes)
        history = experience.history
        self.stage = Stage.TEACHER
        self.steps = 0
        self._teacher: NetworkTeacher | GivenTeacher
        if start.teacher is None:
            chance = np.random.default_rng((problem.n_features, history.size))
            self._teacher = NetworkTeacher(method, problem, start, history, budget.learning, chance)
        else:
            self._teacher = GivenTeacher(start.teacher)
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
            method.world_model, students, experience, problem.n_actions, method.max_leaves
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
            if self._episode.generator.random() < self._budget.exploration(
                self._method, self.steps
            ):
                return random_action(self._episode.generator, self._problem.n_actions, allowed)
            return self._teacher.act(observation, allowed)
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
        self._experience.add(self._episode.finish())

    def discard_episode(self) -> None:
        """Be as before the episode."""
        self._episode.clear()

    # Learning.

    @property
    def stage_name(self) -> str:
        """The name of the present stage, in one or two words."""
        return self.stage.name.lower().replace("_", " ")

    @property
    def teacher(self) -> ValuingPolicy:
        """Who teaches."""
        return self._teacher.policy

    @property
    def teacher_acts(self) -> bool:
        """Whether the present episode is the teacher's."""
        return self.stage is Stage.TEACHER

    def update(self, generator: np.random.Generator) -> Update:
        """Let the teacher learn from the last episode; go on to the next stage when it is time."""
        facts: Figures = {"stage": self.stage.name.lower()}
        if self._teacher.learn(self.history, generator) and self.stage is not Stage.TEACHER:
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
        return Decisions(*to_decision_tree(self.races.policy, self._problem.n_features))

    def model_trust(self) -> ModelTrust | None:
        """Return how the world model orders the trees that were really run; None without one."""
        return self.challengers.trust(self.races.trees)

    def _taught(self) -> Figures:
        """Go on to DAgger when the teacher has had its steps."""
        if self.steps >= self._budget.teacher:
            self.dagger.begin(self.steps)
            self.stage = Stage.DAGGER
        return {
            "exploration": self._budget.exploration(self._method, self.steps),
            "updates": self._teacher.updates,
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
        challengers = [*range(first, len(races.trees)), *known]
        return races.begin(challengers, LOOKS if affordable > MANY_EPISODES else SHORT_LOOKS)

    def _raced(self, generator: np.random.Generator) -> Figures:
        """Take the last episode as one of the race, and go on."""
        facts = self.races.take_last_episode()
        if not facts:
            return {}
        if self.races.is_run:
            facts |= self.races.end(self.model_trust())
            facts |= self._go_on(generator)
        elif self.steps + (self._budget.longest or self._experience.longest) > self._budget.total:
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
        return arrays_of(self, parts_of(self._start))


# The state.

NUMBERS = (
    "steps", "stage", "dagger.labelled_from", "dagger.round_from", "races.incumbent", "races.number"
)  # fmt: skip


def _are_numbers(found: Found) -> None:
    """Demonstrations are a part of all that a learner has lived."""
    most = (MOST, len(Stage) - 1, found.sizes["N"], MOST, found.sizes["T"] - 1, 2**31)
    for name, number, bound in zip(NUMBERS, found.state["numbers"].tolist(), most, strict=True):
        if not 0 <= number <= bound:
            raise found.refuse("numbers", f"{name} must be in 0..{bound}")
    n_shown = found.sizes["shown"]
    if found.sizes["N"] < n_shown or found.value("history_n_episodes") < found.sizes["n_shown"]:
        raise found.refuse("history_rewards", f"must begin with the {n_shown} demonstrated")


def _are_raced(found: Found) -> None:
    if sum(found.state[f"{RACED_TREE}n_returns"].tolist()) != found.sizes["earned"]:
        raise found.refuse(f"{RACED_TREE}n_returns", "must be as many as there are returns")


def _is_model(found: Found) -> None:
    if not found.sizes["B"]:
        raise found.refuse("model_starts", "must be at least one")
    if (found.state["model_spread"] == 0.0).any():
        raise found.refuse("model_spread", "must be positive")


def _is_race(found: Found) -> None:
    looks, run = found.state["race_looks"], found.state["race_run"]
    if not len(looks) or (np.diff(looks, prepend=0) < 1).any() or looks[-1] != found.sizes["X"]:
        raise found.refuse("race_looks", f"must ascend from 1 to {found.sizes['X']}, the episodes")
    if found.sizes["R"] < 2:
        raise found.refuse("race_entrants", "must be at least two")
    for column, below in enumerate((found.sizes["R"], found.sizes["X"], found.sizes["N"])):
        if (run[:, column] >= below).any():
            raise found.refuse("race_run", f"column {column} must be in 0..{below - 1}")


_WEIGHTS = Stored("f4", ("weights",))
_TEACHER = Part(
    {
        "teacher_known": Stored("i8", "1", low=0, most="history_n_episodes", at="_teacher.known"),
        "teacher_updates": Stored("i8", "1", low=0, most=MOST),
        **{f"teacher_{name}": _WEIGHTS for name in ("online", "target", "average", "mean")},
        "teacher_square": _WEIGHTS._replace(low=0),
    },
    at="_teacher.policy",
    prefix="teacher_",
    save=DoubleDQN.state,
    make=lambda learner, state: learner._teacher.take_back(state, learner.history),
)
_RACED_TREES = Part(
    {
        f"{RACED_TREE}returns": Stored("f8", ("earned",)),
        f"{RACED_TREE}n_returns": Stored("i8", "T", low=0, most="earned"),
        f"{RACED_TREE}origin": Stored("i8", "T", low=0, below=len(ORIGINS)),
        f"{RACED_TREE}imagined": Stored("f8", "T", nan=True),
    },
    _are_raced,
    at="races.trees",
    prefix=RACED_TREE,
    save=packed_raced,
    make=lambda _, state: unpacked_raced(state),
)
_STUDENT = packed_trees_part("student_", 1)._replace(
    at="dagger.tree",
    prefix="student_",
    save=lambda tree: packed_trees([tree]),
    make=lambda learner, state: learner.dagger.take_back(*unpacked_trees(state)),
)
_MODEL = Part(
    {
        "model_centre": Stored("f8", ("seen",)),
        "model_spread": Stored("f8", ("seen",), low=0),
        "model_move": Stored("f8", "d", low=0),
        "model_moves": Stored("f8", "d2"),
        "model_binary": Stored("b1", "d"),
        "model_low": Stored("f8", "d"),
        "model_high": Stored("f8", "d"),
        "model_earned": Stored("f8", (N_KINDS, 4)),
        "model_weights": Stored("f4", ("members", "member")),
        "model_starts": Stored("f8", "Bd"),
        "model_horizon": Stored("i8", "1", low=1, most=MOST),
        "model_returns": Stored("f8", "2"),
    },
    _is_model,
    optional=True,  # before it is fitted
    at="challengers.ensemble",
    prefix="model_",
    save=Ensemble.state,
    make=lambda learner, state: learner.challengers.ensemble_of(state),
)
_RACE = Part(
    {
        "race_returns": Stored("f8", "RX", nan=True),
        "race_entrants": Stored("i8", "R", low=0, below="T"),
        "race_looks": Stored("i8", "K", low=1, most="X"),
        "race_run": Stored("i8", "Q3", low=0, most=MOST),
    },
    _is_race,
    optional=True,
    at="races",
    save=Races.race_state,
    make=lambda learner, state: learner.races.take_back(state),
)
_NUMBERS_PART = Part({"numbers": Stored("i8", (len(NUMBERS),), at=" ".join(NUMBERS))}, _are_numbers)


def parts_of(start: Start) -> tuple[Part, ...]:
    """Return the parts of a learner's state; a teacher that was given is given again."""
    teacher = () if start.teacher is not None else (_TEACHER,)
    raced = packed_trees_part(RACED_TREE, "T"), _RACED_TREES
    history = history_parts("_experience.history")
    return (*history, *teacher, *raced, _NUMBERS_PART, _STUDENT, _MODEL, _RACE)
