"""Which tree a run hands over: the one it learned, or the one that it began with.

Both play the same fresh episodes, one pair after the other, until it is decided. The learned tree
takes the place of the start only if a contest *shows* that it earns more, or that it is smaller and
earns no less; and if it does not succeed less often by more than a point. Otherwise the start is
handed over, and the learned tree is kept beside it. A start that nobody has given, a single action
or a random tree, is nothing that has to be kept: there the one that earned more is handed over, but
for that last condition. The verdict on the two is about these episodes alone, which chose nothing
before.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import msgspec

from eutree.arrays import Floats
from eutree.contests import Better, NextEpisodes, NotWorse, best, hold, missing, new_table
from eutree.contests.table import seen_range
from eutree.display import counted, fixed
from eutree.evaluation import Evaluation, Interval, against
from eutree.interaction.acting import Controller
from eutree.learners import Method
from eutree.policies import TreePolicy
from eutree.validation import check_amounts, check_integer, check_number, check_range

LEARNED: Literal["learned"] = "learned"
START: Literal["start"] = "start"


AS_LEARNED = "This method hands over what it learned, whatever it earns"  # asked for no judgement


@dataclass(frozen=True)
class JudgedTree:
    """The returns and successes of one of the two trees.

    Attributes:
        n_leaves: Its leaves.
        mean_return: Mean return.
        return_interval: Its 95 % interval (Student's).
        worst: The worst return of all episodes.
        quantile_05: One episode in twenty returned no more.
        success_rate: Share of successes; None where none is reported.
        success_interval: Its 95 % interval (Wilson's).
    """

    n_leaves: int
    mean_return: float
    return_interval: Interval
    worst: float
    quantile_05: float
    success_rate: float | None = None
    success_interval: Interval | None = None

    @classmethod
    def of(cls, evaluation: Evaluation, n_leaves: int) -> "JudgedTree":
        """Return the figures of an evaluation."""
        return cls(
            n_leaves,
            evaluation.mean_return,
            evaluation.return_interval,
            evaluation.worst_return,
            evaluation.return_quantile_05,
            evaluation.success_rate,
            evaluation.success_interval,
        )

    def describe(self) -> str:
        """Return it in words, intervals in brackets."""
        success = ""
        if self.success_rate is not None and self.success_interval is not None:
            success = f"{self.success_rate:.1%} {self.success_interval:.1%}, "
        earned = self.return_interval.around(self.mean_return, 1)
        worst = f"{self.worst:{fixed(1, self.return_interval)}}"
        return f"{counted(self.n_leaves, 'leaf')}, {success}return {earned}, worst {worst}"


_SAID = {  # names of facts in events.jsonl
    "episodes": "episodes_compared",
    "return_change": "return",
    "success_change": "success",
    "steps": "steps_of_judging",
}


@dataclass(frozen=True)
class Judgement:
    """The learned tree of a run against its start.

    Attributes:
        episodes: Episodes that both played; 0 where both decide the same.
        return_change: Mean of learned minus start.
        return_interval: Its 95 % interval, true for any share of losses however rare (betting), on
            the ``condition``.
        success_change: Mean of the difference of successes; None where none is reported.
        success_interval: Its 95 % interval, by betting.
        challengers: Trees that were put to the test on the way.
        start: The start's figures; None where nothing was played.
        learned: The learned tree's figures; None where nothing was played.
        steps: Environment steps of both, where they decide which is handed over; else 0.
        handed_over: "learned" or "start".
        why: Why that one, in words.
        condition: On which the interval of the return depends, where the range of returns is not
            known; else "".
    """

    episodes: int
    return_change: float
    return_interval: Interval
    success_change: float | None = None
    success_interval: Interval | None = None
    challengers: int = 0
    start: JudgedTree | None = None
    learned: JudgedTree | None = None
    steps: int = 0
    handed_over: Literal["learned", "start"] = LEARNED
    why: str = ""
    condition: str = ""

    @classmethod
    def same(cls, *, challengers: int) -> "Judgement":
        """Return the judgement of a run that ends with the policy it started from."""
        return cls(0, 0.0, Interval(0.0, 0.0), challengers=challengers)

    @property
    def is_start(self) -> bool:
        """Whether the result decides as the start does."""
        return self.episodes == 0

    @property
    def lost(self) -> bool:
        """Whether a tree met the start, and the start is handed over."""
        return not self.is_start and self.handed_over == START

    def of_proven(self, start: bool, learned: bool) -> "Judgement":
        """Return the same, but that of the two trees the only one that is proven is handed over."""
        if start == learned:
            return self
        return replace(self, handed_over=LEARNED if learned else START, why="it alone is proven")

    def facts(self) -> dict[str, Any]:
        """Return the judgement in JSON's types."""
        return {_SAID.get(name, name): fact for name, fact in msgspec.to_builtins(self).items()}

    @classmethod
    def from_facts(cls, facts: dict[str, Any]) -> "Judgement":
        """Take back ``facts()``, also those of a run before version 0.3."""
        known = {one.name: _SAID.get(one.name, one.name) for one in fields(cls)}
        given = {name: facts[said] for name, said in known.items() if said in facts}
        return msgspec.convert(given, cls, strict=False)

    def describe(self, n_leaves: int) -> str:
        """Return the judgement in words; the run began with a tree of so many leaves."""
        start = "a single leaf" if n_leaves == 1 else "the tree that it started from"
        if self.is_start:
            tried = f": {counted(self.challengers, 'challenger')} tried" if self.challengers else ""
            return f"nothing better than {start} was found{tried}"
        words = f"return {self.return_interval.around(self.return_change, 1, '+')}"
        if self.success_change is not None and self.success_interval is not None:
            percent = self.success_interval.percent
            words += f", success {100 * self.success_change:+.1f} % {percent:.1f}"
        words += f" against {start}, on {counted(self.episodes, 'episode')} of their own"
        return f"{words}, {self.condition}" if self.condition else words

    def verdict(self) -> str:
        """Return which tree is handed over and how both did, in a sentence; "" if not played."""
        if self.start is None or self.learned is None:
            return ""
        both = (self.learned, self.start)
        taken, other = both if self.handed_over == LEARNED else both[::-1]
        name = "start" if self.handed_over == LEARNED else "learned"
        words = f"handed over: {taken.describe()} of {self.episodes:,}; {name}: {other.describe()}"
        if self.handed_over == START:
            words += f". The start is handed over: {self.why}"
        if self.why in (DID_BETTER, TOO_LARGE):
            words += f". The learned tree is handed over: {self.why}"
        return f"{words}. {AS_LEARNED}" if self.why == AS_LEARNED else words


def judged(
    start: Evaluation,
    learned: Evaluation,
    *,
    known: tuple[float, float] | None = None,
    seen: tuple[float, float] | None = None,
    challengers: int = 0,
    sizes: tuple[int, int] | None = None,
) -> Judgement:
    """Return the judgement of two evaluations on the same episodes.

    ``known`` are the lowest and highest return of an episode, ``seen`` those of other episodes of
    the two; the ``sizes`` of both, in leaves, are by default as the evaluations say.
    """
    found = against(learned, start, known=known, seen=seen)
    sizes = sizes or (start.n_leaves or 0, learned.n_leaves or 0)
    return Judgement(
        episodes=found.episodes,
        return_change=found.return_change,
        return_interval=found.return_interval,
        success_change=found.success_change,
        success_interval=found.success_interval,
        challengers=challengers,
        start=JudgedTree.of(start, sizes[0]),
        learned=JudgedTree.of(learned, sizes[1]),
        condition=found.condition,
    )


CHEAP_STEPS, DEAR_STEPS = 100, 2  # of playing for each step of the run: side by side, one by one
FEWEST, MOST = 300, 5000  # pairs of episodes, where nobody names a number
PAIRS = 5  # for each episode gathered
STEPS = 10  # of judging for each environment step of the run
FEW_STEPS = 20_000  # that any run may spend on judging
FOR_SUCCESS = 1000  # pairs: the standard error of a difference of successes is then half a point
FEW = 64  # pairs
STAKE = 0.9  # of the largest
MARGIN = 0.005  # of the range of returns: how much less a smaller tree may earn

Play = Callable[[TreePolicy, Sequence[int]], Evaluation]  # (policy, numbers of starts)


@dataclass(frozen=True, kw_only=True)
class Handover:
    """How it is decided which tree a run hands over.

    Attributes:
        episodes: Most fresh episodes that the start and the learned tree both play at the end: the
            start is handed over unless the other is shown to earn more, or to be smaller and earn
            no less, and succeeds less often by a point at most; of a start that nobody has given
            it is enough, beside that, that the other earned more in them. None for five for each
            episode of the run, 300 to 5,000, in ten times as many steps as the run took, and in
            proportion in a short run where episodes run one by one (see ``Schedule``); 0 plays none
            and hands over the learned tree, as the presets that read the paper literally do.
        error: Chance that a tree that does not deserve it is taken for better.
        success_margin: How much less often than the start the learned tree may succeed.
        keep_success: Replace the policy, also while the run learns, only by one that succeeds as
            often in the same episodes; and the start only by one that succeeds as often on fresh
            ones, whatever the ``success_margin``.
        max_leaves: Most leaves of the result; a start that has more is not handed over. For methods
            that plan, or with ``race_steps``. Where a race ends the run it keeps the limit, and
            trees planned before may be larger; without a front the method alone keeps it. None for
            any number.
        front_steps: Most environment steps of the front: of the learned tree the best of each
            size is made, imagined where the method has a world model, and the smallest that plays
            within one standard error of the best, and succeeds as often as the start but for the
            ``success_margin``, meets the start. None for two for each step of the run, a hundred
            where episodes run side by side; 0 lets the learned tree itself meet the start.
        return_range: Lowest and highest return that an episode can have, where the environment does
            not say so itself (``eutree.interaction.first_look``); all that is said of the learned
            tree then holds without a condition, also offline where whole episodes speak.
        prefer_proven: A property, or ``""`` for that of the environment's plant: of the front the
            best that is proven to have it is picked, if any is, and between the pick and the start
            the only one that is proven is handed over; of several runs the best is chosen among
            those whose policies are proven.
        against: Who else plays the episodes of the policy that is handed over, as ``evaluate``
            takes it: fresh ones, which have chosen nothing.
    """

    episodes: int | None = None
    error: float = 0.05
    success_margin: float = 0.01
    keep_success: bool = False
    max_leaves: int | None = None
    front_steps: int | None = None
    return_range: tuple[float, float] | None = None
    prefer_proven: str | None = None
    against: Controller | None = None

    def __post_init__(self) -> None:
        if self.episodes is not None:
            check_integer("judge_episodes", self.episodes, low=0)
        check_amounts(self, front_steps=0)
        check_number("error", self.error, low=0.0, high=1.0, low_open=True)
        check_number("success_margin", self.success_margin, low=0.0, high=1.0)
        if self.return_range is not None:
            known = check_range("return_range", self.return_range)
            object.__setattr__(self, "return_range", known)

    @property
    def judges(self) -> bool:
        """Whether the learned tree has to deserve it."""
        return self.episodes != 0

    @property
    def has_front(self) -> bool:
        """Whether smaller trees are made of the learned one."""
        return self.judges and self.front_steps != 0

    def pairs(self, gathered: int) -> int:
        """Return the most pairs of episodes after a run of so many episodes."""
        if self.episodes is not None:
            return self.episodes
        return min(max(PAIRS * gathered, FEWEST), MOST)

    def steps(self, taken: int) -> int | None:
        """Return the most steps of judging after a run of so many steps; None for no limit."""
        return None if self.episodes is not None else max(STEPS * taken, FEW_STEPS)

    def steps_of_front(self, taken: int, *, side_by_side: bool) -> int:
        """Return the most steps of the front after a run of so many steps."""
        if self.front_steps is not None:
            return self.front_steps
        return taken * (CHEAP_STEPS if side_by_side else DEAR_STEPS)


def handover_for(method: Method, asked: Handover) -> Handover | None:
    """Return how it is decided for a method; None for the learned tree, whatever it is.

    That of a method which reads the paper to the letter is the object of study.
    """
    if asked.episodes is None and getattr(method, "reads_the_paper", False):
        return None
    return replace(asked, success_margin=0.0) if asked.keep_success else asked


class Duel:
    """The start and the learned tree in the same episodes; row 0 of the table is the start.

    All starts are fresh. There are ``most`` pairs at the most, and ``steps`` of both, None for no
    limit; after ``patience`` pairs they play on only while one is clearly ahead.
    """

    def __init__(
        self,
        start: TreePolicy,
        learned: TreePolicy,
        play: Play,
        *,
        most: int,
        steps: int | None,
        patience: int | None = None,
        seen: tuple[float, float] | None = None,
    ) -> None:
        self._trees = (start, learned)
        self.seen = seen
        self._play = play
        self._left = steps
        self._parts: tuple[list[Evaluation], list[Evaluation]] = ([], [])
        self.patience = most if patience is None else min(patience, most)
        self.table = new_table(2, most)
        self.steps = 0

    def run(self, tree: int, starts: Sequence[int]) -> Floats | None:
        """Return the returns of a tree from some starts; None where the steps are spent."""
        if self._left is not None and self.steps >= self._left and tree == 0:
            return None
        found = self._play(self._trees[tree], starts)
        self._parts[tree].append(found)
        self.steps += found.steps
        return found.returns

    def extend(self, pairs: int) -> None:
        """Play on until both trees have played so many starts."""
        for tree, starts in missing(self.table, NextEpisodes((0, 1), range(pairs))):
            returns = self.run(tree, starts)
            if returns is None:
                return
            self.table[tree, starts] = returns

    def evaluations(self) -> tuple[Evaluation, Evaluation]:
        """Return the episodes of both, from the starts that both have played."""
        start, learned = (Evaluation.join(parts) for parts in self._parts)
        both = range(min(start.episodes, learned.episodes))
        return start.of_episodes(both), learned.of_episodes(both)


def judge(
    handover: Handover,
    duel: Duel,
    sizes: tuple[int, int],
    *,
    known: tuple[float, float] | None,
    challengers: int,
    given: bool = True,
) -> Judgement:
    """Return which of the two is handed over, and the evidence on both.

    The duel is before its first episode. ``given`` says whether somebody has given the start, as a
    tree or by demonstrations; other arguments are those of ``judged``.
    """
    verdict = hold(_rule(handover, duel, sizes, known), duel.table, duel.run)
    shown = bool(verdict.winner)
    wins = shown or (not given and best(duel.table[:, verdict.starts], sizes) == 1)
    if wins and duel.evaluations()[0].successes is not None:
        duel.extend(min(FOR_SUCCESS, duel.patience))
    found = judged(
        *duel.evaluations(), known=known, seen=duel.seen, challengers=challengers, sizes=sizes
    )
    smaller = sizes[1] < sizes[0]
    if handover.max_leaves is not None and sizes[0] > handover.max_leaves:
        why = TOO_LARGE
    elif wins and (found.success_change or 0.0) < -handover.success_margin:
        why = FAILS_MORE
    elif shown:
        why = NO_LESS if smaller else EARNS_MORE
    elif wins:
        why = DID_BETTER
    else:
        why = NOT_SHOWN_SMALLER if smaller else NOT_SHOWN
    taken = LEARNED if why in _TAKEN else START
    return replace(found, steps=duel.steps, handed_over=taken, why=why)


EARNS_MORE = "it is shown to earn more"
NO_LESS = "it is smaller and shown to earn no less"
DID_BETTER = "nobody has given the start, and in these episodes it did better"
NOT_SHOWN = "these episodes could not show that the learned tree earns more"
NOT_SHOWN_SMALLER = (
    "these episodes could not show that the learned tree, which is smaller, earns no less"
)
FAILS_MORE = "the learned tree succeeds less often"
TOO_LARGE = "the start has more leaves than were asked for"
_TAKEN = (EARNS_MORE, NO_LESS, DID_BETTER, TOO_LARGE)


def _rule(
    handover: Handover, duel: Duel, sizes: tuple[int, int], known: tuple[float, float] | None
) -> NotWorse:
    """Return the rule: a tree as large as the start, or larger, has to earn more."""
    smaller = sizes[1] < sizes[0]
    if smaller:
        duel.extend(min(FEWEST // 3, duel.patience))
    low, high = seen_range(duel.table, known)
    margin = MARGIN * (high - low) if smaller else 0.0
    low, high = seen_range(duel.table, known, duel.seen)
    # Most of two near trees' returns are equal, and few pairs show only what is plain: what shows
    # either soonest is a large stake.
    large = (smaller or duel.patience <= FEW) and high > low
    stake = STAKE / (high - low - margin) if large else None
    return (NotWorse if smaller else Better)(
        margin=margin,
        error=handover.error,
        most=duel.table.shape[1],
        known=known,
        seen=duel.seen,
        stake=stake,
        patience=duel.patience,
    )
