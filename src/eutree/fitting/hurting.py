"""Which seconds of the demonstrations cost the tree its success, found by playing.

A step that differs from its like may be the one that saves the day, so disagreement accuses nobody.
Here a segment is accused by a trial: C4.5 makes the tree without it, and both trees play the same
episodes. Three sieves make that affordable. Only segments that support the leaves which have most
to do with failing are tried, and the last steps before a failure; of those only the ones without
which the tree is another one; these trees are halved by playing, and the best has to be shown to do
better on fresh episodes (``Better``). The next search begins with the accepted segments.

A segment may also be flipped: then the action before it, or after it, is imitated in its place, as
if the hand had been quicker, or slower. The action taken stays in the demonstrations; beside it
stands the action to be imitated (``Episode.taught``).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.contests import Better, Halving, hold, new_table
from eutree.contests.table import Run
from eutree.data import Demonstrations
from eutree.data.demonstrations import taught_in, teaching
from eutree.data.episode import CUT
from eutree.display import Displayed, counted
from eutree.evaluation import Evaluation, evaluate
from eutree.fitting.diagnosis import leaf_in_words
from eutree.fitting.playing import TIE, Player, Progress, most_guilty
from eutree.fitting.report import Person, result_in_words
from eutree.interaction import episode_seed
from eutree.interaction.deriving import acting_as
from eutree.interaction.episode import Stream
from eutree.interaction.making import Environment, opened
from eutree.learners import fit_expert_tree
from eutree.learners.starts import SETTINGS, FittedTree, fitted_trees, promising
from eutree.policies import TreePolicy
from eutree.recording.tree_making import Segment
from eutree.schema import Schema
from eutree.validation import check_integer, check_seed

NONE = -2  # no run of keys before, or after
BLAMED_LEAVES = 4
LOOKED_AT = 100  # episodes of the tree that say which leaves have to do with failing
EDGES = (1, 2, 3)  # steps at the end, or the beginning, of a run: a late hand, or an early one
BEFORE_FAILURE = (3, 6)  # steps
MOST_PAIRS = 600  # that show that a tree is better
ERROR = 0.05
LISTED = 6  # segments
FINALISTS = 3
CHOOSING, JUDGING, LOOKING, HALVING, CONFIRMING = 400, 401, 410, 440, 470  # first blocks
OFTEN = 0.05  # share of failures from which something is to be shown again


def accepted(demonstrations: Demonstrations, segments: Iterable[Segment]) -> Demonstrations:
    """Return demonstrations of which some segments are cut or flipped; the actions taken stay."""
    episodes = list(demonstrations.episodes)
    for one in segments:
        episodes[one.episode] = episodes[one.episode].teaching_in(one.start, one.stop, one.becomes)
    return replace(demonstrations, episodes=tuple(episodes))


def restored(demonstrations: Demonstrations) -> Demonstrations:
    """Return demonstrations with nothing cut or flipped."""
    return teaching(demonstrations, demonstrations.actions)


@dataclass(frozen=True, eq=False)
class Edit:
    """Steps to try without: ``rows`` [n] of the kept transitions, the new action of each [n]."""

    rows: Integers  # [n]
    becomes: Integers  # [n]
    why: str


@dataclass(frozen=True, eq=False)
class KeyRuns:
    """The kept transitions of demonstrations, as runs of one action."""

    taught: Integers  # [N]; the action to be imitated
    episode: Integers  # [N]; the number of the episode
    run: Integers  # [N]; the number of the run
    from_start: Integers  # [N]; steps from the beginning of the run
    to_end: Integers  # [N]; steps to the end of the run
    # The action taught before the run; ``NONE`` where the episode begins with it
    before: Integers  # [N]
    after: Integers  # [N]; the same behind it

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> "KeyRuns":
        """Return the runs of demonstrations."""
        taught = taught_in(demonstrations)
        kept = [(k, len(e)) for k, e in enumerate(demonstrations.episodes) if e.kept]
        episode = np.repeat([k for k, _ in kept], [length for _, length in kept])
        new = np.ones(len(taught), dtype=bool)
        new[1:] = (taught[1:] != taught[:-1]) | (episode[1:] != episode[:-1])
        run = np.cumsum(new) - 1
        first, place = np.flatnonzero(new), np.arange(len(taught))
        last = np.append(first[1:], len(taught)) - 1
        of_run, its_episode = taught[first], episode[first]
        before, after = (np.full(len(first), NONE) for _ in range(2))
        same = its_episode[1:] == its_episode[:-1]
        before[1:][same], after[:-1][same] = of_run[:-1][same], of_run[1:][same]
        return cls(
            taught, episode, run, place - first[run], last[run] - place, before[run], after[run]
        )

    def edits(self, rows: Integers, why: str) -> Iterator[Edit]:
        """Yield that these steps are cut, or flipped to the action after them, or before."""
        rows = rows[self.taught[rows] != CUT]
        if rows.size:
            yield Edit(rows, np.full(rows.size, CUT), why)
        for other in (self.after, self.before):
            known = rows[other[rows] >= 0]
            if known.size:
                yield Edit(known, other[known], why)

    def pieces(self, rows: Integers) -> list[Integers]:
        """Return some steps, ascending, as consecutive ones of one run each."""
        ends = np.flatnonzero((np.diff(rows) > 1) | (np.diff(self.run[rows]) > 0)) + 1
        return [piece for piece in np.split(rows, ends) if piece.size]


def segments_of(known: Demonstrations, edit: Edit) -> tuple[Segment, ...]:
    """Return the steps of an edit as segments, in order."""
    kept = [(k, step) for k, e in enumerate(known.episodes) if e.kept for step in range(len(e))]
    found: list[Segment] = []
    for row, becomes in sorted(zip(edit.rows.tolist(), edit.becomes.tolist(), strict=True)):
        number, step = kept[row]
        action, to = int(known.episodes[number].actions[step]), None if becomes == CUT else becomes
        last = found[-1] if found else None
        if last and (last.episode, last.stop, last.action, last.becomes) == (
            number, step, action, to
        ):  # fmt: skip
            found[-1] = replace(last, stop=step + 1)
        else:
            found.append(Segment(number, step, step + 1, None, action, to))
    return tuple(replace(one, seconds=_seconds(known, one)) for one in found)


def _seconds(known: Demonstrations, one: Segment) -> tuple[float, float] | None:
    """Return when a segment begins and ends, where the times of the steps were measured."""
    time = known.episodes[one.episode].steps.get("time")
    if time is None or len(time) < 2 or not np.isfinite(time).all():
        return None
    ends = np.append(time, 2 * time[-1] - time[-2]) - time[0]
    return round(float(ends[one.start]), 3), round(float(ends[one.stop]), 3)


@dataclass(frozen=True, eq=False)
class Hurt:
    """Segments without which the tree is better, and their cost."""

    what: str  # ``"cut"``, ``"flip"``, or ``"show again"`` where neither was shown to help
    segments: tuple[Segment, ...]  # in order
    why: str  # their common trait, in words
    before: Evaluation  # the tree with them, all earlier ones accepted; fresh episodes
    after: Evaluation | None  # without them in the same episodes; None for ``"show again"``

    def words(self, schema: Schema, numbers: Sequence[int]) -> str:
        """Return the proposal in a few lines; ``numbers`` are the episodes' in their folder."""
        steps = sum(one.stop - one.start for one in self.segments)
        episodes = len({one.episode for one in self.segments})
        which = f"{counted(steps, 'step')} of {counted(episodes, 'episode')}"
        lines = [f"{self.what} {which}: {self.why}"]
        lines += [f"  {one.words(schema, numbers)}" for one in self.segments[:LISTED]]
        if len(self.segments) > LISTED:
            lines.append(f"  and {len(self.segments) - LISTED} segments more")
        return "\n".join([*lines, f"  {self.reached}"])

    @property
    def reached(self) -> str:
        """The results of the tree, in words."""
        if self.after is None:
            return f"the tree reaches {result_in_words(self.before)}"
        before, after = result_in_words(self.before), result_in_words(self.after)
        return f"with them {before}, without {after}"


