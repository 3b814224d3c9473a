"""The learner of ``distilled-dqn``: its stages, its trees, and the races between them."""

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.learners.contenders import (
    Contender,
    packed_contenders,
    packed_trees,
    unpacked_contenders,
    unpacked_trees,
)
from eutree.learners.distilled_dqn_choices import DistilledDQNChoices
from eutree.learners.history import TERMINAL, History
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
from eutree.learners.model_trust import ModelTrust
from eutree.learners.stored_state import part, prefixed
from eutree.learners.students import Students
from eutree.learners.teachers import GivenTeacher, NetworkTeacher
from eutree.policy_search.patient_race import LOOKS, PatientRace
from eutree.policy_search.rollout_pruning import pruned_by_rollouts
from eutree.trees import DecisionTree
from eutree.world_model import ActionTree, Transitions
from eutree.world_model.action_trees import from_decision_tree, n_leaves, to_decision_tree
from eutree.world_model.ensemble import Ensemble, fit_ensemble
from eutree.world_model.ensemble_rollouts import EnsembleRollouts

N_STARTS = 50  # first observations of imagined episodes
STUDENT_LEAVES = 400  # of DAgger's trees: they gather data, nobody reads them
DAGGER_ROUNDS = 12
LAST_OF_TEACHER = 4_000  # steps of the teacher's last episodes that DAgger begins with, at most
PRUNED = ((3, True), (3, False), (2, False), (3, True), (3, False), (2, True))
FEWEST_PRUNED = 2
EPISODES_PER_RIVAL = 30  # that must be affordable for one more rival
MANY_EPISODES = 200  # affordable: enough for looks that are far apart
SHORT_LOOKS = (4, 10, 20, 40)
ALL_TIME_BEST = 2  # that meet the policy again in every race
LAST_ENTRANTS = 5
FEW_RETURNS, MANY_RETURNS = 4, 12  # below which a contender's mean says nothing, or little
ROW_OF_RACE = 10_000  # starts of one race are numbered from this times the race's number on
NUMBERS = ("steps", "stage", "labelled_from", "round_from", "incumbent", "n_races")


class Stage(IntEnum):
    """Where a learner is."""

    TEACHER = 0
    DAGGER = 1
    RACE = 2
    LAST_RACE = 3


