"""Play trees: every episode is counted and kept, with the leaves that decided in it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.contests import Halving, SmallestWithin, hold, new_table
from eutree.data import Demonstrations, Episode
from eutree.data.demonstrations import lessons
from eutree.evaluation import Evaluation
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.episode import Stream
from eutree.learners import ModelPlanning, PlanningMethod
from eutree.learners.starts import shown_in
from eutree.policies import TreePolicy
from eutree.policy_search.planner import Planner
from eutree.training import Run, learn
from eutree.trees.edit import graft, merge

TIE = 1e-9  # of a success: the worth of a unit of return beside it
Progress = Callable[[str, int, int], None]  # the purpose, episodes played for it, at most so many
_FREE = C45Settings(use_penalty=False, prune=False, collapse=False, use_min_split=False)
MOST_KNOWN = 20_000  # steps of the tree's own play that practice begins with


@dataclass(frozen=True, eq=False)
class Played:
    """Episodes that a tree has played."""

    policy: TreePolicy  # the tree that played
    episodes: tuple[Episode, ...]  # its episodes, at least one

    @property
    def evaluation(self) -> Evaluation:
        """The same as figures."""
        return Evaluation.of(self.episodes, self.policy.n_leaves)

    @property
    def worths(self) -> Floats:
        """The worth of each episode, [E]: success where it is known, among equals the return."""
        return np.array(
            [bool(one.is_success) + TIE * one.undiscounted_return for one in self.episodes]
        )

    def failed(self, enough: float) -> Booleans:
        """Return which episodes failed, [E]; without successes, which earned too little."""
        figures = self.evaluation
        return figures.returns < enough if figures.successes is None else ~figures.successes

    def leaves(self) -> list[Integers]:
        """Return the leaf that decided at each step of each episode."""
        tree, features = self.policy.tree, self.policy.features
        seen = [episode.with_features(features).observations[:-1] for episode in self.episodes]
        return [tree.leaf_index(rows).astype(np.int64) for rows in seen]

    def followed_by(self, more: "Played") -> "Played":
        """Return both plays of one tree together."""
        return replace(self, episodes=self.episodes + more.episodes)


class Player:
    """Plays trees in one environment and counts every episode.

    The episodes of a block, made of the seed, are the same for every tree.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], seed: int, on_progress: Progress | None = None
    ) -> None:
        self.world = env  # unguarded: evaluate looks whether many copies can run side by side
        self._env, self._seed = GuardedEnv(env), seed
        self.on_progress = on_progress  # told after each episode
        self.episodes = 0  # played so far
        self.begin("playing", 1)

    def begin(self, stage: str, most: int) -> None:
        """Set the purpose of the next episodes, and how many there may be of them."""
        self._stage, self._most, self._before = stage, most, self.episodes

    def play(self, policy: TreePolicy, episodes: int, block: int, *, first: int = 0) -> Played:
        """Return the play of a tree in so many episodes of a block, from the ``first`` one on.

        Raises:
            EnvironmentFault: The environment broke its contract.
        """
        seed = episode_seed(self._seed, block, Stream.FITTING)
        played = []
        for number in range(first, first + episodes):
            played.append(run_episode(self._env, policy, episode_seed(seed, number)))
            self._count(1)
        return Played(policy, tuple(played))

    def _count(self, episodes: int) -> None:
        self.episodes += episodes
        if self.on_progress is not None:
            count = self.episodes - self._before
            self.on_progress(self._stage, count, max(count, self._most))

    def contest(self, rule: Halving, trees: Sequence[TreePolicy], block: int) -> tuple[int, Played]:
        """Return the number of the winner, the first of equals, and its play."""
        winner, plays = contest(rule, [(self, tree) for tree in trees], block)
        return winner, plays[winner]


def contest(
    rule: Halving | SmallestWithin, entrants: Sequence[tuple[Player, TreePolicy]], block: int
) -> tuple[int, dict[int, Played]]:
    """Return the number of the winner, the first of equals, and the plays of those that played."""
    plays: dict[int, Played] = {}

    def run(tree: int, starts: Sequence[int]) -> Floats:
        player, policy = entrants[tree]
        more = player.play(policy, len(starts), block, first=starts[0])
        plays[tree] = plays[tree].followed_by(more) if tree in plays else more
        return more.worths

    return hold(rule, new_table(len(entrants), rule.most), run).winner, plays


def blame(played: Played, failed: Booleans) -> Floats:
    """Return how much each leaf has to do with failing, shape [L].

    The share of the ``failed`` episodes [E] in which it decided last, and by how much more of them
    than of the others it decided in at all.
    """
    n_leaves = played.policy.n_leaves
    leaves = played.leaves()
    if not failed.any():
        return np.zeros(n_leaves)
    last = np.array([path[-1] for path in leaves])
    visited = np.array([np.bincount(path, minlength=n_leaves) > 0 for path in leaves])
    ends = np.bincount(last[failed], minlength=n_leaves) / failed.sum()
    elsewhere = visited[~failed].mean(axis=0) if not failed.all() else np.zeros(n_leaves)
    more = np.maximum(visited[failed].mean(axis=0) - elsewhere, 0.0)
    guilt: Floats = ends + more
    return guilt


