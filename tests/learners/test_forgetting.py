"""A bounded history: never too much, a uniform sample in each cell, and all else consistent."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from eutree.data import Episode
from eutree.learners import CORRECTED, DEFAULT, PAPER, LambdaReturn, Problem, Start, Step
from eutree.learners.episode_buffer import transitions_of
from eutree.learners.forgetting import RANKS, LeafReservoirs, RecentEpisodes, fair_shares
from eutree.learners.history import History
from eutree.mdp import TabularMDP, TransitionCounts
from eutree.schema import Schema
from eutree.splitting import Naive, Split
from eutree.trees import DecisionTree
from tests import naive_forgetting, naive_learning
from tests.learners.histories import assert_consistent
from tests.worlds import Walk

SPLITS = replace(CORRECTED, significance=Naive(), max_transitions=200)
PLANS = replace(
    DEFAULT,
    planner=replace(DEFAULT.planner, n_episodes=40, min_episodes=5),
    max_transitions=200,
)
SPLIT = {
    "paper": replace(PAPER, max_transitions=200),
    "splits": SPLITS,
    "returns": replace(SPLITS, target=LambdaReturn(0.8)),
}
BOUNDED = SPLIT | {"plans": PLANS}


def learned(method, seed=0, phases=3, episodes=8, check=lambda learner: None):
    learner = method.start(Walk.problem, Start())
    world = Walk(np.random.default_rng(seed))
    for phase in range(phases):
        for episode in range(episodes):
            world.run(learner, np.random.default_rng((seed, phase, episode)))
            check(learner)
        learner.update(np.random.default_rng((seed, phase)))
    return learner


@given(sizes=st.lists(st.integers(0, 30), min_size=1, max_size=12), room=st.integers(0, 200))
def test_the_room_is_shared_as_one_by_one_from_the_fullest(sizes, room):
    assert fair_shares(np.array(sizes), room).tolist() == naive_forgetting.shares(sizes, room)


class Cells:
    """A history whose transitions carry their own number, beside its naive twin."""

    def __init__(self, seed, max_transitions):
        self.tree = DecisionTree.single_leaf(2)
        self.history = History(2, 1, LeafReservoirs(max_transitions, 1, 2))
        self.naive = naive_forgetting.LeafReservoirs(max_transitions)
        self.ranks = np.random.default_rng(seed + 1)  # draws what the history draws
        self.generator = np.random.default_rng(seed)
        self.number = 0

    def add_episode(self):
        steps = int(self.generator.integers(0, 20))
        observations = np.stack(
            [np.arange(self.number, self.number + steps + 1), self.generator.random(steps + 1)], 1
        )
        actions = (self.generator.random(steps) < 0.2).astype(np.int64)
        leaves = self.tree.leaf_index(observations)
        ranks = np.random.default_rng(self.number).integers(RANKS, size=steps, dtype=np.uint32)
        self.history.append_episode(
            observations,
            actions,
            np.zeros(steps),
            leaves,
            terminated=bool(self.generator.integers(2)),
            generator=np.random.default_rng(self.number),
        )
        self.history.forget()
        names = [tuple(row) for row in observations[:-1].tolist()]
        self.naive.add(
            zip(names, leaves[:-1].tolist(), actions.tolist(), ranks.tolist(), strict=True)
        )
        self.naive.forget()
        self.number += steps + 1

    def split(self):
        leaf, threshold = int(self.generator.integers(self.tree.n_leaves)), self.generator.random()
        new_leaf = self.tree.n_leaves
        self.tree = self.tree.split(leaf, 1, threshold)
        self.history.split(leaf, new_leaf, 1, threshold)
        self.naive.split(leaf, new_leaf, lambda name: not name[1] <= threshold)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    n_operations=st.integers(1, 40),
    max_transitions=st.sampled_from([1, 7, 40, 100]),
)
def test_what_is_stored_is_what_the_naive_twin_stores(seed, n_operations, max_transitions):
    cells = Cells(seed, max_transitions)
    for _ in range(n_operations):
        cells.split() if cells.generator.random() < 0.2 else cells.add_episode()
        history = cells.history
        assert history.size <= max_transitions
        assert history.observations.tolist() == [list(row[0]) for row in cells.naive.stored()]
        assert history.columns["ranks"].tolist() == [row[3] for row in cells.naive.stored()]
        assert_consistent(cells.tree, history)
        numbers = history.observations[:, 0]
        follows = np.append(False, np.diff(numbers) == 1)[: numbers.size]
        assert history.continues.tolist() == follows.tolist()
    for leaf in range(cells.tree.n_leaves):
        stored = history.actions[history.leaving.of(leaf)]
        seen = sum(
            (stored == action).sum() * RANKS / cells.naive.bound(leaf, action) for action in (0, 1)
        )
        assert history.seen_leaving()[leaf] == pytest.approx(seen, abs=1)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    n_episodes=st.integers(1, 60),
    max_transitions=st.sampled_from([20, 50, 150]),
)
def test_whole_episodes_are_kept_as_the_naive_twin_keeps_them(seed, n_episodes, max_transitions):
    generator = np.random.default_rng(seed)
    rule = RecentEpisodes(max_transitions)
    history, tree = History(1, 1, rule), DecisionTree.single_leaf(1)
    lengths, ranks, names, bound = [], [], [], RANKS
    for name in range(n_episodes):
        steps = int(generator.integers(1, 20))
        observations = np.full((steps + 1, 1), float(name))
        history.append_episode(
            observations,
            np.zeros(steps, dtype=np.int64),
            np.zeros(steps),
            tree.leaf_index(observations),
            terminated=True,
            generator=np.random.default_rng(name),
        )
        lengths.append(steps)
        ranks.append(int(np.random.default_rng(name).integers(RANKS, dtype=np.uint32)))
        names.append(name)
        before = len(names)
        if sum(lengths) > max_transitions:
            stay, bound = naive_forgetting.kept_episodes(lengths, ranks, bound, max_transitions)
            lengths, ranks, names = ([x[k] for k in stay] for x in (lengths, ranks, names))
            assert history.forget().tolist() == stay
            assert len(stay) < before
        else:
            assert history.forget() is None
        assert history.size <= max_transitions
        assert history.observations[:, 0].tolist() == np.repeat(names, lengths).tolist()
        assert history.episodes.tolist() == np.repeat(range(len(names)), lengths).tolist()
        assert history.n_episodes == len(names)


def uniformity(counts, n_parts=10):
    """Return the p-value of the hypothesis that all transitions are kept equally often."""
    return chisquare(counts.reshape(n_parts, -1).sum(axis=1)).pvalue


def kept_counts(run, n, n_runs):
    counts = np.zeros(n)
    for seed in range(n_runs):
        counts[run(seed)] += 1
    return counts


def fill_cell(seed, *, spoiled=False):
    """Return the numbers of those that a cell keeps of 600, while another fills too."""
    rule, tree = LeafReservoirs(120, 1, 2), DecisionTree.single_leaf(1)
    if spoiled:  # ranks drawn again each time: whatever is old has to win many times
        keeps, chance = rule.keeps, np.random.default_rng(seed)

        def draw_again(*columns):
            rule.bounds[:] = RANKS
            stay = keeps(*columns[:3], rule.draw(columns[3].size, chance))
            rule.bounds[:] = RANKS
            return stay

        rule.keeps = draw_again
    history, generator = History(1, 1, rule), np.random.default_rng(seed)
    for first in range(0, 900, 30):
        observations = np.arange(first, first + 31.0)[:, None]
        history.append_episode(
            observations,
            np.arange(30) % 3 // 2,  # two of three are of the cell that is looked at
            np.zeros(30),
            tree.leaf_index(observations),
            terminated=False,
            generator=generator,
        )
        history.forget()
    numbers = history.observations[history.actions == 0, 0].astype(np.int64)
    return numbers - numbers // 3  # 0, 1, 3, 4, 6 ... -> 0, 1, 2, 3, 4 ...


def test_a_cell_keeps_a_uniform_sample_of_what_it_has_seen():
    counts = kept_counts(fill_cell, 600, 300)
    assert counts.sum() > 300 * 40
    assert uniformity(counts) > 0.01


def test_the_chi_square_catches_ranks_that_are_drawn_again():
    counts = kept_counts(lambda seed: fill_cell(seed, spoiled=True), 600, 300)
    assert uniformity(counts) < 1e-6


def test_older_episodes_are_a_uniform_sample():
    def run(seed):
        generator, tree = np.random.default_rng(seed), DecisionTree.single_leaf(1)
        history = History(1, 1, RecentEpisodes(80))
        for name in range(200):
            observations = np.full((3, 1), float(name))
            history.append_episode(
                observations,
                np.zeros(2, dtype=np.int64),
                np.zeros(2),
                tree.leaf_index(observations),
                terminated=True,
                generator=generator,
            )
            history.forget()
        return np.unique(history.observations[:, 0].astype(np.int64))

    counts = kept_counts(run, 200, 400)
    assert (counts[-17:] == 400).all()
    assert uniformity(counts[:160]) > 0.01


@pytest.mark.promise(19)
@pytest.mark.parametrize("name", SPLIT)
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_labels_and_counts_equal_a_rebuild_from_what_is_stored(name, seed):
    def check(learner):
        history, most = learner.history, learner.method.max_transitions
        assert history.size <= most
        assert len(history.columns.whole["rewards"]) <= most + 41  # and one episode
        rebuilt = TabularMDP(TransitionCounts(learner.tree.n_leaves, 2), learner.method.discount)
        rebuilt.counts.observe(history.left, history.actions, history.rewards, history.entered)
        assert learner.mdp.counts.visits.tolist() == rebuilt.counts.visits.tolist()
        assert learner.mdp.counts.reward_sums.tobytes() == rebuilt.counts.reward_sums.tobytes()
        for leaf in range(learner.tree.n_leaves):
            for action in range(2):
                mine = learner.mdp.counts.successors(leaf, action)
                theirs = rebuilt.counts.successors(leaf, action)
                assert [a.tolist() for a in mine] == [a.tolist() for a in theirs]

    learner = learned(BOUNDED[name], seed, phases=4, check=check)
    assert_consistent(learner.tree, learner.history)
    assert learner.history.n_seen > learner.method.max_transitions


@pytest.mark.promise(8)
@pytest.mark.parametrize("name", BOUNDED)
def test_a_bounded_learner_restored_goes_on_to_the_same_bytes(name):
    original = learned(BOUNDED[name])
    assert original.history.n_seen > original.history.size
    copy = BOUNDED[name].restore(
        Walk.problem, Start(), {k: v.copy() for k, v in original.state().items()}
    )
    for learner in (original, copy):
        world, generator = Walk(np.random.default_rng(5)), np.random.default_rng(6)
        for _ in range(25):
            world.run(learner, generator)
        learner.update(generator)
    mine, theirs = original.state(), copy.state()
    assert mine.keys() == theirs.keys()
    assert all(mine[k].tobytes() == theirs[k].tobytes() for k in mine)


@pytest.mark.parametrize("name", ["paper", "splits"])
def test_a_bound_that_is_never_reached_changes_nothing(name):
    free = learned(replace(BOUNDED[name], max_transitions=None), episodes=3)
    bounded = learned(replace(BOUNDED[name], max_transitions=10**6), episodes=3)
    mine, theirs = free.state(), bounded.state()
    assert mine.keys() == theirs.keys() - {"history_ranks", "history_bounds"}
    assert all(mine[k].tobytes() == theirs[k].tobytes() for k in mine)


@pytest.mark.parametrize("name", BOUNDED)
def test_a_discarded_episode_leaves_no_trace(name):
    learner = learned(BOUNDED[name])
    before = learner.state()
    learner.start_episode(np.zeros(2), np.random.default_rng(0))
    for step in range(7):
        observation = np.array([step, 0.5])
        learner.observe(Step(learner.act(), -3.25, observation, False, False))
    learner.discard_episode()
    after = learner.state()
    assert all(before[k].tobytes() == after[k].tobytes() for k in before)


def test_returns_stop_at_a_gap():
    learner = learned(BOUNDED["returns"], phases=6)
    history, greedy = learner.history, learner.greedy_actions()
    assert not history.continues[1:].all()
    rows = np.arange(history.size)
    wanted = [
        naive_learning.lambda_target(history, row, learner.mdp.values, greedy, 0.99, 0.8)
        for row in rows
    ]
    np.testing.assert_allclose(learner.targets(rows), wanted, atol=1e-12)


def test_a_planner_sees_what_a_gap_divides_as_two_episodes():
    history = learned(BOUNDED["paper"]).history
    data = transitions_of(history, 2)
    assert data.first.tolist() == (~history.continues).tolist()
    assert (np.diff(data.episodes) >= 0).all()


def test_the_halves_of_a_split_take_in_everything_again():
    learner = learned(replace(BOUNDED["paper"], significance=Naive(alpha=1e-300)))
    rule = learner.history.forgetting
    assert rule.bounds.min() < RANKS
    learner._split(0, Split(0, 5.0, 1.0, 1.0, 1, 1))
    assert (rule.bounds == RANKS).all()


def test_demonstrations_beyond_the_bound_are_a_sample():
    generator = np.random.default_rng(0)
    episodes = [
        Episode(
            observations=generator.random((31, 2)),
            actions=generator.integers(0, 2, 30),
            rewards=generator.random(30),
            terminated=True,
            truncated=False,
        )
        for _ in range(50)
    ]
    for method in (BOUNDED["paper"], replace(PLANS, max_transitions=1200)):
        learner = method.start(Walk.problem, Start(episodes=tuple(episodes)))
        assert learner.history.size <= method.max_transitions
        assert learner.history.n_seen == 1500
        if method is BOUNDED["paper"]:
            assert learner.mdp.counts.visits.sum() == learner.history.size
    assert learner.plan.demonstrations == learner.history.n_episodes


def test_an_episode_that_is_too_long_for_a_planner_is_named():
    problem = Problem(Schema.anonymous(1, 2))
    learner = replace(PLANS, max_transitions=5).start(problem, Start())
    for expected in (pytest.warns(UserWarning, match="6 transitions is more than"), nullcontext()):
        learner.start_episode(np.zeros(1), np.random.default_rng(0))
        for step in range(6):
            learner.observe(Step(0, 0.0, np.ones(1), step == 5, False))
        with expected:
            learner.end_episode()
    assert learner.history.size == 0
    assert learner.update(np.random.default_rng(0)).splits == ()