class DistilledDQNLearner:
    """A learner of this method.

    Attributes:
        history: All transitions, the demonstrations first.
        stage: Where it is.
        steps: Environment steps so far, demonstrations apart.
        contenders: The start and all trees that raced or are to race.
        incumbent: Number of the contender that is the policy.
    """

    def __init__(self, method: DistilledDQNChoices, problem: Problem, start: Start) -> None:
        self._method = method
        self._problem = problem
        self._whole = DecisionTree.single_leaf(problem.n_features)
        self.history = History(problem.n_features, 1)
        for episode in start.episodes:
            self._store(episode.observations, episode.actions, episode.rewards,
                        terminated=episode.terminated, shown=True)  # fmt: skip
        self._n_shown = self.history.size
        self._budget = method.steps if problem.steps is None else problem.steps
        self._teacher_steps = min(int(method.teacher_share * self._budget), method.teacher_steps)
        self._dagger_steps = int(method.dagger_share * self._budget)
        self.stage = Stage.TEACHER
        self.steps = self._labelled_from = self._round_from = 0
        self._n_races = 0
        self._generator = np.random.default_rng((problem.n_features, self.history.size))
        self._teacher: NetworkTeacher | GivenTeacher
        if start.teacher is None:
            self._teacher = NetworkTeacher(
                method, problem, start, self.history, self._teacher_steps, self._generator
            )
        else:
            self._teacher = GivenTeacher(start.teacher)
        self._students = Students(self.teacher.action_values, problem.n_actions)
        tree = from_decision_tree(start.expert.tree, start.expert.actions) if start.expert else None
        if tree is None or n_leaves(tree) > method.max_leaves:
            tree = self._students.fit(
                self.history.observations, method.max_leaves, labels=self.history.actions
            )
        self._student = tree
        self.contenders = [Contender(tree, "start")]
        self.incumbent = 0
        self._ensemble: Ensemble | None = None
        self._race: PatientRace | None = None
        self._entrants: list[int] = []
        self._run: list[tuple[int, int, int]] = []  # entrant, number, first row of each heat
        self._heat: tuple[int, int] | None = None
        self._observations: list[Floats] = []  # of the present episode
        self._steps: list[Step] = []

    # Gathering.

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation."""
        self._generator = generator
        self._observations, self._steps = [observation], []

    def act(self) -> int:
        """Return the action for the present observation."""
        observation = self._observations[-1]
        if self.stage is Stage.TEACHER:
            if self._generator.random() < self.exploration:
                return int(self._generator.integers(self._problem.n_actions))
            return self._teacher.act(observation)
        return self._students.act(self._actor(), observation)

    def _actor(self) -> ActionTree:
        """Return the tree that decides in the present episode."""
        if self.stage is Stage.DAGGER:
            return self._student
        running = self.incumbent if self._heat is None else self._entrants[self._heat[0]]
        return self.contenders[running].tree

    def next_start(self) -> int | None:
        """Return the number of the start of the next episode; None if any will do.

        Episodes from starts of one number begin alike, so that trees can be compared.
        """
        if self._heat is None:
            return None
        return ROW_OF_RACE * self._n_races + self._heat[1]

    def observe(self, step: Step) -> None:
        """Keep what came of an action."""
        self._observations.append(step.observation)
        self._steps.append(step)

    def end_episode(self) -> None:
        """Store the episode."""
        self._store(
            np.array(self._observations),
            np.array([step.action for step in self._steps], dtype=np.int64),
            np.array([step.reward for step in self._steps]),
            terminated=self._steps[-1].terminated,
        )
        self.discard_episode()

    def discard_episode(self) -> None:
        """Be as before the episode."""
        self._observations, self._steps = [], []

    @property
    def exploration(self) -> float:
        """Chance of a random action of the teacher now."""
        passed = min(5.0 * self.steps / max(self._teacher_steps, 1), 1.0)
        first, last = self._method.exploration, self._method.last_exploration
        return first + (last - first) * passed

    # Learning.

    @property
    def stage_name(self) -> str:
        """What is under way, in one or two words."""
        return self.stage.name.lower().replace("_", " ")

    @property
    def teacher(self) -> ValuingPolicy:
        """Who teaches."""
        return self._teacher.policy

    def update(self, generator: np.random.Generator) -> Update:
        """Let the teacher learn from the last episode; go on to the next stage when it is time."""
        facts: Figures = {"stage": self.stage.name.lower()}
        if self.stage is Stage.TEACHER:
            facts |= self._teach(generator)
        elif self.stage is Stage.DAGGER:
            facts |= self._gather(generator)
        else:
            facts |= self._raced(generator)
        return Update(figures=facts)

    def decisions(self) -> Decisions:
        """Return the policy."""
        tree, actions = to_decision_tree(
            self.contenders[self.incumbent].tree, self._problem.n_features
        )
        return Decisions(tree, actions)

    def _raced(self, generator: np.random.Generator) -> Figures:
        """Take the last episode as a heat of the race, and go on."""
        race, heat = self._race, self._heat
        if race is None or heat is None:
            return {}
        rows = self._rows_of_last()
        value = float(self.history.rewards[rows].sum())
        facts: Figures = {
            "race": self._n_races,
            "entrant": self._entrants[heat[0]],
            "origin": self.contenders[self._entrants[heat[0]]].origin,
            "start": heat[1],
            "return": value,
        }
        self._run.append((*heat, rows.start))
        self._tell(race, heat, value)
        self._call(race)
        if self._heat is None:
            won = race.winner()
            mean, error, pairs = race.ahead(won)
            facts |= {"winner": self._entrants[won], "ahead": mean, "error": error, "pairs": pairs}
            facts |= self._end_race(race)
            facts |= self._go_on(generator)
        elif self._short():
            facts |= self._end_race(race)
        return facts

    def _short(self) -> bool:
        """Return whether the longest possible episode no longer fits into the steps."""
        longest = self._problem.max_episode_steps
        if longest is None:
            longest = int(np.bincount(self.history.episodes).max(initial=1))
        return self.steps + longest > self._budget

    def _store(
        self,
        observations: Floats,
        actions: Integers,
        rewards: Floats,
        *,
        terminated: bool,
        shown: bool = False,
    ) -> None:
        self.history.append_episode(
            observations,
            actions,
            rewards,
            self._whole.leaf_index(observations),
            terminated=terminated,
            demonstrated=shown,
        )
        if not shown:
            self.steps += len(actions)

    def _teach(self, generator: np.random.Generator) -> Figures:
        """Let the teacher learn from the episodes that are new."""
        history, rows = self.history, self._rows_of_last()
        self._teacher.learn(history, generator)
        if self.steps >= self._teacher_steps:
            self._labelled_from = self._first_of_last(min(LAST_OF_TEACHER, self._dagger_steps))
            self._students.begin(self._labelled_from)
            self._student = self._students.fit(history.observations, STUDENT_LEAVES)
            self._round_from = self.steps
            self.stage = Stage.DAGGER
        return {
            "exploration": self.exploration,
            "updates": self._teacher.updates,
            "return": float(history.rewards[rows].sum()),
        }

    def _rows_of_last(self) -> slice:
        """Return the rows of the last episode."""
        first = int(np.searchsorted(self.history.episodes, self.history.n_episodes - 1))
        return slice(first, self.history.size)

    def _first_of_last(self, n_steps: int) -> int:
        """Return the first row of the last episodes that have so many steps; no demonstration."""
        row = max(self.history.size - n_steps, self._n_shown)
        number = self.history.episodes[min(row, self.history.size - 1)]
        return max(int(np.searchsorted(self.history.episodes, number)), self._n_shown)

    def _gather(self, generator: np.random.Generator) -> Figures:
        """Fit DAgger's next tree, if its round is over; race when all rounds are."""
        earned: Figures = {"return": float(self.history.rewards[self._rows_of_last()].sum())}
        if self.steps - self._round_from < self._dagger_steps / DAGGER_ROUNDS:
            return earned
        self._round_from = self.steps
        if self.steps - self._teacher_steps >= self._dagger_steps:
            self.stage = Stage.RACE
            self._propose(generator)
            return earned | {"rivals": len(self._entrants) - 1}
        self._student = self._students.fit(self.history.observations, STUDENT_LEAVES)
        return earned | {"labels": self.history.size - self._labelled_from}

    def _propose(self, generator: np.random.Generator) -> None:
        """Fit the world model, make rivals of the policy, and let them race."""
        data = self._transitions()
        ensemble = self._ensemble
        if ensemble is None:
            ensemble = fit_ensemble(data, self._method.world_model, generator)
        else:
            ensemble = ensemble.fitted_on(data, generator)
        self._ensemble = ensemble
        mean_length = self.history.size / self.history.n_episodes
        affordable = (self._budget - self.steps) / mean_length
        n_rivals = int(np.clip(affordable / EPISODES_PER_RIVAL, FEWEST_PRUNED, len(PRUNED)))
        rivals = [self._cart()]
        rivals += [self._pruned(*how, ensemble, generator) for how in PRUNED[:n_rivals]]
        known = [one for one in self._best(ALL_TIME_BEST) if one != self.incumbent]
        first = len(self.contenders)
        self.contenders += rivals
        self._imagine(ensemble, generator)
        entrants = [self.incumbent, *range(first, len(self.contenders)), *known]
        self._begin_race(entrants, LOOKS if affordable > MANY_EPISODES else SHORT_LOOKS)

    def _transitions(self) -> Transitions:
        of = self.history
        return Transitions(
            of.observations,
            of.actions.astype(np.int64),
            of.rewards,
            of.next_observations,
            of.entered == TERMINAL,
            of.episodes.astype(np.int64),
            self._problem.n_actions,
        )

    def _cart(self) -> Contender:
        limit = self._method.max_leaves
        return Contender(self._students.fit(self.history.observations, limit), "cart")

    def _pruned(
        self, times: int, weighted: bool, ensemble: Ensemble, generator: np.random.Generator
    ) -> Contender:
        """Return a tree of several times the leaves allowed, pruned by imagined returns."""
        limit = self._method.max_leaves
        large = self._students.fit(self.history.observations, times * limit, weighted=weighted)
        rollouts = EnsembleRollouts(ensemble, N_STARTS, generator)
        tree, score = pruned_by_rollouts(large, rollouts, limit, generator)
        return Contender(tree, "pruned-weighted" if weighted else "pruned", score)

    def _imagine(self, ensemble: Ensemble, generator: np.random.Generator) -> None:
        """Score all contenders in the same imagined episodes, which chose none of them."""
        rollouts = EnsembleRollouts(ensemble, N_STARTS, generator)
        rollouts.run(self.contenders[self.incumbent].tree)
        for one in self.contenders:
            one.imagined = rollouts.score(rollouts.returns_of(one.tree))

    def model_trust(self) -> ModelTrust | None:
        """Return how the world model orders the trees that were really run; None without one."""
        if self._ensemble is None:
            return None
        met = [one for one in self.contenders if len(one.returns) >= FEW_RETURNS]
        return ModelTrust(
            np.array([one.imagined for one in met]),
            np.array([one.mean_return for one in met]),
            np.array([len(one.returns) for one in met], dtype=np.int64),
        )

    def _best(self, n: int) -> list[int]:
        """Return the contenders that earned most, among those that ran often enough."""
        known = [i for i, c in enumerate(self.contenders) if len(c.returns) >= MANY_RETURNS]
        return sorted(known, key=lambda i: -self.contenders[i].mean_return)[:n]

    def _begin_race(self, entrants: Sequence[int], looks: Sequence[int]) -> None:
        self._entrants = list(entrants)
        self._race = PatientRace(len(entrants), looks)
        self._n_races += 1
        self._run = []
        self._call(self._race)

    def _call(self, race: PatientRace) -> None:
        """Find the next heat; what another tree ran, deciding alike throughout, is known."""
        self._heat = race.next()
        while self._heat is not None and (known := self._known(*self._heat)) is not None:
            self._tell(race, self._heat, known)
            self._heat = race.next()

    def _known(self, entrant: int, number: int) -> float | None:
        tree = self.contenders[self._entrants[entrant]].tree
        for _, _, first in (heat for heat in self._run if heat[1] == number):
            last = int(np.searchsorted(self.history.episodes, self.history.episodes[first] + 1))
            if self._students.agree(
                tree, self.history.observations[first:last], self.history.actions[first:last]
            ):
                return float(self.history.rewards[first:last].sum())
        return None

    def _tell(self, race: PatientRace, heat: tuple[int, int], value: float) -> None:
        race.tell(*heat, value)
        self.contenders[self._entrants[heat[0]]].returns.append(value)

    def _end_race(self, race: PatientRace) -> Figures:
        """Let the winner be the policy, if what all races showed of both speaks for it too.

        The winner of a race is flattered by being the winner. The policy has run in more of them.
        Of rivals that a model proposed whose order may be chance, one has to be clearly ahead.
        """
        trust = self.model_trust()
        trusted = trust is not None and trust.better_than_chance
        rival = self._entrants[race.winner(clearly=not trusted)]
        if self.contenders[rival].sure_return > self.contenders[self.incumbent].sure_return:
            self.incumbent = rival
        self._race, self._heat = None, None
        facts: Figures = {"policy": self.incumbent}
        if trust is not None:
            facts.update(trust.figures())
        return facts

    def _go_on(self, generator: np.random.Generator) -> Figures:
        """Propose again or, when few steps are left, let the best meet once more."""
        best = [one for one in self._best(LAST_ENTRANTS) if one != self.incumbent]
        if self._budget - self.steps > self._method.last_share * self._budget or not best:
            self._propose(generator)
            return {"rivals": len(self._entrants) - 1}
        self.stage = Stage.LAST_RACE
        self._begin_race([self.incumbent, *best], LOOKS)
        return {"rivals": len(best)}

    # Between two episodes.

    def state(self) -> Arrays:
        """Return all that is known; labels and the teacher's replay follow from the history."""
        numbers = [self.steps, int(self.stage), self._labelled_from, self._round_from,
                   self.incumbent, self._n_races]  # fmt: skip
        state: Arrays = {"numbers": np.array(numbers, dtype=np.int64)}
        state |= prefixed("history_", self.history.state())
        state |= prefixed("teacher_", self._teacher.state())
        state |= prefixed("contender_", packed_contenders(self.contenders))
        state |= prefixed("student_", packed_trees([self._student]))
        if self._ensemble is not None:
            state |= prefixed("model_", self._ensemble.state())
        if self._race is not None:
            state["race_returns"] = self._race.returns
            state["race_looks"] = np.array(self._race.looks, dtype=np.int64)
            state["race_entrants"] = np.array(self._entrants, dtype=np.int64)
            state["race_run"] = np.array(self._run, dtype=np.int64).reshape(-1, 3)
        return state

    def take_back(self, state: Arrays) -> None:
        """Go on from a ``state()``."""
        numbers = dict(zip(NUMBERS, state["numbers"].tolist(), strict=True))
        self.history = History.from_state(part(state, "history_"), self._whole)
        self.steps, self.stage = numbers["steps"], Stage(numbers["stage"])
        self._labelled_from, self._round_from = numbers["labelled_from"], numbers["round_from"]
        self.incumbent, self._n_races = numbers["incumbent"], numbers["n_races"]
        self._teacher.restore(
            part(state, "teacher_"), self.history, replay=self.stage is Stage.TEACHER
        )
        self._students.begin(self._labelled_from)
        self.contenders = unpacked_contenders(part(state, "contender_"))
        (self._student,) = unpacked_trees(part(state, "student_"))
        if "model_weights" in state:
            self._ensemble = Ensemble.from_state(
                part(state, "model_"), self._method.world_model, self._problem.n_actions
            )
        if "race_returns" in state:
            looks = state["race_looks"].tolist()
            self._entrants = state["race_entrants"].tolist()
            self._run = [tuple(row) for row in state["race_run"].tolist()]
            self._race = PatientRace(len(self._entrants), looks, state["race_returns"])
            self._call(self._race)
