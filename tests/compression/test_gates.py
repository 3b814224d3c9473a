"""Giving something up for fewer leaves: a budget of decisions, a margin of the return."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.compression import RealEpisodes, compress
from eutree.compression.smaller_trees import Costs, Prunings, rounded
from eutree.errors import InvalidArgumentError
from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from tests.compression.policies import actions_on, random_policy
from tests.corridor import Corridor, striped

seeds = st.integers(0, 2**32)


def leaf_labels(policy, costs, node=0):
    """Yield (leaves, cost) of every pruning of the tree below a node, one by one."""
    tree = policy.tree
    below = costs.of_leaves(tree)
    inside = [leaf for leaf in range(tree.n_leaves) if node in tree.path(leaf)]
    yield 1, below[inside].sum(axis=0).min()
    if tree.feature[node] != tree.NO_FEATURE:
        sides = (leaf_labels(policy, costs, int(side[node])) for side in (tree.left, tree.right))
        for (n, cost), (m, other) in itertools.product(*map(list, sides)):
            yield n + m, cost + other


@settings(max_examples=40, deadline=None)
@given(seed=seeds, n_leaves=st.integers(1, 9), n_actions=st.integers(1, 3))
def test_the_best_pruning_of_each_size_is_the_best_of_all(seed, n_leaves, n_actions):
    policy = random_policy(seed, n_leaves, n_actions)
    generator = np.random.default_rng(seed)
    rows = generator.random((60, 3)) * 12
    costs = Costs(rows, generator.integers(0, 5, (60, n_actions)).astype(float), 1.0)
    prunings = Prunings(policy, costs)
    listed = list(leaf_labels(policy, costs))
    for size in range(1, n_leaves + 1):
        least = min(cost for n, cost in listed if n <= size)
        assert prunings.costs[size - 1] == least
        pruned = prunings.of_size(size)
        assert pruned.n_leaves <= size
        assert costs.share(pruned.tree, pruned.actions) == least


@settings(max_examples=25, deadline=None)
@given(seed=seeds, budget=st.sampled_from([0.0, 0.01, 0.1, 0.5, 1.0]), short=st.booleans())
def test_the_budget_is_kept_and_never_costs_leaves(seed, budget, short):
    policy = random_policy(seed, 40, n_actions=3)
    rows = np.random.default_rng(seed).random((200, 3)) * 12
    small, report = compress(policy, rows, max_disagreement=budget, round_thresholds=short)
    differ = (actions_on(small, rows) != actions_on(policy, rows)).mean()
    assert report.weighted_disagreement == pytest.approx(differ)
    assert differ <= budget
    assert small.n_leaves <= compress(policy, rows)[0].n_leaves


def test_a_larger_budget_gives_fewer_leaves_down_to_one():
    policy = random_policy(5, 400)
    rows = np.random.default_rng(5).random((400, 3)) * 12
    sizes = [
        compress(policy, rows, max_disagreement=budget)[1].n_leaves_after
        for budget in (0.0, 0.02, 0.1, 0.3, 1.0)
    ]
    assert sizes == sorted(sizes, reverse=True)
    assert (sizes[0], sizes[-1]) == (compress(policy, rows)[1].n_leaves_after, 1)
    assert sizes[1] < sizes[0]


def test_the_gap_of_values_decides_which_decisions_go():
    """Rare but dear decisions go first by visits, and stay by the gap."""
    tree = DecisionTree.single_leaf(1).split(0, 0, 1.0).split(1, 0, 2.0).split(2, 0, 3.0)
    rows = np.repeat([[0.5], [1.5], [2.5], [3.5]], [50, 4, 40, 6], axis=0)
    values = np.array([[1.0, 0.0], [0.0, 100.0], [1.0, 0.0], [0.0, 0.1]])
    visits = np.full((4, 2), 5)
    policy = TreePolicy(
        tree,
        np.array([0, 1, 0, 1]),
        Schema.anonymous(1, 2),
        leaves=LeafStatistics(visits, values, np.abs(values)),
    )
    by_visits, _ = compress(policy, rows, max_disagreement=0.05)
    by_gap, report = compress(policy, rows, max_disagreement=0.05, weights="q-gap")
    assert by_visits.predict([1.5])[0] == 0
    assert (by_gap.predict([1.5])[0], by_gap.predict([3.5])[0]) == (1, 0)
    assert report.weighted_disagreement == pytest.approx(0.6 / (50 + 400 + 40 + 0.6))
    assert report.agreement == pytest.approx(0.94)


def test_untried_actions_count_as_the_worst_of_their_leaf():
    policy = random_policy(1, 2, n_actions=3)
    values = np.array([[1.0, 3.0, np.nan], [np.nan, np.nan, np.nan]])
    known = replace(
        policy,
        actions=np.array([1, 2]),
        leaves=LeafStatistics(np.ones((2, 3), dtype=np.int64), values, values),
    )
    rows = np.random.default_rng(0).random((50, 3)) * 12
    costs = Costs.of(known, rows, "q-gap")
    leaves = known.tree.leaf_index(rows)
    expected = np.array([[2.0, 0.0, 2.0], [2.0, 2.0, 0.0]])
    assert costs.of_action.tolist() == expected[leaves].tolist()


PLACES = np.linspace(0, 10, 401).reshape(-1, 1)
# Right but for a stripe that costs 0.1 a visit and that nothing needs.
BUSY = striped(0, 2.0, 1, 3.0, 0, 5.0, 1)


def test_what_only_costs_return_is_pruned_and_steps_are_counted():
    Corridor.steps_made = 0
    small, report = compress(
        BUSY, PLACES, env=RealEpisodes(Corridor(), margin=0.0, episodes=200), seed=3
    )
    assert (small.n_leaves, report.method) == (2, "return")
    assert report.mean_return_after > report.mean_return_before
    assert report.return_change.interval.low >= 0.0
    assert report.environment_steps == Corridor.steps_made > 400 * 10


def test_what_return_needs_stays():
    """The control: a budget gives up the rare stripe beyond 9, which is what pays."""
    policy = striped(0, 5.0, 1, 9.0, 1)
    needed = replace(policy, actions=np.array([1, 0, 1]))  # wrong everywhere else
    by_decisions, _ = compress(needed, PLACES, max_disagreement=0.15)
    by_return, report = compress(
        needed, PLACES, env=RealEpisodes(Corridor(), margin=0.5, episodes=200)
    )
    assert by_decisions.predict([9.5])[0] == 0
    assert by_return.predict([9.5])[0] == 1
    assert report.return_change.interval.low >= -0.5


def test_nothing_confirmed_gives_the_exact_merge():
    needed = striped(0, 5.0, 1)
    result, report = compress(needed, PLACES, env=RealEpisodes(Corridor(), margin=0.0, episodes=60))
    assert (result.n_leaves, report.method, report.agreement) == (2, "merge", 1.0)
    assert report.return_change.value == 0.0


def test_an_environment_alone_evaluates_before_and_after():
    small, report = compress(
        BUSY, PLACES, max_disagreement=0.12, env=RealEpisodes(Corridor(), episodes=50)
    )
    assert small.n_leaves == 2
    assert report.environment_steps == 2 * 50 * 10
    assert report.return_change.n == 50
    assert report.mean_return_after - report.mean_return_before == pytest.approx(
        report.return_change.value
    )


def test_the_same_seed_gives_the_same_result():
    one, other = (
        compress(BUSY, PLACES, env=RealEpisodes(Corridor(), margin=0.1, episodes=60), seed=4)
        for _ in range(2)
    )
    assert one[0] == other[0]
    assert one[1] == other[1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"env": RealEpisodes("x", margin=1.0), "max_disagreement": 0.1}, "got both"),
        ({"max_disagreement": 1.5}, r"max_disagreement must be a number in \[0, 1\]"),
        ({"max_disagreement": 0.1, "mode": "merge"}, 'mode must be "auto"'),
        ({"weights": "q-gap", "max_disagreement": 0.1}, 'weights must be "visits"'),
        ({"weights": "vists"}, "Did you mean 'visits'"),
    ],
)
def test_bad_demands_are_named(options, message):
    with pytest.raises(InvalidArgumentError, match=message):
        compress(BUSY, PLACES, **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"confidence": 0.5}, "confidence must be a number in"),
        ({"margin": -1.0}, "margin must be a number"),
        ({"episodes": 1}, "episodes must be an integer >= 2, got 1"),
        ({"return_range": (1.0, 0.0)}, "return_range must be the lowest"),
        ({"return_range": (-1e308, 1e308)}, "the highest of a finite range, got"),
        ({"return_range": (0.0, float("nan"))}, "the highest of a finite range, got"),
        ({"return_range": (0.0, 1.0, 2.0)}, "the highest of a finite range, got"),
    ],
)
def test_episodes_that_cannot_be_are_named(options, message):
    with pytest.raises(InvalidArgumentError, match=message):
        RealEpisodes("x", **options)


@pytest.mark.parametrize("width", [1e100, 1e300, 1.7e308])
def test_no_width_of_a_range_is_too_large(width):
    """From 1e-16 of the width on a margin ended in a ZeroDivisionError."""
    demand = RealEpisodes(
        Corridor(), margin=1e-20, episodes=20, return_range=(-width / 2, width / 2)
    )
    _, report = compress(BUSY, PLACES, env=demand)
    assert report.episodes_needed > 10**9


def test_the_report_says_what_the_bounds_depend_on():
    bounded = RealEpisodes(Corridor(), margin=0.5, episodes=40, return_range=(0.0, 50.0))
    _, known = compress(BUSY, PLACES, env=bounded)
    assert (known.range_known, known.return_range) == (True, (0.0, 50.0))
    assert known.episodes_needed > 400  # 40 cannot show that less than 0.5 of 50 is lost
    assert (known.method, known.return_change.n) == ("merge", 40)
    _, seen = compress(BUSY, PLACES, env=RealEpisodes(Corridor(), margin=4.0, episodes=60))
    assert (seen.range_known, seen.episodes_needed) == (False, None)
    assert seen.return_range[1] - seen.return_range[0] >= 4.0 * 60 / 9


def test_a_step_for_one_feature_leaves_the_others_alone():
    tree = DecisionTree.single_leaf(2).split(0, 0, 0.4567).split(1, 1, 0.1234)
    policy = TreePolicy(tree, np.array([0, 1, 0]), Schema.anonymous(2, 2))
    found = rounded(policy, np.random.default_rng(0).random((50, 2)), {0: 0.1})
    assert sorted(found.tree.threshold[found.tree.feature >= 0]) == [0.1234, 0.5]


def test_a_range_that_the_episodes_refute_is_not_known():
    """It was replaced by the worst that was seen, which the report called known."""
    stated = RealEpisodes(Corridor(), margin=0.5, episodes=40, return_range=(0.0, 1.0))
    _, report = compress(BUSY, PLACES, env=stated)
    assert report.return_range[1] > 1.0
    assert not report.range_known