@dataclass(frozen=True, eq=False)
class Hurting(Displayed):
    """The segments found, with the trees before and after."""

    demonstrations: Demonstrations  # as they were given
    edited: Demonstrations  # the same with all cuts and flips; the actions taken stay in them
    hurts: tuple[Hurt, ...]  # in order; each is tried on top of those before it
    before: TreePolicy  # of the demonstrations
    after: TreePolicy  # of the steps that are left
    tried: int  # other trees that played
    episodes_played: int  # in all

    def __str__(self) -> str:
        """Return the segments found in a few lines."""
        return self.words(range(len(self.demonstrations.episodes)))

    def words(self, numbers: Sequence[int]) -> str:
        """Return the segments found; ``numbers`` are those of the episodes in their folder."""
        schema = self.demonstrations.schema
        lines = [one.words(schema, numbers) for one in self.hurts]
        if not any(one.after is not None for one in self.hurts):
            lines.append("no segment was shown to cost the tree its success")
        end = f"{counted(self.tried, 'tree')} tried, {self.episodes_played} episodes played in all"
        return "\n".join([*lines, end])


def find_hurting(
    demonstrations: Demonstrations,
    env: Environment,
    *,
    episodes: int = 3000,
    judged: int = 200,
    most: int = 3,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> Hurting:
    """Return the segments of demonstrations that cost the tree its success.

    Args:
        demonstrations: The episodes to search; steps that were cut before stay cut.
        env: Where to play: an environment, its id, or how to make it.
        episodes: Episodes that each search halves its trees by; confirming takes up to 3,600 more.
        judged: Fresh episodes that evaluate a tree with and without the segments.
        most: Most groups of segments.
        seed: The same seed finds the same.
        on_progress: Called after some episodes with their purpose and how many there were.

    Raises:
        InvalidArgumentError: There is nothing to fit, or the environment is another one.
        EnvironmentFault: The environment broke its contract.
    """
    for name, count in (("episodes", episodes), ("judged", judged), ("most", most)):
        check_integer(name, count, low=1)
    check_seed(seed)
    with opened(env) as given:
        games = _Games(acting_as(given, demonstrations), seed, on_progress)
        games.reports = any(one.is_success for one in demonstrations.kept)
        entrants = promising(fitted_trees(demonstrations, settings=SETTINGS, histories=(0, 1)), 8)
        games.begin("choosing", 3 * judged)
        chosen = entrants[games.best([one.policy for one in entrants], CHOOSING, 3 * judged)[0]]
        games.reports = games.reported  # a log may know what the environment does not say
        return _Search(demonstrations, chosen, games, episodes, judged).run(most)


class _Games(Player):
    """Plays trees from common starts; of most episodes only the figures are asked for.

    Attributes:
        reports: Whether successes are reported, perhaps of these alone: an episode of which
            nothing is said was then none.
        reported: Whether one was, so far.
    """

    reports = reported = False

    def figures(self, tree: TreePolicy, block: int, episodes: int, first: int = 0) -> Evaluation:
        """Return the result of a tree from so many starts of a block, the same for every tree."""
        seed = episode_seed(episode_seed(self._seed, block, Stream.FITTING), first)
        found = evaluate(tree, self.world, episodes=episodes, seed=seed)
        self.reported = self.reported or found.successes is not None
        self.reports = self.reports or self.reported
        self._count(episodes)
        return found

    def best(
        self, trees: Sequence[TreePolicy], block: int, budget: int, keep: int = 1
    ) -> tuple[int, ...]:
        """Return which trees are left of a contest by halving, the best first."""
        rule = replace(Halving.within(budget, len(trees)), keep=min(keep, len(trees)))
        table = new_table(len(trees), rule.most)
        hold(rule, table, self._runner(trees, block))
        return rule.standing(table)[0]

    def is_better(self, tree: TreePolicy, than: TreePolicy, block: int, error: float) -> bool:
        """Return whether a tree is shown to do better than another on fresh episodes."""
        pair = (than, tree)
        self.figures(than, block, 1)
        known = (0.0, 1.0) if self.reports else None
        rule = Better(error=error, most=MOST_PAIRS, known=known)
        return hold(rule, new_table(2, rule.most), self._runner(pair, block)).shown

    def _runner(self, trees: Sequence[TreePolicy], block: int) -> Run:
        def run(tree: int, starts: Sequence[int]) -> Floats:
            found = self.figures(trees[tree], block, len(starts), starts[0])
            worths: Floats = found.counted_successes + TIE * found.returns
            return worths if self.reports else found.returns

        return run


@dataclass(eq=False)
class _Search:
    """Looks for segments that hurt, again and again."""

    given: Demonstrations  # the episodes to search
    chosen: FittedTree  # the tree to begin with, and how it was made
    games: _Games
    budget: int  # episodes that halve the trees of one round
    judged: int  # episodes that judge a tree
    tried: int = 0  # trees

    def run(self, most: int) -> Hurting:
        """Return the segments found, at most so many groups."""
        known, games = self.given, self.games
        first = tree = self._tree(known)
        reached, found = self._judge(tree), list[Hurt]()
        while len(found) < most:
            games.begin("playing", LOOKED_AT)
            played = games.play(tree, LOOKED_AT, LOOKING + len(found))
            earned = Person.of(self.given).mean_return
            guilty = most_guilty(played, earned, BLAMED_LEAVES)
            better = self._better(known, tree, guilty, len(found))
            if better is None:
                if played.failed(earned).mean() > OFTEN:
                    found += self._shown_again(known, tree, guilty, reached)
                break
            edit, tree = better
            segments = segments_of(known, edit)
            known, before = accepted(known, segments), reached
            reached = self._judge(tree)
            what = "flip" if (edit.becomes != CUT).all() else "cut"
            found.append(Hurt(what, segments, edit.why, before, reached))
        return Hurting(self.given, known, tuple(found), first, tree, self.tried, games.episodes)

    def _tree(self, known: Demonstrations) -> TreePolicy:
        history = self.chosen.policy.history
        seen = known.with_history(history) if history else known
        return replace(fit_expert_tree(seen, settings=self.chosen.settings), history=history)

    def _judge(self, tree: TreePolicy) -> Evaluation:
        self.games.begin("judging", self.judged)
        return self.games.figures(tree, JUDGING, self.judged)

    def _better(
        self, known: Demonstrations, tree: TreePolicy, guilty: list[int], number: int
    ) -> tuple[Edit, TreePolicy] | None:
        """Return an edit whose tree is shown to be better, with that tree; None if none is."""
        trees = self._trees(known, tree, guilty)
        if not trees:
            return None
        self.tried += len(trees)
        games = self.games
        games.begin("halving", self.budget)
        left = games.best([one for _, one in trees], HALVING + number, self.budget, FINALISTS)
        games.begin("confirming", FINALISTS * 2 * MOST_PAIRS)
        for place, one in enumerate(left):
            block = CONFIRMING + FINALISTS * number + place
            if games.is_better(trees[one][1], tree, block, ERROR / FINALISTS):
                return trees[one]
        return None

    def _trees(
        self, known: Demonstrations, tree: TreePolicy, guilty: list[int]
    ) -> list[tuple[Edit, TreePolicy]]:
        """Return the different trees that edits lead to; of two alike the first counts."""
        found: dict[bytes, tuple[Edit, TreePolicy] | None] = {tree.to_bytes(): None}
        for edit in self._edits(known, tree, guilty):
            taught = taught_in(known).copy()
            taught[edit.rows] = edit.becomes
            if (taught == CUT).all():
                continue
            other = self._tree(teaching(known, taught))
            found.setdefault(other.to_bytes(), (edit, other))
        return [entry for entry in found.values() if entry is not None]

    def _edits(self, known: Demonstrations, tree: TreePolicy, guilty: list[int]) -> Iterator[Edit]:
        """Yield the edits to try: groups of like steps first, then single pieces and episodes."""
        steps = KeyRuns.of(known)
        leaves = tree.tree.leaf_index(known.with_history(tree.history).observations)
        singles: list[tuple[Integers, str]] = []
        for leaf in guilty:
            inside, label = leaves == leaf, int(tree.actions[leaf])
            why = f"they teach {leaf_in_words(tree, leaf)}"
            agreed = inside & (steps.taught == label)
            yield from steps.edits(np.flatnonzero(agreed), why)
            yield from steps.edits(
                np.flatnonzero(inside & ~agreed), why.replace("teach", "contradict")
            )
            for count in EDGES:
                for place in (steps.to_end, steps.from_start):
                    yield from steps.edits(np.flatnonzero(agreed & (place < count)), why)
            singles += [(piece, why) for piece in steps.pieces(np.flatnonzero(agreed))]
        failed = [k for k, e in enumerate(known.episodes) if e.kept and e.is_success is False]
        ends = np.searchsorted(steps.episode, steps.episode, side="right")  # of their episodes
        for count in BEFORE_FAILURE:
            late = (ends - np.arange(ends.size) <= count) & np.isin(steps.episode, failed)
            yield from steps.edits(np.flatnonzero(late), "they came before a failure")
        for action, count in product(np.unique(steps.taught).tolist(), EDGES):
            late = (steps.taught == action) & (steps.to_end < count)
            yield from steps.edits(np.flatnonzero(late), "the hand was late")
        for rows, why in singles:
            yield from steps.edits(rows, why)
        for number in np.unique(steps.episode).tolist():
            rows = np.flatnonzero(steps.episode == number)
            yield Edit(rows, np.full(rows.size, CUT), "this episode misleads")

    def _shown_again(
        self, known: Demonstrations, tree: TreePolicy, guilty: list[int], reached: Evaluation
    ) -> list[Hurt]:
        """Return the longest piece shown where the tree fails often, to be shown again."""
        steps = KeyRuns.of(known)
        leaves = tree.tree.leaf_index(known.with_history(tree.history).observations)
        can = np.array([known.episodes[k].seed is not None for k in steps.episode.tolist()])
        for leaf in guilty:
            pieces = steps.pieces(np.flatnonzero((leaves == leaf) & (steps.taught != CUT) & can))
            if pieces:
                rows = max(pieces, key=len)
                why = f"the tree fails where it must {leaf_in_words(tree, leaf)}"
                same = Edit(rows, steps.taught[rows], why)
                return [Hurt("show again", segments_of(known, same), why, reached, None)]
        return []
