"""What was lived through, episode by episode, by a learner whose store has no leaves."""

from collections.abc import Sequence

import numpy as np

from eutree.data import Episode
from eutree.learners.episode_buffer import FinishedEpisode, store, store_demonstrations
from eutree.learners.history import History
from eutree.learners.learner import Arrays
from eutree.learners.transitions import transitions_of
from eutree.trees import DecisionTree
from eutree.world_model import Transitions


class Experience:
    """All episodes of a learner, the demonstrations first.

    Args:
        n_features: Number of features of an observation.
        demonstrations: What was shown.

    Attributes:
        history: Their transitions.
        n_shown: How many of these are of demonstrations.
    """

    def __init__(self, n_features: int, demonstrations: Sequence[Episode]) -> None:
        self._whole = DecisionTree.single_leaf(n_features)
        self.history = History(n_features, 1)
        store_demonstrations(self.history, demonstrations)
        self.n_shown = self.history.size

    def add(self, episode: FinishedEpisode) -> None:
        """Store an episode of the learner's own."""
        store(self.history, episode)

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

    def transitions(self, n_actions: int) -> Transitions:
        """Return all of it as a world model is fitted to."""
        return transitions_of(self.history, n_actions)

    def take_back(self, state: Arrays) -> None:
        """Go on from the history's ``state()``."""
        self.history = History.from_state(state, self._whole)