def most_guilty(played: Played, mean_return: float, most: int) -> list[int]:
    """Return the leaves that have most to do with failing, at most so many, the worst first."""
    guilt = blame(played, played.failed(mean_return))
    return [leaf for leaf in np.argsort(-guilt, kind="stable")[:most].tolist() if guilt[leaf] > 0.0]


def repairs(
    policy: TreePolicy, demonstrations: Demonstrations, leaf: int
) -> Iterator[tuple[TreePolicy, str]]:
    """Yield trees in which one leaf is changed, and the change in words.

    C4.5 takes the most frequent action of a leaf. A person who waits shows the waiting many times
    and the going on once: where no test tells them apart, the leaf waits for ever. Three changes of
    such a leaf stay within the demonstrations: another action shown there; the cuts that C4.5 finds
    in the leaf's own steps when neither penalty nor pruning forbids them; and the most frequent
    action below the test above it, which gives that test up. Playing says which is right, if any.
    """
    shown = shown_in(policy, demonstrations)
    taken, names = int(policy.actions[leaf]), policy.schema.actions
    for action in np.argsort(-shown[leaf], kind="stable").tolist():
        if action != taken and shown[leaf, action]:
            labels = policy.actions.copy()
            labels[leaf] = action
            words = f"{names[action]} in place of {names[taken]} where both were shown"
            yield _labelled(policy, labels), words
    if np.count_nonzero(shown[leaf]) > 1:
        yield _cut(policy, demonstrations, leaf), "a leaf cut further"
    parent = int(policy.tree.parent[policy.tree.node_of_leaf[leaf]])
    if parent >= 0:
        below = [n for n in range(policy.n_leaves) if parent in policy.tree.path(n)]
        labels = policy.actions.copy()
        labels[below] = shown[below].sum(axis=0).argmax()
        yield _labelled(policy, labels), "a test dropped"


def _labelled(policy: TreePolicy, labels: Integers) -> TreePolicy:
    tree, actions = merge(policy.tree, labels)
    return replace(policy, tree=tree, actions=actions, leaves=None, ranks=None)


def _cut(policy: TreePolicy, demonstrations: Demonstrations, leaf: int) -> TreePolicy:
    observations, actions = lessons(demonstrations.with_history(policy.history))
    rows = policy.tree.leaf_index(observations) == leaf
    scion, labels = grow(
        observations[rows], actions[rows], n_classes=policy.schema.n_actions, settings=_FREE
    ).to_decision_tree()
    kept = {n: action for n, action in enumerate(policy.actions.tolist()) if n != leaf}
    if kept:
        scion, labels, _ = graft(policy.tree, kept, scion, labels)
    return _labelled(replace(policy, tree=scion, actions=labels, ranks=None), labels)


# Hundreds of episodes are known to begin with, so it is planned early and often: waiting until they
# have grown by 6 % would leave a hundred episodes of practice one or two challengers. Nearly all of
# them were played by the tree itself, so they show how well it plays.
METHOD = PlanningMethod(
    gathering_episodes=10,
    planner=Planner(growth=1.02, trust_demonstrations=True),
    unpruned_start=False,
)


def practise(
    tree: TreePolicy,
    demonstrations: Demonstrations,
    played: tuple[Episode, ...],
    env: gymnasium.Env[Any, Any],
    *,
    episodes: int,
    seed: int = 0,
    on_progress: Callable[[Run], None] | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> tuple[TreePolicy, ...]:
    """Return the trees learned from a tree in ``episodes`` episodes: one, or two.

    The first is the policy. The second is the challenger whose evaluation the end of the practice
    has cut short, if there is one: mostly the better of both. Let them play, and take the better.

    Learning begins with the tree's own play, besides the demonstrations: the model of the world in
    which it plans is better by that, for nothing. Of ``played``, its episodes since, the last
    ``MOST_KNOWN`` steps are used. ``on_progress`` and ``stop`` are as of ``eutree.learn``.
    """
    known = (*demonstrations.episodes, *_recent(played))
    runs: list[Run] = []

    def follow(run: Run) -> None:
        runs[:] = [run]
        if on_progress is not None:
            on_progress(run)

    policy = learn(
        env,
        demonstrations=replace(demonstrations, episodes=known),
        expert=tree,
        method=METHOD,
        history=tree.history,
        episodes=episodes,
        evaluate_every=max(episodes, 1),
        evaluation_episodes=1,
        judge_episodes=0,
        seed=seed,
        stop=stop,
        on_progress=follow,
    ).policy
    learner = runs[0].learner if runs else None
    found = learner.on_trial() if isinstance(learner, ModelPlanning) else None
    return (policy,) if found is None else (policy, found.policy(runs[0].beginning.problem))


def _recent(episodes: tuple[Episode, ...]) -> tuple[Episode, ...]:
    """Return the last episodes, of ``MOST_KNOWN`` steps at most."""
    steps = np.cumsum([len(episode) for episode in reversed(episodes)])
    return episodes[len(episodes) - int(np.searchsorted(steps, MOST_KNOWN, side="right")) :]
