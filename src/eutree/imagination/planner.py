"""Plan, try, adopt: how imagined improvements become the policy.

After a gathering phase two trees are planned. The *candidate* is planned in a pessimistic world
model; it acts in some episodes, without exploration, and becomes the policy when imagination still
prefers it with their transitions known and the returns that it really earned do not speak against
it. The *explorer* is planned in an optimistic one; where it is wrong it finds out what the model
did not know. The policy itself never changes without a trial.
"""

from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.imagination._kernels import ActionTree
from eutree.imagination.improvement import Improvement
from eutree.imagination.rehearsal import Rehearsal
from eutree.imagination.transitions import Transitions
from eutree.imagination.world_model import fit_world_models
from eutree.validation import check_integer, check_number

FEWEST_IMAGINED = 100  # episodes
_SHORTEST_TRIAL = 5  # episodes
_FEW_OWN = 10  # episodes
_CLEARLY = 3.0  # standard errors


@dataclass(frozen=True, eq=False)
class Plan:
    """What a learner with imagination acts by.

    Attributes:
        policy: The policy.
        candidate: What is on trial to become it; None while there is nothing better.
        explorer: What acts to find out; None before the first planning.
        proved: Episodes in which the policy acted without exploration.
        tried: Episodes in which candidates did, since the policy was adopted.
        taught: What a person has shown since the last planning, as a tree to begin from; None if
            nothing was.
        helped: Episodes in which somebody showed what to do: nobody's merit.
        planned_at: Number of transitions seen at the last planning.
        demonstrations: How many of the first episodes are demonstrations that still count.
        outdated: First episode that world models are fitted to; those before are of another world.
    """

    policy: ActionTree
    candidate: ActionTree | None = None
    explorer: ActionTree | None = None
    taught: ActionTree | None = None
    proved: tuple[int, ...] = ()
    tried: tuple[int, ...] = ()
    helped: tuple[int, ...] = ()
    planned_at: int = 0
    demonstrations: int = 0
    outdated: int = 0

    @property
    def on_trial(self) -> ActionTree:
        """The candidate, or the policy while there is none."""
        return self.policy if self.candidate is None else self.candidate

    def with_episode(self, episode: int) -> "Plan":
        """Return the plan after ``on_trial`` acted in an episode without exploration."""
        if self.candidate is None:
            return replace(self, proved=(*self.proved, episode))
        return replace(self, tried=(*self.tried, episode))

    def keeping(self, episodes: Integers) -> "Plan":
        """Return the plan when all but these episodes, ascending, are forgotten.

        Those that are left are numbered from 0, as their places in ``episodes`` are.
        """
        place = {number: new for new, number in enumerate(episodes.tolist())}
        return replace(
            self,
            proved=tuple(place[number] for number in self.proved if number in place),
            tried=tuple(place[number] for number in self.tried if number in place),
            helped=tuple(place[number] for number in self.helped if number in place),
            demonstrations=int(np.searchsorted(episodes, self.demonstrations)),
            outdated=int(np.searchsorted(episodes, self.outdated)),
        )


