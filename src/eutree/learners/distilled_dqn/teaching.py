"""The episodes of ``distilled-dqn``, the network that teaches, and the trees that copy a teacher.

CART copies it on everything that it was asked about, which DAgger gathers (Ross, Gordon and Bagnell
2011).
"""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.cart import grow_cart
from eutree.data import Episode
from eutree.learners.declared import State
from eutree.learners.distilled_dqn.sums import Labels, Sums, found_sums
from eutree.learners.episode_buffer import store_demonstrations
from eutree.learners.history import TERMINAL, History
from eutree.neural import DoubleDQN, DoubleDQNSettings, Scaling
from eutree.neural.double_dqn import reward_scale_of
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.world_model import ActionTree, leaf_node
from eutree.world_model.action_trees import from_decision_tree, to_decision_tree


class Experience:
    """All episodes of a learner, the demonstrations first."""

    def __init__(self, n_features: int, demonstrations: Sequence[Episode]) -> None:
        self.history = History(n_features, 1)
        store_demonstrations(self.history, demonstrations)
        self.n_shown = self.history.size  # how many of the transitions are of demonstrations

    @property
    def mean_length(self) -> float:
        """Mean number of steps of an episode."""
        return self.history.size / self.history.n_episodes

    @property
    def typical_return(self) -> float:
        """Mean size of a return shown; 0 where nothing was."""
        shown = self.history.rewards[: self.n_shown]
        returns = np.bincount(self.history.episodes[: self.n_shown], shown)
        return float(np.abs(returns).mean()) if shown.size else 0.0

    @property
    def longest(self) -> int:
        """Steps of the longest episode; 1 before the first."""
        return int(np.bincount(self.history.episodes).max(initial=1))

    def last(self) -> slice:
        """Return the rows of the last episode."""
        first = int(np.searchsorted(self.history.episodes, self.history.n_episodes - 1))
        return slice(first, self.history.size)

    def episode_from(self, first: int) -> slice:
        """Return the rows of the episode whose first row this is."""
        episodes = self.history.episodes
        return slice(first, int(np.searchsorted(episodes, episodes[first] + 1)))

    def return_of(self, rows: slice) -> float:
        """Return the sum of the rewards of some rows."""
        return float(self.history.rewards[rows].sum())

    def first_of_last(self, n_steps: int) -> int:
        """Return the first row of the last episodes that have so many steps; no demonstration."""
        row = max(self.history.size - n_steps, self.n_shown)
        number = self.history.episodes[min(row, self.history.size - 1)]
        return max(int(np.searchsorted(self.history.episodes, number)), self.n_shown)


class Students:
    """The actions of a teacher at observations, and trees that copy them."""

    def __init__(
        self,
        action_values: Callable[[Floats], Floats],  # the teacher's Q, from [N, d] to [N, A]
        n_actions: int,
        masks: Callable[[], Booleans | None] = lambda: None,  # [N, A] allowed; None for all
    ) -> None:
        self._action_values = action_values
        self._n_actions = n_actions
        self._masks = masks
        # What tests may ask for besides features; None before it is looked for.
        self.sums: Sums | None = None
        self.begin(0)

    def begin(self, first: int) -> None:
        """Forget all labels; observations before row ``first`` of the store are left out."""
        self._first = first
        self._labels: Integers = np.empty(0, dtype=np.int64)
        self._gaps: Floats = np.empty(0)

    def find_sums(self, observations: Floats, most: int) -> int:
        """Find weighted sums of features that shorten copies of the teacher; return how many."""
        self._label(observations)
        rows = observations[self._first :]
        self.sums = found_sums(Labels(rows, self._labels, self._action_values(rows)), most)
        return len(self.sums)

    def declared(self, schema: Schema) -> tuple[str, ...]:
        """Return the sums as derived features of a schema."""
        return self.sums.declarations(schema) if self.sums else ()

    def seen(self, observations: Floats) -> Floats:
        """Return what tests may ask for at observations [..., d]: features, and sums."""
        return self.sums.behind(observations) if self.sums else observations

    def fit(
        self,
        observations: Floats,
        max_leaves: int,
        *,
        weighted: bool = False,
        labels: Int32s | None = None,
    ) -> ActionTree:
        """Return a tree of at most so many leaves, of all observations that are stored, [N, d].

        A weighted observation counts by max_a Q - min_a Q there, as in VIPER (Bastani, Pu and
        Solar-Lezama 2018). ``labels`` [N] are copied in place of the teacher's actions.
        """
        rows, classes, weights = observations, labels, None
        if classes is None:
            self._label(observations)
            rows, classes = observations[self._first :], self._labels.astype(np.int32)
            weights = self._gaps if weighted and self._gaps.sum() > 0.0 else None
        tree, actions = grow_cart(
            self.seen(rows),
            classes.astype(np.int64),
            n_classes=self._n_actions,
            max_leaves=max_leaves,
            weights=weights,
        )
        return from_decision_tree(tree, actions)

    def act(self, tree: ActionTree, observation: Floats, allowed: Booleans | None = None) -> int:
        """Return a tree's action at an observation [d], among those that are allowed, [A]."""
        seen = self.seen(observation)
        action = int(tree.action[leaf_node(tree, 0, seen)])
        if allowed is None or allowed[action]:
            return action
        schema = Schema.anonymous(seen.size, self._n_actions)
        policy = TreePolicy(*to_decision_tree(tree, seen.size), schema)
        return policy.act(seen.tolist(), allowed)

    def agree(self, tree: ActionTree, observations: Floats, actions: Int32s) -> bool:
        """Return whether a tree does just this at observations [T, d]."""
        return all(
            self.act(tree, observation) == action
            for observation, action in zip(observations, actions.tolist(), strict=True)
        )

    def _label(self, observations: Floats) -> None:
        """Ask the teacher about the observations that it has not seen yet."""
        new = slice(self._first + self._labels.size, len(observations))
        values, masks = self._action_values(observations[new]), self._masks()
        best = best_of(values, None if masks is None else masks[new])
        self._labels = np.concatenate([self._labels, best])
        self._gaps = np.concatenate([self._gaps, np.ptp(values, axis=1)])


