"""Plan, evaluate online, adopt: how improvements in a world model become the policy.

After a gathering phase two trees are planned. The *challenger* is planned in a pessimistic world
model; it acts in some episodes, without exploration, and becomes the *incumbent*, the policy, when
the model still prefers it with their transitions known and the returns that it really earned do not
speak against it. The *explorer* is planned in an optimistic model; where it is wrong it finds out
what the model did not know. The incumbent never changes without an online evaluation.
"""

from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.contests import AheadApart, Table, Verdict, new_table
from eutree.contests.rules import lead_apart
from eutree.policy_search.climbing import luckiest, restarts
from eutree.policy_search.improvement import Improvement
from eutree.validation import check_amounts, check_measures, check_number
from eutree.world_model import ActionTree, PairedRollouts, Transitions, WorldModel, fit_world_models
from eutree.world_model.action_trees import n_leaves, packed
from eutree.world_model.transitions import earned_nothing, paid_for_places, reached_nothing

FEWEST_ROLLOUTS = 100  # episodes
_FEW_OWN = 10  # episodes
_EXPLORED = 20  # episodes of explorers that are remembered
_FIRST_LEAVES = 10  # of trees made of lucky episodes
_CLEARLY = 3.0  # standard errors
_FEW_TRIED = 5  # episodes