@dataclass(frozen=True, kw_only=True)
class Imagination:
    """Planning in imagination, as a choice of the learner's settings.

    Attributes:
        n_episodes: Imagined episodes that judge each change, at most.
        n_steps: Steps of these episodes together, about: fewer episodes where they are long, so
            that planning costs as much whatever their length; at least 100 episodes.
        n_explorer_episodes: The same for the explorer, at most: what it does need not be good, it
            has to be different where that may pay.
        improvement: How trees are improved.
        explorer_share: Share of the gathered episodes in which the explorer acts.
        pessimism: Share of what is unknown that counts as fatal in the candidate's world model.
        optimism: The same in the explorer's; smaller.
        min_trial: Fewest episodes of a trial.
        memory: Most recent trial episodes that count.
        growth: Plan again when the history has grown by this factor.
        max_transitions: Most recent transitions a world model is fitted to.
        discount: gamma of imagined episodes.
    """

    n_episodes: int = 1000
    n_steps: int = 50_000
    n_explorer_episodes: int = 300
    improvement: Improvement = Improvement()
    explorer_share: float = 0.3
    pessimism: float = 0.99
    optimism: float = 0.4
    min_trial: int = 30
    memory: int = 60
    growth: float = 1.06
    max_transitions: int = 50_000
    discount: float = 1.0

    def __post_init__(self) -> None:
        check_integer("n_episodes", self.n_episodes, low=8)
        check_integer("n_steps", self.n_steps, low=1)
        check_integer("n_explorer_episodes", self.n_explorer_episodes, low=8)
        check_number("explorer_share", self.explorer_share, low=0.0, high=1.0)
        for name in ("pessimism", "optimism"):
            check_number(
                name, getattr(self, name), low=0.0, high=1.0, low_open=True, high_open=True
            )
        check_integer("min_trial", self.min_trial, low=2)
        check_integer("memory", self.memory, low=2)
        check_number("growth", self.growth, low=1.0)
        check_integer("max_transitions", self.max_transitions, low=1)
        check_number("discount", self.discount, low=0.0, high=1.0)

    def due(self, plan: Plan, n_seen: int) -> bool:
        """Return whether enough transitions were seen to plan again."""
        return n_seen > plan.planned_at * self.growth

    def plan(self, plan: Plan, data: Transitions, generator: np.random.Generator) -> Plan:
        """Return the next plan: adopt the candidate or not, then plan both trees anew."""
        plan = _without_outdated(plan, data.episode_returns)
        known = data.since(plan.outdated).recent(self.max_transitions)
        n_episodes = self._affordable(known)
        n_explorer_episodes = min(n_episodes, self.n_explorer_episodes)
        pessimist, optimist = fit_world_models(known, (self.pessimism, self.optimism))
        sober = Rehearsal(pessimist, n_episodes, self.discount, generator)
        hopeful = Rehearsal(optimist, n_explorer_episodes, self.discount, generator)
        scale = known.typical_return
        if plan.candidate is not None and self._deserves(plan, plan.candidate, data, sober):
            proved = plan.tried[-self.memory :]
            plan = replace(plan, policy=plan.candidate, candidate=None, proved=proved, tried=())
        begin = plan.taught or plan.explorer or plan.policy
        explorer = self.improvement.improve(hopeful, begin, scale)
        candidate = self._candidate(plan, sober, scale)
        return replace(plan, candidate=candidate, explorer=explorer, taught=None)

    def _affordable(self, data: Transitions) -> int:
        """Return how many episodes to imagine, were they as long as the stored ones."""
        fewest = min(FEWEST_IMAGINED, self.n_episodes)
        return int(np.clip(self.n_steps / data.mean_length, fewest, self.n_episodes))

    def _deserves(
        self, plan: Plan, candidate: ActionTree, data: Transitions, sober: Rehearsal
    ) -> bool:
        """Return whether imagination prefers the candidate and reality does not object."""
        returns = data.episode_returns  # [E]
        tried = returns[list(plan.tried[-self.memory :])]
        known = plan.proved[-3 * self.memory :] or _others(plan, returns.size)
        proved = returns[list(known)]
        if tried.size < _SHORTEST_TRIAL or not proved.size:
            return False
        if tried.size < self.min_trial and not _clearly_better(tried, proved):
            return False
        if tried.mean() <= proved.mean():
            return False
        sober.rehearse(plan.policy)
        gain = sober.gain(candidate)
        return gain.mean > gain.error

    def _candidate(self, plan: Plan, sober: Rehearsal, scale: float) -> ActionTree | None:
        """Return the best of policy, last candidate and what was taught, each improved.

        None if none of them is better than the policy.
        """
        best = self.improvement.improve(sober, plan.policy, scale)
        for begin in (plan.candidate, plan.taught):
            if begin is None:
                continue
            rival = self.improvement.improve(sober, begin, scale)
            sober.reshuffle()
            sober.rehearse(best)
            if sober.gain(rival).mean > 0.0:
                best = rival
        sober.reshuffle()
        sober.rehearse(plan.policy)
        gain = sober.gain(best)
        return best if gain.mean > gain.error else None


def _without_outdated(plan: Plan, returns: Floats) -> Plan:
    """Return the plan without the demonstrations, if the policy does much worse than they did."""
    n = plan.demonstrations
    own = [episode for episode in plan.proved if episode >= n]
    shown, earned = returns[:n], returns[own]
    if not n or len(own) < _FEW_OWN or not _clearly_better(shown, earned):
        return plan
    return replace(plan, proved=tuple(own), demonstrations=0, outdated=n)


def _others(plan: Plan, n_episodes: int) -> tuple[int, ...]:
    """Return the episodes that are not of the trial: what an untested policy is compared with."""
    return tuple(sorted(set(range(n_episodes)) - set(plan.tried) - set(plan.helped)))


def _clearly_better(tried: Floats, proved: Floats) -> bool:
    """Return whether few episodes are enough: a difference of several standard errors."""
    error = np.sqrt(tried.var() / tried.size + proved.var() / proved.size)
    return bool(tried.mean() - proved.mean() > _CLEARLY * error)
