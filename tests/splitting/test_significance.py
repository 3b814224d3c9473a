"""Levels, power and known values of the tests of significance."""

import math

import numpy as np
import pytest
from scipy import stats

from eutree import compiled
from eutree.errors import InvalidArgumentError
from eutree.splitting import (
    KolmogorovSmirnov,
    LeafSample,
    Maximal,
    Naive,
    Permutation,
    best_split,
    critical_value,
    maximal_p,
    naive_p,
    permutation_p,
)
from eutree.splitting.significance import EpisodeRows
from tests import naive_splitting

slow_without_compilation = pytest.mark.skipif(
    not compiled.ENABLED, reason="too slow without compilation"
)


def leaf(x, q, actions=None, episodes=None):
    actions = np.zeros(len(q), np.int64) if actions is None else actions.astype(np.int64)
    return LeafSample(x, np.asarray(q, float), actions, episodes)


def rate(significance, search, samples, generator):
    """Return the share of samples whose best split is accepted."""
    accepted = []
    for sample in samples:
        split = search.best(sample)
        accepted.append(
            split is not None
            and significance.p_value(split, sample, search, generator) <= significance.alpha
        )
    return np.mean(accepted)


def classes_one_by_one(lengths):
    """Return the class of each length: twice the shortest of a class is its longest at most."""
    shortest = {}
    for length in sorted(lengths):
        if not shortest or length > 2 * shortest[len(shortest) - 1]:
            shortest[len(shortest)] = length
    return [max(k for k, least in shortest.items() if least <= length) for length in lengths]


def index_of_class(drawn, alike, wanted):
    """Return where the first episode of a class stands among those drawn."""
    return next(k for k, episode in enumerate(drawn) if alike[episode] == wanted)


def null_samples(generator, count, n=120, *, returns=None):
    """Yield leaves in which nothing depends on the observations: 3 attributes, 2 actions."""
    for _ in range(count):
        q = generator.normal(size=n) if returns is None else returns(generator, n)
        yield leaf(generator.normal(size=(n, 3)), q, generator.integers(0, 2, size=n))