STUDENT_LEAVES = 400  # of DAgger's trees: they gather data, nobody reads them
ROUNDS = 12
LAST_OF_TEACHER = 4_000  # steps of the teacher's last episodes that it begins with, at most


class DAgger:
    """The rounds of one learner, of so many steps together; ``tree`` acts before the first."""

    def __init__(
        self, students: Students, experience: Experience, steps: int, tree: ActionTree
    ) -> None:
        self._students = students
        self._experience = experience
        self._steps = steps
        self.tree = tree  # who acts in the present round
        self.labelled_from = 0  # first row of the experience that is labelled
        self.round_from = 0  # the learner's steps at the beginning of the round

    def begin(self, steps: int) -> None:
        """Begin the first round, after so many steps of the teacher's."""
        self.labelled_from = self._experience.first_of_last(min(LAST_OF_TEACHER, self._steps))
        self._students.begin(self.labelled_from)
        self._begin_round(steps)

    def round_is_over(self, steps: int) -> bool:
        """Return whether the round has had its steps; the learner has taken so many in all."""
        return steps - self.round_from >= self._steps / ROUNDS

    def next_round(self, steps: int) -> int:
        """Fit the next tree; return the number of observations that it was fitted to."""
        self._begin_round(steps)
        return self._experience.history.size - self.labelled_from

    def take_back(self, tree: ActionTree) -> None:
        """Go on with this tree in the round that was under way."""
        self.tree = tree
        self._students.begin(self.labelled_from)

    def _begin_round(self, steps: int) -> None:
        self.round_from = steps
        self.tree = self._students.fit(self._experience.history.observations, STUDENT_LEAVES)


def best_of(values: Floats, allowed: Booleans | None) -> Integers:
    """Return the actions of the largest values [..., A], among those that are allowed."""
    return np.asarray(
        (values if allowed is None else np.where(allowed, values, -np.inf)).argmax(-1)
    )


class NetworkTeacher:
    """A Double DQN that learns from a run's episodes, the demonstrations first.

    ``known`` is how many episodes it has learned from, with the demonstrations. The network decides
    by its averaged weights as a policy.
    """

    def __init__(
        self,
        settings: DoubleDQNSettings,
        n_actions: int,
        demonstrations: Sequence[Episode],
        history: History,  # the demonstrations, stored
        *,
        updates: int,  # before its first step; at most one for each transition
        steps: int,  # that it is going to learn from
        generator: np.random.Generator,  # of its first weights
    ) -> None:
        self._per_step = settings.updates_per_step
        self._first_updates = min(updates, history.size)
        self._n_shown = self.known = history.n_episodes
        self._last_row = history.size + steps
        rewards = [episode.rewards for episode in demonstrations]
        self.policy = DoubleDQN(
            settings,
            Scaling.of(history.observations),
            n_actions,
            reward_scale=reward_scale_of(rewards, settings.discount),
            updates=max(self._first_updates + int(self._per_step * steps), 1),
            generator=generator,
        )
        self._show(history, 0, self.known)

    def learn(self, history: History, generator: np.random.Generator) -> bool:
        """Learn from the episodes that are new, of any actor; return whether it still learns."""
        first = int(np.searchsorted(history.episodes, self.known))
        if self.policy.updates and first >= self._last_row:  # there are demonstrations at least
            return False
        if not self.policy.updates:
            self.policy.update(self._first_updates, generator)
        self._show(history, self.known, history.n_episodes)
        self.known = history.n_episodes
        self.policy.update(round(self._per_step * (history.size - first)), generator)
        return True

    def take_back(self, state: State, history: History) -> None:
        """Take back the network, and store again the episodes it knows if it still learns."""
        self.policy.restore(state)
        if int(np.searchsorted(history.episodes, self.known)) < self._last_row:
            self._show(history, self._n_shown, self.known)

    def _show(self, history: History, first: int, last: int) -> None:
        """Store the episodes ``first`` to ``last`` - 1 in the replay."""
        masks = history.columns.get("allowed")
        bounds = np.searchsorted(history.episodes, np.arange(first, last + 1)).tolist()
        for begin, end in itertools.pairwise(bounds):
            rows = slice(begin, end)
            ahead = history.next_observations[end - 1 : end]
            self.policy.add(
                np.concatenate([history.observations[rows], ahead]),
                history.actions[rows].astype(np.int64),
                history.rewards[rows],
                terminated=bool(history.entered[end - 1] == TERMINAL),
                allowed=None if masks is None else masks[rows],
            )
