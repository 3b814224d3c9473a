"""Policy search with racing: many challengers, none to be trusted, and real episodes that decide.

Several world models, none of which need be right, each propose improved or smaller trees, C4.5
proposes prunings, and the incumbent is changed at random. All of them have to prove themselves in
episodes that start as the incumbent's do; one replaces it only if it earns more by a standard
error, or is smaller and does as well. All steps are counted, and an episode begins only if the
budget allows for the longest.

The search has no environment: ``next_heat`` says which tree to run from which start, and
``heat_run`` takes the episode. It goes through stages; between two of them it can be stored, and
what was run since the last is run again from the stored episodes, so a kill costs one episode.
"""

from collections import deque
from collections.abc import Callable, Generator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from eutree.arrays import Floats
from eutree.compression.candidates import merged, with_locks
from eutree.data import Episode
from eutree.interaction.seeding import Stream
from eutree.policies import TreePolicy
from eutree.policy_search.racing import FIRST_BLOCK, Race, halving, paired
from eutree.training.proposals import MOST_LEAVES, Proposals, SearchSettings, key
from eutree.training.variants import Advantages
from eutree.world_model import Transitions

ROUNDS = 3  # of proposals, at most
ROUND_SHARE = 0.25  # of the steps, for a round
NEWS = 0.05  # share of steps after which they are fitted anew
IDLE = 100  # of those tried, without a step: nothing is left to vary
STAGES = ("begin", "cut", "propose", "race", "prove", "vary", "end")
STARTS = 2**20  # of one block: more than ever run

Result = TypeVar("Result")
Running = Generator[tuple[TreePolicy, int], Episode, Result]  # yields what next_heat returns


@dataclass(frozen=True)
class SearchState:
    """Where a search stood between two stages.

    Attributes:
        stage: The stage that comes next.
        incumbent: The best tree so far.
        challengers: Those that are to run next.
        round: Rounds of proposals so far.
        block: Number of the present block of starts.
        limit: Steps that may be run until the end of the stage.
        tried: Challengers so far.
        won: How often one replaced the incumbent.
        idle: Variants since a step was last run.
        n_episodes: Episodes run so far.
        own: Numbers of the incumbent's episodes of the present block.
        fitted: Steps run, episodes run and chance when the advantages were fitted last.
        chance: State of the generator.
    """

    stage: str
    incumbent: TreePolicy
    challengers: tuple[TreePolicy, ...] = ()
    round: int = 0
    block: int = 0
    limit: int = 0
    tried: int = 0
    won: int = 0
    idle: int = 0
    n_episodes: int = 0
    own: tuple[int, ...] = ()
    fitted: tuple[int, int, dict[str, Any]] | None = None
    chance: dict[str, Any] | None = None