class TestNaive:
    @pytest.mark.promise(17)
    def test_the_exact_p_equals_scipys(self):
        generator = np.random.default_rng(0)
        for _ in range(200):
            n_left, n_right = generator.integers(1, 40, size=2)
            left, right = generator.normal(size=n_left), generator.normal(0.5, size=n_right)
            theirs = stats.ks_2samp(left, right, method="exact")
            ours = naive_splitting.exact_p(theirs.statistic, int(n_left), int(n_right))
            assert ours == pytest.approx(theirs.pvalue, abs=1e-12)

    @pytest.mark.promise(17)
    def test_the_asymptotic_p_stays_within_its_stated_bounds(self):
        """0.08 for most sizes, 0.005 where p is small enough to matter (below 0.02)."""
        for n_left, n_right in [(20, 20), (10, 50), (40, 90)]:
            for k in range(1, n_left):
                exact = naive_splitting.exact_p(k / n_left, n_left, n_right)
                bound = 0.08 if exact > 0.02 else 0.005
                assert naive_p(k / n_left, n_left, n_right) == pytest.approx(exact, abs=bound)

    @pytest.mark.promise(17)
    def test_the_asymptotic_p_is_worst_for_small_sides_of_nearly_one_size(self):
        """0.12 and 0.008 from 10 tuples per side on, 0.08 and 0.006 from 20 on."""
        for n_left in (10, 11, 12, 14, 17, 20, 24):
            for n_right in (n_left, n_left + 1):
                bounds = (0.12, 0.008) if n_left < 20 else (0.08, 0.006)
                steps = math.lcm(n_left, n_right)  # in which the statistic rises
                for k in range(1, steps, max(steps // 200, 1)):
                    exact = naive_splitting.exact_p(k / steps, n_left, n_right)
                    bound = bounds[int(exact < 0.02)]
                    assert naive_p(k / steps, n_left, n_right) == pytest.approx(exact, abs=bound)

    def test_the_limit_law_equals_scipys(self):
        for d in np.linspace(0.01, 1.0, 60):
            scaled = (np.sqrt(50) + 0.12 + 0.11 / np.sqrt(50)) * d
            assert naive_p(d, 100, 100) == pytest.approx(stats.kstwobign.sf(scaled), abs=1e-12)

    @slow_without_compilation
    def test_it_splits_noise_far_too_often(self):
        generator = np.random.default_rng(1)
        samples = list(null_samples(generator, 150))
        assert rate(Naive(0.01), KolmogorovSmirnov(), samples, generator) > 0.2


class TestMaximal:
    def test_p_inverts_the_critical_value(self):
        for n in (2, 5, 20, 37, 400, 10**6):
            for alpha in (0.9, 0.3, 0.01, 0.003, 1e-5, 1e-9):
                for min_side in (1, n // 3 + 1):
                    value = critical_value(n, alpha, min_side=min_side)
                    p = maximal_p(value, n, min_side=min_side)
                    assert p == pytest.approx(alpha, rel=1e-9)

    def test_the_table_has_the_published_points(self):
        """99 % points of an independent simulation with 20,000 to 100,000 replicates."""
        known = {20: 1.76, 50: 1.89, 100: 1.96, 200: 2.03, 500: 2.09, 1000: 2.12}
        for n, value in known.items():
            assert critical_value(n, 0.01) == pytest.approx(value, abs=0.025)

    @slow_without_compilation
    @pytest.mark.parametrize("n", [38, 240])
    def test_it_holds_its_level_between_tabulated_sizes(self, n):
        generator = np.random.default_rng(n)
        x = np.arange(n, dtype=float)[:, None]
        values = [
            best_split(x, generator.permutation(n), min_leaf=1).scaled_statistic
            for _ in range(4000)
        ]
        for alpha in (0.2, 0.05, 0.01):
            share = np.mean(np.array(values) >= critical_value(n, alpha))
            assert share == pytest.approx(alpha, abs=3.5 * np.sqrt(alpha / 4000))

    @slow_without_compilation
    def test_it_holds_its_level_over_attributes_and_actions(self):
        generator = np.random.default_rng(2)
        share = rate(Maximal(0.1), KolmogorovSmirnov(), null_samples(generator, 600), generator)
        assert 0.04 < share < 0.1 + 3 * np.sqrt(0.1 * 0.9 / 600)

    def test_too_few_tuples_to_split_anything(self):
        assert maximal_p(0.0, 2) == 1.0
        with pytest.raises(InvalidArgumentError, match="n must be an integer >= 2, got 1"):
            maximal_p(1.0, 1)


class TestPermutation:
    @slow_without_compilation
    @pytest.mark.parametrize("kind", ["continuous", "rare"])
    def test_it_holds_its_level_with_and_without_ties(self, kind):
        def rare(generator, n):
            return (generator.random(n) < 0.05).astype(float)

        generator = np.random.default_rng(3)
        samples = null_samples(generator, 300, returns=rare if kind == "rare" else None)
        test = Permutation(alpha=0.1, n_permutations=99)
        share = rate(test, KolmogorovSmirnov(), samples, generator)
        assert 0.1 - 3.5 * 0.0174 < share < 0.1 + 3.5 * 0.0174

    def test_it_sees_rare_events_that_the_others_miss(self):
        """Ten collisions among a thousand tuples, all in the lowest 5 % of an attribute."""
        generator = np.random.default_rng(1)
        x, q = np.arange(1000.0)[:, None], np.zeros(1000)
        q[generator.choice(50, 10, replace=False)] = -50.0
        sample, search = leaf(x, q), KolmogorovSmirnov()
        split = search.best(sample)
        assert Naive().p_value(split, sample, search, generator) > 0.01
        assert Maximal().p_value(split, sample, search, generator) > 0.01
        test = Permutation(n_permutations=199)
        assert test.p_value(split, sample, search, generator) == pytest.approx(1 / 200)

    def test_it_stops_early_on_noise_and_repeats_with_the_seed(self):
        generator = np.random.default_rng(5)
        sample, search = next(null_samples(generator, 1, n=60)), KolmogorovSmirnov()
        split = search.best(sample)
        options = {"search": search, "n_permutations": 10**6, "stop_after": 5}
        p = permutation_p(sample, split, generator=np.random.default_rng(6), **options)
        assert p > 0.01
        assert (5 / p) == pytest.approx(round(5 / p))  # stopped at a whole draw
        assert p == permutation_p(sample, split, generator=np.random.default_rng(6), **options)

    def test_equality_counts(self):
        """Every order of one odd value has the same statistic: nothing is significant."""
        sample = leaf(np.array([[0.0], [0.0], [1.0], [1.0]]), [0, 0, 0, 1])
        search = KolmogorovSmirnov(min_leaf=1)
        split = search.best(sample)
        p = permutation_p(
            sample, split, search=search, generator=np.random.default_rng(0), n_permutations=50
        )
        assert p == 1.0

    @slow_without_compilation
    def test_whole_episodes_are_permuted_if_tuples_depend_on_each_other(self):
        generator = np.random.default_rng(7)
        samples = []
        for _ in range(60):
            episodes = np.repeat(np.arange(12), 10)
            x = (generator.normal(size=12)[episodes] + 0.01 * generator.normal(size=120))[:, None]
            samples.append(leaf(x, generator.normal(size=12)[episodes], None, episodes))
        search = KolmogorovSmirnov()
        by_tuple = Permutation(alpha=0.05, n_permutations=39, min_episodes=0)
        by_episode = Permutation(alpha=0.05, n_permutations=39, by_episode=True)
        assert rate(by_tuple, search, samples, generator) > 0.8
        assert rate(by_episode, search, samples, generator) < 0.2

    @slow_without_compilation
    def test_episodes_of_unequal_length_are_permuted_whole_too(self):
        """Laid end to end, most of them straddled two donors: noise was split 15 times in 100."""
        generator = np.random.default_rng(8)
        samples = []
        for _ in range(120):
            episodes = np.sort(generator.integers(12, size=120))
            x = (generator.normal(size=12)[episodes] + 0.01 * generator.normal(size=120))[:, None]
            q = generator.normal(size=12)[episodes] + 0.01 * generator.normal(size=120)
            samples.append(leaf(x, q, None, episodes))
        test = Permutation(alpha=0.05, n_permutations=39, by_episode=True)
        found = rate(test, KolmogorovSmirnov(), samples, generator)
        assert found <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 120)

    @slow_without_compilation
    def test_a_few_long_episodes_with_wide_returns_are_no_structure(self):
        """Exchanged with all others they were split 49 times in 400, and 14 in 329 at 1 %."""
        generator = np.random.default_rng(0)
        episodes = np.repeat(np.arange(45), [3] * 40 + [40] * 5)
        spread = np.repeat([1.0, 10.0], [40, 5])
        samples = []
        for _ in range(400):
            x = generator.normal(size=45)[episodes][:, None]
            q = (spread * generator.normal(size=45))[episodes]
            q += 0.01 * generator.normal(size=episodes.size)
            samples.append(leaf(x, q, None, episodes))
        test = Permutation(alpha=0.05, n_permutations=99, by_episode=True)
        found = rate(test, KolmogorovSmirnov(), samples, np.random.default_rng(0))
        assert found <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 400)

    @slow_without_compilation
    def test_episodes_of_any_length_still_show_what_is_there(self):
        generator = np.random.default_rng(1)
        samples = []
        for _ in range(60):
            lengths = generator.integers(2, 40, size=40)
            episodes = np.repeat(np.arange(40), lengths)
            own = generator.normal(size=40)
            q = 2.0 * (own > 0) + 0.5 * generator.normal(size=40)
            samples.append(leaf(own[episodes][:, None], q[episodes], None, episodes))
        test = Permutation(alpha=0.01, by_episode=True)
        assert rate(test, KolmogorovSmirnov(), samples, np.random.default_rng(0)) >= 0.9

    @pytest.mark.parametrize("seed", range(5))
    def test_episodes_are_exchanged_as_one_by_one(self, seed):
        """Byte for byte the same as with a loop over the episodes, from the same draws."""
        generator = np.random.default_rng(seed)
        numbers = generator.integers(9, size=80)  # of very different sizes, in any order
        rows = np.sort(generator.choice(80, 60, replace=False))
        values = generator.integers(20, size=60).astype(np.int32)
        sample = leaf(np.zeros((80, 1)), np.zeros(80), None, numbers)
        fast, slow = np.random.default_rng(seed), np.random.default_rng(seed)
        for _ in range(20):
            found = EpisodeRows.of(sample, rows).permuted(values, fast)
            blocks = [np.flatnonzero(numbers[rows] == one) for one in np.unique(numbers[rows])]
            expected = np.empty_like(values)
            lengths = [np.count_nonzero(numbers == numbers[rows[block[0]]]) for block in blocks]
            alike = classes_one_by_one(lengths)
            drawn = slow.permutation(len(blocks)).tolist()
            taken_from = [drawn.pop(index_of_class(drawn, alike, one)) for one in alike]
            for block, source in zip(blocks, taken_from, strict=True):
                taken = values[blocks[source]]
                taken = np.roll(taken, slow.integers(taken.size))
                expected[block] = taken[np.arange(block.size) * taken.size // block.size]
            np.testing.assert_array_equal(found, expected)
        assert fast.random() == slow.random()

    def test_both_sides_must_hold_several_episodes(self):
        x = np.arange(60.0)[:, None]
        q = (x[:, 0] >= 30).astype(float)
        search, generator = KolmogorovSmirnov(), np.random.default_rng(0)
        for n_episodes, accepted in ((2, False), (20, True)):
            sample = leaf(x, q, None, np.arange(60) * n_episodes // 60)
            p = Permutation().p_value(search.best(sample), sample, search, generator)
            assert (p <= 0.01) == accepted

    def test_too_few_permutations_for_the_level_are_refused(self):
        with pytest.raises(InvalidArgumentError, match="n_permutations must be an integer >= 99"):
            Permutation(alpha=0.01, n_permutations=98)


@pytest.mark.parametrize("significance", [Naive(), Maximal(), Permutation(n_permutations=199)])
def test_all_find_a_step(significance):
    generator = np.random.default_rng(8)
    samples = []
    for _ in range(12):
        x = generator.normal(size=(200, 2))
        samples.append(leaf(x, generator.normal(size=200) + 1.2 * (x[:, 1] > 0)))
    assert rate(significance, KolmogorovSmirnov(), samples, generator) == 1.0


@slow_without_compilation
def test_pooling_splits_on_the_mix_of_actions_and_comparing_within_actions_does_not():
    """q depends on the action alone; which action is taken depends on the observation."""
    generator = np.random.default_rng(9)
    samples = []
    for _ in range(150):
        x = generator.random((200, 1))
        actions = (generator.random(200) < 0.15 + 0.7 * x[:, 0]).astype(np.int64)
        samples.append(leaf(x, generator.normal(size=200) + 1.5 * actions, actions))
    shares = {
        compare: rate(Maximal(), KolmogorovSmirnov(compare=compare), samples, generator)
        for compare in ("pooled", "action", "centred")
    }
    assert shares["pooled"] > 0.25
    assert shares["action"] <= 0.04
    assert shares["centred"] <= 0.06


@pytest.mark.parametrize("kind", [Naive, Maximal, Permutation])
def test_levels_are_checked(kind):
    with pytest.raises(InvalidArgumentError, match=r"alpha must be a number in \(0, 1\], got 0"):
        kind(alpha=0)
