"""Real episodes of trees in a policy search: run once each, counted, and known to all alike trees.

Nothing here has an environment: a tree and its start are yielded, and the episode is sent back.
"""

from array import array
from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import TypeVar

import numpy as np

from eutree.contests import NextEpisodes, Rule, Verdict, missing, new_table
from eutree.data import Episode
from eutree.policies import TreePolicy
from eutree.training.proposals import key

STARTS = 2**20  # of one block: more than ever run

Result = TypeVar("Result")
Running = Generator[tuple[TreePolicy, int], Episode, Result]  # yields a tree, and its start


@dataclass(frozen=True)
class Block:
    """Starts that have nothing in common with those of another block.

    Attributes:
        number: Number of the block.
        limit: Steps that may have been run at its end, all blocks together.
    """

    number: int
    limit: int


class RacedEpisodes:
    """All episodes of one search.

    Args:
        longest: Steps of the longest episode that may come; with ``grows``, of those known so far.
        grows: Whether a longer one may come.

    Attributes:
        all: The episodes, in the order in which they were run.
        returns: Their returns.
        steps: Their steps.
        longest: Steps for which there must be room before an episode begins.
    """

    def __init__(self, longest: int, *, grows: bool) -> None:
        self.all: list[Episode] = []
        self.returns = array("d")
        self.steps = 0
        self.longest = longest
        self._grows = grows
        self._run: dict[bytes, list[int]] = {}  # numbers of each tree's episodes of the block
        self._stored: deque[Episode] = deque()  # run before, but after the state of the search

    @property
    def stored(self) -> tuple[Episode, ...]:
        """Those yet to be taken up again."""
        return tuple(self._stored)

    def own(self, tree: TreePolicy) -> tuple[int, ...]:
        """Return the numbers of a tree's episodes of the present block."""
        return tuple(self._run.get(key(tree), ()))

    def leave_block(self) -> None:
        """Take up another block: the episodes of this one are no answer any more."""
        self._run.clear()

    def drop(self, tree: TreePolicy) -> None:
        """Forget which episodes a tree ran."""
        self._run.pop(key(tree), None)

    def take_back(
        self, episodes: Sequence[Episode], n_known: int, tree: TreePolicy, own: Sequence[int]
    ) -> None:
        """Stand where a search stood after ``n_known`` of the episodes, which go on after that.

        Of the present block it knows the ``tree``'s ``own`` episodes, by their numbers.
        """
        self.all = list(episodes[:n_known])
        self.returns = array("d", [episode.undiscounted_return for episode in self.all])
        self.steps = sum(map(len, self.all))
        if self._grows:
            self.longest = max([self.longest, *map(len, self.all)])
        self._stored = deque(episodes[n_known:])
        self._run = {key(tree): list(own)} if own else {}

    def hold(self, rule: Rule, block: Block, trees: Sequence[TreePolicy]) -> Running[Verdict]:
        """Hold a contest of trees, the incumbent first; the budget may end before it does.

        Where that is possible all run one start after the other: the more pairs are told by then.
        """
        table = new_table(len(trees), rule.most)
        while isinstance(due := rule.next(table), NextEpisodes):
            runs = [(tree, start) for tree, starts in missing(table, due) for start in starts]
            if self.steps + len(runs) * self.longest > block.limit:
                runs.sort(key=itemgetter(1))
            for tree, start in runs:
                run = yield from self.of(trees[tree], range(start, start + 1), block)
                if run is None:
                    return rule.stopped(table)
                table[tree, start] = run[0].undiscounted_return
        return due

    def of(self, tree: TreePolicy, numbers: range, block: Block) -> Running[list[Episode] | None]:
        """Return a tree's episodes from some starts of the block; None if steps are short."""
        mine = self._run.setdefault(key(tree), [])
        while len(mine) < numbers.stop:
            number = self._ran_alike(tree, len(mine))
            if number is None:
                if self.steps + self.longest > block.limit:
                    return None
                number = yield from self._new(tree, block.number * STARTS + len(mine))
            mine.append(number)
        return [self.all[number] for number in mine[numbers.start : numbers.stop]]

    def succeeds_less(self, policy: TreePolicy, challenger: TreePolicy) -> bool:
        """Return whether a challenger failed more of the starts that both ran."""
        both = zip(self._run[key(policy)], self._run[key(challenger)], strict=False)
        pairs = [(self.all[own], self.all[other]) for own, other in both]
        return sum(bool(other.is_success) - bool(own.is_success) for own, other in pairs) < 0

    def _ran_alike(self, tree: TreePolicy, start: int) -> int | None:
        """Return the episode as another tree ran it, if this one decides the same throughout."""
        for run in self._run.values():
            if len(run) > start:
                episode = self.all[run[start]]
                rows = episode.observations[:-1]
                if np.array_equal(tree.actions[tree.tree.leaf_index(rows)], episode.actions):
                    return run[start]
        return None

    def _new(self, tree: TreePolicy, start: int) -> Running[int]:
        episode = self._stored.popleft() if self._stored else (yield tree, start)
        self.steps += len(episode)
        if self._grows:
            self.longest = max(self.longest, len(episode))
        self.all.append(episode)
        self.returns.append(episode.undiscounted_return)
        return len(self.all) - 1