@dataclass(frozen=True, eq=False)
class Planned:
    """The trees by which a planning learner acts."""

    incumbent: ActionTree  # the policy
    challenger: ActionTree | None = None  # evaluated online to replace it, while one is better
    explorer: ActionTree | None = None  # acts to find out; None before the first planning
    corrected: ActionTree | None = None  # from the demonstrations, for the next planning to begin
    incumbent_episodes: tuple[int, ...] = ()  # in which it acted without exploration
    challenger_episodes: tuple[int, ...] = ()  # in which challengers did, since the last adoption
    explorer_episodes: tuple[int, ...] = ()  # the latest in which explorers acted
    planned_at: int = 0  # transitions seen at the last planning
    demonstrations: int = 0  # how many of the first episodes are demonstrations that still count
    valid_from: int = 0  # first episode of world models: since those before the dynamics changed
    model_steps: int = 0  # taken in world models by the last planning

    @property
    def evaluated(self) -> ActionTree:
        """The challenger, or the incumbent while there is none."""
        return self.incumbent if self.challenger is None else self.challenger

    @property
    def knows_nothing(self) -> bool:
        """Whether the policy is a single action still, and nobody has shown another."""
        return n_leaves(self.incumbent) == 1 and not self.demonstrations

    def with_episode(self, episode: int, *, incumbent: bool = False) -> "Planned":
        """Return the plan after an episode of ``evaluated``, or of the incumbent in its place."""
        if incumbent or self.challenger is None:
            return replace(self, incumbent_episodes=(*self.incumbent_episodes, episode))
        return replace(self, challenger_episodes=(*self.challenger_episodes, episode))

    def with_explored(self, episode: int) -> "Planned":
        """Return the plan after an episode of the explorer."""
        return replace(self, explorer_episodes=(*self.explorer_episodes, episode)[-_EXPLORED:])

    def with_adopted(self, episodes: tuple[int, ...]) -> "Planned":
        """Return the plan with the challenger as incumbent; these episodes are evidence on it."""
        return replace(
            self,
            incumbent=self.evaluated,
            challenger=None,
            incumbent_episodes=episodes,
            challenger_episodes=(),
        )

    @property
    def own_episodes(self) -> tuple[int, ...]:
        """The incumbent's episodes without the demonstrations, in which others acted."""
        return tuple(n for n in self.incumbent_episodes if n >= self.demonstrations)

    def keeping(self, episodes: Integers) -> "Planned":
        """Return the plan when all but these episodes, ascending, are forgotten.

        Those that are left are numbered from 0, as their places in ``episodes`` are.
        """
        place = {number: new for new, number in enumerate(episodes.tolist())}

        def kept(numbers: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(place[number] for number in numbers if number in place)

        return replace(
            self,
            incumbent_episodes=kept(self.incumbent_episodes),
            challenger_episodes=kept(self.challenger_episodes),
            explorer_episodes=kept(self.explorer_episodes),
            demonstrations=int(np.searchsorted(episodes, self.demonstrations)),
            valid_from=int(np.searchsorted(episodes, self.valid_from)),
        )


@dataclass(frozen=True, kw_only=True)
class Planner:
    """The choices of planning in a world model.

    Attributes:
        n_episodes: Rollouts that judge each change, at most.
        n_steps: Steps of these episodes together, about: fewer episodes where they are long, so
            that planning costs as much whatever their length; at least 100 episodes.
        n_explorer_episodes: Rollouts that judge each change of the explorer, at most: its actions
            need not be good, they have to be different where that may pay.
        improvement: How trees are improved.
        explorer_share: Share of the gathered episodes in which the explorer acts.
        pessimism: Share of the unknown that counts as fatal in the challenger's world model.
        optimism: Share of the unknown that counts as fatal in the explorer's world model.
        min_episodes: Fewest episodes of an online evaluation.
        trial_steps: Steps after which that is over with fewer episodes, but for at least five.
        memory: Most recent episodes of a policy that count in an online evaluation.
        growth: Plan again when the history has grown by this factor.
        max_transitions: Most recent transitions a world model is fitted to.
        discount: gamma of rollouts.
        incumbent_first: In runs from demonstrations, until the incumbent has so many episodes, it
            acts in the challenger's place whenever it has no more than the challenger: one that was
            adopted after five lucky episodes would else stay a bar that no challenger passes.
        trust_demonstrations: Whether demonstrations count as the incumbent's own episodes: if it
            has played them itself. Those of others are no evidence on it.
    """

    n_episodes: int = 1000
    n_steps: int = 50_000
    n_explorer_episodes: int = 300
    improvement: Improvement = Improvement()
    explorer_share: float = 0.3
    pessimism: float = 0.99
    optimism: float = 0.4
    min_episodes: int = 30
    trial_steps: int = 4000
    memory: int = 60
    growth: float = 1.06
    max_transitions: int = 50_000
    discount: float = 1.0
    incumbent_first: int = 30
    trust_demonstrations: bool = False

    def __post_init__(self) -> None:
        check_amounts(self, n_episodes=8, n_steps=1, n_explorer_episodes=8, min_episodes=2)
        check_amounts(self, trial_steps=1, memory=2, max_transitions=1, incumbent_first=0)
        check_number("explorer_share", self.explorer_share, low=0.0, high=1.0)
        check_measures(self, "pessimism optimism", low=0.0, high=1.0, low_open=True, high_open=True)
        check_number("growth", self.growth, low=1.0)
        check_number("discount", self.discount, low=0.0, high=1.0)

    def incumbent_acts(self, plan: Planned) -> bool:
        """Return whether too little is known of the incumbent: it acts in a challenger's place."""
        known = len(self._evidence(plan))
        if not plan.demonstrations:
            return False
        return known < self.incumbent_first and known <= len(plan.challenger_episodes)

    def _evidence(self, plan: Planned) -> tuple[int, ...]:
        return plan.incumbent_episodes if self.trust_demonstrations else plan.own_episodes

    def due(self, plan: Planned, n_seen: int) -> bool:
        """Return whether enough transitions were seen to plan again."""
        return n_seen > plan.planned_at * self.growth

    def plan(
        self,
        plan: Planned,
        data: Transitions,
        generator: np.random.Generator,
        n_seen: int | None = None,
    ) -> Planned:
        """Return the next plan: adopt the challenger or not, then plan both trees.

        ``n_seen`` is how many transitions there were ever; None if all are remembered.
        """
        n_new = (len(data.episodes) if n_seen is None else n_seen) - plan.planned_at
        plan = self._without_invalid(plan, data, generator)
        known = data.since(plan.valid_from).recent(self.max_transitions)
        unshown = not plan.demonstrations and not known.counted
        if unshown and earned_nothing(data):
            return self._curious(plan, known, generator)
        levels, most = (self.pessimism, self.optimism), (self.n_episodes, self.n_explorer_episodes)
        pessimistic, optimistic = self._rollouts(known, levels, most, generator)
        scale = known.typical_return
        if (tried := plan.challenger) is not None:
            begun = int(np.searchsorted(np.flatnonzero(data.first), len(data.episodes) - n_new))
            plan = self._without_reckless(plan, begun, data.episode_returns)
            won = self._won_alone(plan, data, begun)
            if not won and self._deserves(plan, tried, data, pessimistic):
                won = plan.challenger_episodes[-self.memory :]
            plan = plan.with_adopted(won) if won else plan
        explorer: ActionTree | None
        guide: ActionTree | None
        if known.counted:
            explorer, guide = self._by_counts(known, pessimistic)
        else:
            base = plan.corrected or plan.explorer or plan.incumbent
            explorer = self.improvement.improve(optimistic, base, scale, begin=plan.knows_nothing)
            guide = explorer if self._explorers_lead(plan, data) else None
        challenger = self._challenger(replace(plan, explorer=guide), known, pessimistic)
        taken = pessimistic.n_steps_taken + optimistic.n_steps_taken
        if unshown and plan.knows_nothing and reached_nothing(data):
            curious = self._curious(plan, known, generator)
            explorer, taken = curious.explorer, taken + curious.model_steps
        return replace(
            plan, challenger=challenger, explorer=explorer, corrected=None, model_steps=taken
        )

    def _without_invalid(
        self, plan: Planned, data: Transitions, generator: np.random.Generator
    ) -> Planned:
        """Return the plan without the demonstrations if they show nothing, or no longer the task.

        Nothing is shown where nobody has come by anything yet. And if the dynamics have changed
        since, the incumbent earns much less than was shown. A poor tree does so too, but in the
        world as it was shown as well: imagined there, its return is nearer to the real one.
        """
        n, own, returns = plan.demonstrations, plan.own_episodes, data.episode_returns
        if n and own and earned_nothing(data):
            return replace(plan, incumbent_episodes=own, demonstrations=0)
        shown, earned = returns[:n][~data.stopped[:n]], returns[list(own)]
        lead = lead_apart(earned, shown)
        if not shown.size or len(own) < _FEW_OWN or lead.mean <= _CLEARLY * lead.error:
            return plan
        as_shown = data.until(int(np.searchsorted(data.episodes, n)))
        (world,) = _worlds(as_shown, (self.optimism,))
        imagined = PairedRollouts(world, self.n_explorer_episodes, 1.0, generator)
        imagined.redraw()
        imagined.run(plan.incumbent)
        return_there = imagined.mean_return
        if abs(return_there - earned.mean()) <= abs(return_there - shown.mean()):
            return plan
        return replace(plan, incumbent_episodes=own, demonstrations=0, valid_from=n)

    def _curious(
        self, plan: Planned, known: Transitions, generator: np.random.Generator
    ) -> Planned:
        """Return the plan with an explorer of what was seldom visited, and no challenger."""
        paid, most = paid_for_places(known), self.n_explorer_episodes
        (hopeful,) = self._rollouts(paid, (self.optimism,), (most,), generator)
        base = plan.explorer or plan.incumbent
        explorer = self.improvement.improve(hopeful, base, paid.typical_return, begin=True)
        steps = hopeful.n_steps_taken
        return replace(plan, challenger=None, explorer=explorer, corrected=None, model_steps=steps)

    def imagined(
        self, plan: Planned, data: Transitions, n_episodes: int, generator: np.random.Generator
    ) -> PairedRollouts:
        """Return where trees can be compared in the world as it is known, without hope."""
        known = data.since(plan.valid_from).recent(self.max_transitions)
        return self._rollouts(known, (self.pessimism,), (n_episodes,), generator)[0]

    def _rollouts(
        self,
        known: Transitions,
        levels: tuple[float, ...],
        most: tuple[int, ...],
        generator: np.random.Generator,
    ) -> list[PairedRollouts]:
        """Return where trees are planned: for each level of pessimism, at most so many episodes."""
        affordable = self._affordable(known)
        return [
            PairedRollouts(model, min(affordable, n), self.discount, generator)
            for model, n in zip(_worlds(known, levels), most, strict=True)
        ]

    def _by_counts(
        self, known: Transitions, rollouts: PairedRollouts
    ) -> tuple[ActionTree, ActionTree]:
        """Return an explorer, of what was seldom tried, and what is best, cut to size."""
        from eutree.policy_search import cells  # and a solver: few runs count

        rollouts.redraw()
        rollouts.run(cells.best_by_counts(known, self.discount))
        self.improvement.of_codes().cut(rollouts)
        return cells.curious_by_counts(known), rollouts.policy

    def _affordable(self, data: Transitions) -> int:
        """Return how many rollouts to make, were they as long as the stored ones."""
        fewest = min(FEWEST_ROLLOUTS, self.n_episodes)
        return int(np.clip(self.n_steps / data.mean_length, fewest, self.n_episodes))

    def _won_alone(self, plan: Planned, data: Transitions, begun: int) -> tuple[int, ...]:
        """Return the episodes that put the challenger in the place of an unknown action, if any do.

        They are its own, from ``begun`` on, and clearly ahead: over a single action that nobody has
        shown, the model is not asked.
        """
        if not plan.knows_nothing:
            return ()
        own = tuple(n for n in plan.challenger_episodes[-self.memory :] if n >= begun)
        clear = AheadApart(enough=len(own) + 1)
        return own if self._ahead(plan, own, data, clear) else ()

    def _without_reckless(self, plan: Planned, begun: int, returns: Floats) -> Planned:
        """Return the plan without the challengers before the present one if they were reckless.

        They earned clearly less than the incumbent, and than the present one in its own episodes,
        those from ``begun`` on. What the first loses, who knew least, would else keep out all that
        come after it.
        """
        own = tuple(n for n in plan.challenger_episodes if n >= begun)
        if len(own) < _FEW_TRIED or not plan.demonstrations:
            return plan
        before = returns[list(plan.challenger_episodes[: -len(own) or None])]
        better = (lead_apart(before, returns[list(one)]) for one in (own, self._evidence(plan)))
        clearly = all(lead.mean > _CLEARLY * lead.error for lead in better)
        return replace(plan, challenger_episodes=own) if clearly else plan

    def _deserves(
        self, plan: Planned, challenger: ActionTree, data: Transitions, pessimistic: PairedRollouts
    ) -> bool:
        """Return whether real returns prefer the challenger, and the model does too."""
        tried = plan.challenger_episodes[-self.memory :]
        steps = data.episode_lengths[list(tried)].sum()
        enough = min(self.min_episodes, len(tried)) if steps >= self.trial_steps else None
        if not self._ahead(plan, tried, data, AheadApart(enough=enough or self.min_episodes)):
            return False
        pessimistic.run(plan.incumbent)
        gain = pessimistic.gain(challenger)
        return gain.mean > gain.error

    def _ahead(
        self, plan: Planned, tried: tuple[int, ...], data: Transitions, rule: AheadApart
    ) -> bool:
        table = self._against_incumbent(plan, tried, data.episode_returns)
        return isinstance(rule.next(table), Verdict)

    def _explorers_lead(self, plan: Planned, data: Transitions) -> bool:
        """Return whether the last explorers earned more than the incumbent, random actions and all.

        Then they are past the valleys that single changes cannot cross, and a challenger is
        planned from there too. Where the incumbent is good that would cost time for nothing. It
        always is where nobody has shown anything.
        """
        if not plan.demonstrations:
            return True
        return self._ahead(plan, plan.explorer_episodes, data, AheadApart(clearly=0.0))

    def _against_incumbent(self, plan: Planned, tried: tuple[int, ...], returns: Floats) -> Table:
        """Return the returns of the incumbent's episodes and of others, a row each."""
        recent = self._evidence(plan)[-3 * self.memory :]
        # Where the incumbent has no episodes, those of no challenger are evidence on it.
        known = recent or sorted(set(range(returns.size)) - set(plan.challenger_episodes))
        table = new_table(2, max(len(tried), len(known)))
        table[0, : len(known)] = returns[list(known)]
        table[1, : len(tried)] = returns[list(tried)]
        return table

    def _challenger(
        self, plan: Planned, known: Transitions, pessimistic: PairedRollouts
    ) -> ActionTree | None:
        """Return the best of incumbent, last challenger, corrected incumbent and explorer.

        Each is improved before. The explorer, if it leads, was planned with hope, and so it is past
        the valleys that single changes cannot cross; the pessimist takes back all that was only
        hoped for. None if none of them is better than the incumbent.

        A single action may be where all single changes cost something. Then trees of the episodes
        that happened to earn most are improved too. One that was shown is so once it has played for
        a while, and then each action everywhere is improved as well; if nobody has shown it and the
        model prefers nothing, the tree of such an episode is on trial as it is.
        """
        begin, scale = plan.knows_nothing, known.typical_return
        improvement = self.improvement.of_codes() if known.counted else self.improvement
        best = improvement.improve(pessimistic, plan.incumbent, scale, begin=begin)
        bases = [plan.challenger, plan.corrected, plan.explorer]
        if n_leaves(best) == 1 and (begin or _has_shown_all(plan)):
            bases += [] if begin else map(packed, range(known.n_actions))
            bases += restarts(known, max_leaves=_FIRST_LEAVES)
        for base in filter(None, bases):
            challenger = improvement.improve(pessimistic, base, scale, begin=begin)
            pessimistic.redraw()
            pessimistic.run(best)
            if pessimistic.gain(challenger).mean > 0.0:
                best = challenger
        pessimistic.redraw()
        pessimistic.run(plan.incumbent)
        gain = pessimistic.gain(best)
        if gain.mean > gain.error:
            return best
        lucky = luckiest(known, pessimistic.generator, max_leaves=_FIRST_LEAVES) if begin else None
        is_new = lucky is not None and not np.array_equal(lucky.action, plan.incumbent.action)
        return lucky if is_new else None


def _has_shown_all(plan: Planned) -> bool:
    """Return whether a single action that was shown has played for long enough to be known."""
    return n_leaves(plan.incumbent) == 1 and len(plan.own_episodes) >= _FEW_OWN


def _worlds(known: Transitions, levels: tuple[float, ...]) -> tuple[WorldModel, ...]:
    """Return a world model for each level of pessimism; one that counts has none."""
    if known.counted:
        from eutree.world_model import fit_counted_world

        one = fit_counted_world(known)
        tallies = np.zeros((len(levels), *one.world.tally.shape), dtype=np.int64)
        return tuple(replace(one, world=one.world._replace(tally=tally)) for tally in tallies)
    return fit_world_models(known, levels)