class PolicySearch:
    """One search.

    Args:
        policy: Where it starts. Its locked leaves stay as they are.
        data: What was stored in learning, with at least one episode.
        settings: How long, and for what.
        seed: Seed of all its chance but the episodes'.
        max_episode_steps: Steps after which the environment truncates; None if it never does.

    Attributes:
        state: Where it stood between the last two stages.
        episodes: All episodes run.
        steps: Their steps.
    """

    def __init__(
        self,
        policy: TreePolicy,
        data: Transitions,
        settings: SearchSettings,
        *,
        seed: int,
        max_episode_steps: int | None,
    ) -> None:
        self._settings = settings
        self._start = policy
        self._longest = data.longest() if max_episode_steps is None else max_episode_steps
        self._known_limit = max_episode_steps is not None
        self._generator = np.random.default_rng(np.random.SeedSequence((seed, Stream.PROPOSING)))
        self._proposals = Proposals(policy, data, settings, self._generator)
        self._max_leaves = self._proposals.max_leaves
        self.state = SearchState("begin", policy)
        self.steps = 0
        self.episodes: list[Episode] = []
        self._run: dict[bytes, list[int]] = {}  # numbers of each tree's episodes of the block
        self._stored: deque[Episode] = deque()  # run before, but after the stored state
        self._known: Advantages | None = None
        self._stages = self._go_on()
        self._heat: tuple[TreePolicy, int] | None = None
        self._answer: Episode | None = None
        self.finished = settings.steps == 0

    @property
    def incumbent(self) -> TreePolicy:
        """The best tree so far."""
        return self.state.incumbent

    @property
    def all_episodes(self) -> list[Episode]:
        """All episodes run, the one just taken and those yet to be taken up again included."""
        taken = [] if self._answer is None else [self._answer]
        return [*self.episodes, *taken, *self._stored]

    def next_heat(self) -> tuple[TreePolicy, int] | None:
        """Return the tree to run next, and the number of its start; None at the end."""
        if self.finished or self._heat is not None:
            return self._heat
        try:
            # A generator that has not begun is sent None.
            answer, self._answer = self._answer, None
            self._heat = self._stages.send(answer)  # type: ignore[arg-type]  # as said
        except StopIteration:
            self.finished = True
        return self._heat

    def heat_run(self, episode: Episode) -> None:
        """Take the episode that the tree of ``next_heat`` ran."""
        self._heat, self._answer = None, episode

    def restore(self, state: SearchState, episodes: Sequence[Episode]) -> None:
        """Go on, from the start, where another search of the same arguments stood."""
        kept = episodes[: state.n_episodes]
        self.episodes = list(kept)
        self.steps = sum(map(len, kept))
        if not self._known_limit:
            self._longest = max([self._longest, *map(len, kept)])
        self._stored = deque(episodes[state.n_episodes :])
        self._run = {key(state.incumbent): list(state.own)} if state.own else {}
        if state.fitted is not None:
            chance = np.random.default_rng()
            chance.bit_generator.state = state.fitted[2]
            self._known = self._proposals.advantages(kept[: state.fitted[1]], chance)
        if state.chance is not None:
            self._generator.bit_generator.state = state.chance
        self.state = state

    def _go_on(self) -> Running[None]:
        """Go through the stages; ``state`` changes at the end of each."""
        stages: dict[str, Callable[[SearchState], Running[SearchState]]] = {
            "begin": self._begin,
            "cut": self._cut,
            "propose": self._propose,
            "race": self._race,
            "prove": self._prove,
            "vary": self._vary,
        }
        while self.state.stage != "end":
            state = yield from stages[self.state.stage](self.state)
            self.state = replace(
                state,
                n_episodes=len(self.episodes),
                own=tuple(self._run.get(key(state.incumbent), ())),
                chance=deepcopy(dict(self._generator.bit_generator.state)),
            )

    def _begin(self, state: SearchState) -> Running[SearchState]:
        """Find smaller trees if the policy is too large."""
        policy = with_locks(merged(self._start), self._start)
        here = replace(state, stage="propose", incumbent=policy)
        if policy.n_leaves > self._max_leaves:
            rivals = self._proposals.pruned(policy)
            if policy.n_leaves <= MOST_LEAVES:
                rivals = [*self._proposals.planned(policy, self.episodes), *rivals]
            return self._with_challengers(here, "cut", rivals, 2 * ROUND_SHARE)
        yield from ()
        return here

    def _cut(self, state: SearchState) -> Running[SearchState]:
        """Take the winner of the smaller trees, whatever it earns."""
        winner = yield from self._winner(state)
        return replace(state, stage="propose", incumbent=winner)

    def _propose(self, state: SearchState) -> Running[SearchState]:
        """Let each model propose, and C4.5 prune."""
        rivals = list(self._proposals.planned(state.incumbent, self.episodes))
        if state.round == 0:
            rivals += self._proposals.pruned(state.incumbent)
        yield from ()
        proposed = self._with_challengers(state, "race", rivals, ROUND_SHARE)
        return proposed if proposed.challengers else self._before_varying(state)

    def _race(self, state: SearchState) -> Running[SearchState]:
        """Find the best of the proposed."""
        winner = yield from self._winner(state)
        self._run.clear()
        return replace(
            state,
            stage="prove",
            challengers=(winner,),
            block=state.block + 1,
            limit=self._settings.steps,
        )

    def _prove(self, state: SearchState) -> Running[SearchState]:
        """Let it replace the incumbent if it earns clearly more on other starts."""
        policy, rival = state.incumbent, state.challengers[0]
        better = yield from self._better(state, rival, of_many=False)
        if better is None:
            better = self._proposals.prefer(policy, rival, self.episodes)
        if not better:
            return self._before_varying(state)
        won = replace(state, incumbent=rival, won=state.won + 1, round=state.round + 1)
        if won.round >= ROUNDS:
            return self._before_varying(won)
        return replace(won, stage="propose", challengers=())

    def _before_varying(self, state: SearchState) -> SearchState:
        self._run.clear()
        fitted = self._fit_advantages()
        return replace(
            state,
            stage="vary",
            challengers=(),
            block=state.block + 1,
            limit=self._settings.steps,
            fitted=fitted,
        )

    def _vary(self, state: SearchState) -> Running[SearchState]:
        """Try one random change of the incumbent, the most promising of several."""
        policy = state.incumbent
        own = None
        if state.idle < IDLE:
            own = yield from self._episodes_of(state, policy, range(FIRST_BLOCK))
        if own is None or state.fitted is None or self._known is None:
            return replace(state, stage="end")
        if self.steps > state.fitted[0] + NEWS * self._settings.steps:
            state = replace(state, fitted=self._fit_advantages())
        steps, state = self.steps, replace(state, idle=state.idle + 1)
        rival = self._proposals.promising(policy, own, self._known)
        if rival is None:
            return state
        state = replace(state, tried=state.tried + 1)
        better = yield from self._better(state, rival, of_many=True)
        idle = 0 if self.steps > steps else state.idle
        if not better:
            self._run.pop(key(rival), None)
            return replace(state, idle=idle)
        self._run.clear()
        return replace(state, idle=idle, incumbent=rival, won=state.won + 1, block=state.block + 1)

    def _with_challengers(
        self, state: SearchState, stage: str, rivals: Sequence[TreePolicy], share: float
    ) -> SearchState:
        """Return the state before a race of those that differ, for a share of the steps."""
        distinct = {key(rival): rival for rival in rivals if rival.n_leaves <= self._max_leaves}
        distinct.pop(key(state.incumbent), None)
        if not distinct:
            return state
        self._run.clear()
        return replace(
            state,
            stage=stage,
            challengers=tuple(distinct.values()),
            block=state.block + 1,
            limit=min(self._settings.steps, self.steps + int(share * self._settings.steps)),
            tried=state.tried + len(distinct),
        )

    def _winner(self, state: SearchState) -> Running[TreePolicy]:
        trees = state.challengers
        affordable = (state.limit - self.steps) // (2 * self._longest * len(trees))
        race = halving(
            [tree.n_leaves for tree in trees],
            leaf_price=self._proposals.leaf_price,
            first=int(np.clip(affordable, 1, FIRST_BLOCK)),
            block=state.block,
        )
        return trees[(yield from self._drive(race, state, trees))]

    def _better(
        self, state: SearchState, rival: TreePolicy, *, of_many: bool
    ) -> Running[bool | None]:
        """Return whether a challenger earns clearly more, and succeeds as often if it must."""
        trees = (state.incumbent, rival)
        saved = self._proposals.leaf_price * (trees[0].n_leaves - rival.n_leaves)
        race = paired(saved, of_many=of_many, block=state.block)
        better = yield from self._drive(race, state, trees)
        if better and self._settings.keep_success and self._succeeds_less(*trees):
            return False
        return better

    def _succeeds_less(self, policy: TreePolicy, rival: TreePolicy) -> bool:
        """Return whether a challenger failed more of the starts that both ran."""
        both = zip(self._run[key(policy)], self._run[key(rival)], strict=False)
        pairs = [(self.episodes[own], self.episodes[other]) for own, other in both]
        return sum(bool(other.is_success) - bool(own.is_success) for own, other in pairs) < 0

    def _drive(
        self, race: Race[Result], state: SearchState, trees: Sequence[TreePolicy]
    ) -> Running[Result]:
        """Run the heats of a race; the budget may end before it does."""
        returns: Floats | None = None
        try:
            heat = next(race)
            while True:
                run = yield from self._episodes_of(state, trees[heat.runner], heat.episodes)
                returns = None if run is None else np.array([e.undiscounted_return for e in run])
                heat = race.send(returns)
        except StopIteration as end:
            result: Result = end.value
            return result

    def _episodes_of(
        self, state: SearchState, tree: TreePolicy, numbers: range
    ) -> Running[list[Episode] | None]:
        """Return a tree's episodes from some starts of the block; None if steps are short."""
        mine = self._run.setdefault(key(tree), [])
        while len(mine) < numbers.stop:
            number = self._known_episode(tree, len(mine))
            if number is None:
                if self.steps + self._longest > state.limit:
                    return None
                number = yield from self._new_episode(tree, state.block * STARTS + len(mine))
            mine.append(number)
        return [self.episodes[number] for number in mine[numbers.start : numbers.stop]]

    def _known_episode(self, tree: TreePolicy, start: int) -> int | None:
        """Return the episode as another tree ran it, if this one decides the same throughout."""
        for run in self._run.values():
            if len(run) > start:
                episode = self.episodes[run[start]]
                rows = episode.observations[:-1]
                if np.array_equal(tree.actions[tree.tree.leaf_index(rows)], episode.actions):
                    return run[start]
        return None

    def _new_episode(self, tree: TreePolicy, start: int) -> Running[int]:
        episode = self._stored.popleft() if self._stored else (yield tree, start)
        self.steps += len(episode)
        if not self._known_limit:
            self._longest = max(self._longest, len(episode))
        self.episodes.append(episode)
        return len(self.episodes) - 1

    def _fit_advantages(self) -> tuple[int, int, dict[str, Any]]:
        """Fit what recorded steps gained; return what it takes to fit the same again."""
        chance = deepcopy(dict(self._generator.bit_generator.state))
        self._known = self._proposals.advantages(self.episodes, self._generator)
        return self.steps, len(self.episodes), chance
