"""The public search: scipy's statistic, actions, thresholds, refusals, and stories of old bugs."""

import numpy as np
import pytest
from scipy import stats

from eutree import compiled
from eutree.errors import InvalidArgumentError
from eutree.splitting import KolmogorovSmirnov, LeafSample, _kernels, best_split, critical_value
from tests import naive_splitting as naive
from tests.splitting.samples import tied_sample

N_CASES = 2000 if compiled.ENABLED else 40


def sides(split, x, q, actions=None):
    """Return the returns on both sides of a split, of the tested action if there is one."""
    tested = slice(None) if split.action is None else actions == split.action
    left = x[tested, split.feature] <= split.threshold
    return q[tested][left], q[tested][~left]


@pytest.mark.promise(17)
def test_the_statistic_equals_scipys():
    generator = np.random.default_rng(17)
    for case in range(N_CASES):
        x, q = tied_sample(generator, case)
        split = best_split(x, q, min_leaf=2, score=("scaled", "distance")[case % 2])
        if split is None:
            continue
        left, right = sides(split, x, q)
        assert (left.size, right.size) == (split.n_left, split.n_right)
        theirs = stats.ks_2samp(left, right, method="asymp").statistic
        assert split.statistic == pytest.approx(theirs, abs=1e-9)
        scaled = theirs * np.sqrt(left.size * right.size / q.size)
        assert split.scaled_statistic == pytest.approx(scaled, abs=1e-9)


@pytest.mark.parametrize("score", ["scaled", "distance"])
def test_no_cut_beats_the_best_one_by_scipy(score):
    generator = np.random.default_rng(18)
    for case in range(15):
        x, q = tied_sample(generator, case, largest=30)
        values = [0.0]
        for feature in range(2):
            for threshold in np.unique(x[:, feature])[:-1]:
                left = x[:, feature] <= threshold
                if 3 <= left.sum() <= q.size - 3:
                    d = stats.ks_2samp(q[left], q[~left], method="asymp").statistic
                    scale = np.sqrt(left.mean() * (~left).sum()) if score == "scaled" else 1.0
                    values.append(d * scale)
        split = best_split(x, q, min_leaf=3, score=score)
        if split is None:
            assert max(values) == 0.0
        else:
            ours = split.scaled_statistic if score == "scaled" else split.statistic
            assert ours == pytest.approx(max(values), abs=1e-9)


@pytest.mark.parametrize("score", ["scaled", "distance"])
def test_equals_the_definition_on_tied_data(score):
    generator = np.random.default_rng(5)
    for case in range(60):
        x, q = tied_sample(generator, case, largest=16)
        expected = naive.best_cut(x, q, min_leaf=2, score=score)
        split = best_split(x, q, min_leaf=2, score=score)
        if expected is None:
            assert split is None
            continue
        _, feature, left, right, weight, n_left = expected
        assert (split.feature, split.n_left, split.n_right) == (feature, n_left, q.size - n_left)
        assert left <= split.threshold < right
        assert split.statistic == weight / (n_left * (q.size - n_left))


@pytest.mark.parametrize("score", ["scaled", "distance"])
def test_the_best_over_actions_counts(score):
    generator = np.random.default_rng(6)
    for _ in range(20):
        x, q = generator.normal(size=(90, 2)), np.round(generator.normal(size=90), 1)
        actions = generator.choice(3, p=[0.1, 0.3, 0.6], size=90)
        split = best_split(x, q, actions=actions, min_leaf=4, score=score)
        value = KolmogorovSmirnov(score=score).value
        single = [
            best_split(x[actions == a], q[actions == a], min_leaf=4, score=score) for a in range(3)
        ]
        best = max((a for a in range(3) if single[a]), key=lambda a: value(single[a]))
        assert split.action == best
        assert split.threshold == single[best].threshold
        assert split.n_left + split.n_right == (actions == best).sum()
        left, right = sides(split, x, q, actions)
        assert (left.size, right.size) == (split.n_left, split.n_right)


def test_calibrated_scores_are_ratios_to_the_critical_value_of_the_action():
    generator = np.random.default_rng(7)
    differing = 0
    for _ in range(80):
        x, q = generator.normal(size=(150, 1)), generator.normal(size=150)
        actions = (np.arange(150) < 25).astype(int)
        pair = [best_split(x[actions == a], q[actions == a], min_leaf=10) for a in (0, 1)]
        ratios = [
            s.scaled_statistic / critical_value(n, 0.01, min_side=10)
            for s, n in zip(pair, (125, 25), strict=True)
        ]
        calibrated = best_split(x, q, actions=actions, score="calibrated")
        assert calibrated.action == int(np.argmax(ratios))
        differing += calibrated.action != best_split(x, q, actions=actions).action
    assert differing > 0


def test_centred_returns_forget_the_mean_of_the_action():
    generator = np.random.default_rng(8)
    x = np.arange(200.0)[:, None]
    actions = (generator.random(200) < x[:, 0] / 200).astype(np.int64)
    sample = LeafSample(x, 10.0 * actions + generator.normal(size=200), actions)
    pooled = KolmogorovSmirnov(compare="pooled").best(sample)
    centred = KolmogorovSmirnov(compare="centred").best(sample)
    assert pooled.scaled_statistic > 3.0 > 2.2 > centred.scaled_statistic


def test_a_minimum_share_keeps_cuts_off_the_edges():
    q = np.concatenate([np.ones(20), np.zeros(180)])
    sample = LeafSample(np.arange(200.0)[:, None], q, np.zeros(200, np.int64))
    assert KolmogorovSmirnov().best(sample).n_left == 20
    assert KolmogorovSmirnov(min_share=0.25).best(sample).n_left == 50


def test_a_threshold_separates_neighbours_one_ulp_apart():
    for low in (1.0, -1.0, 0.0, 5e-324, 1.7e308, -1.7e308, 0.1):
        for _ in range(20):
            high = np.nextafter(low, np.inf)
            split = best_split([[low], [high]], [0.0, 1.0], min_leaf=1)
            assert low <= split.threshold < high
            low = high


@pytest.mark.promise(16)
def test_the_first_cut_and_the_lowest_feature_win_ties():
    x = np.repeat(np.arange(8.0)[:, None], 3, axis=1)
    split = best_split(x, [0, 1, 0, 1, 0, 1, 0, 1], min_leaf=1)
    assert (split.feature, split.n_left) == (0, 1)
    mirrored = best_split(x[:, :1], [0, 0, 1, 1, 1, 1, 0, 0], min_leaf=1)
    assert mirrored.n_left == 2  # a cut after 6 is as good


def test_nothing_to_tell_apart_is_no_split():
    x = np.arange(40.0)[:, None]
    assert best_split(x, np.zeros(40)) is None
    assert best_split(np.zeros((40, 1)), np.arange(40.0)) is None
    assert best_split(x[:19], np.arange(19.0)) is None
    assert best_split(np.empty((0, 2)), []) is None
    assert best_split(np.empty((0, 2)), [], actions=np.empty(0, int)) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_refuses_what_is_not_finite(value):
    with pytest.raises(InvalidArgumentError, match=r"observations must be finite.* at \[1, 0\]"):
        best_split([[0.0], [value]], [0.0, 1.0])
    with pytest.raises(InvalidArgumentError, match=r"returns must be finite, got .* at \[0\]"):
        best_split([[0.0], [1.0]], [value, 1.0])


def test_refusals_name_the_argument(monkeypatch):
    x, q = np.zeros((3, 1)), np.zeros(3)
    with pytest.raises(InvalidArgumentError, match="returns must have 3 entries, got 2"):
        best_split(x, q[:2])
    with pytest.raises(InvalidArgumentError, match="actions must have 3 entries, got 2"):
        best_split(x, q, actions=[0, 1])
    with pytest.raises(InvalidArgumentError, match="observations must have at least one column"):
        best_split(np.zeros((3, 0)), q)
    with pytest.raises(InvalidArgumentError, match=r"unknown score 'scale'. Did you mean 'scaled'"):
        best_split(x, q, score="scale")
    with pytest.raises(InvalidArgumentError, match="min_leaf must be an integer >= 1, got 0"):
        best_split(x, q, min_leaf=0)
    monkeypatch.setattr(_kernels, "LARGEST", 2)
    with pytest.raises(InvalidArgumentError, match="returns must have at most 2 entries, got 3"):
        best_split(x, q)


@pytest.mark.skipif(not compiled.ENABLED, reason="nothing is compiled")
def test_read_only_and_strided_arrays_are_not_compiled_for_again():
    x, q = np.arange(60.0).reshape(30, 2), np.arange(30.0)
    expected = best_split(x, q)
    n_signatures = len(_kernels.best_of_sample.signatures)
    frozen_x, frozen_q = x.copy(), q.copy()
    frozen_x.setflags(write=False)
    frozen_q.setflags(write=False)
    assert best_split(frozen_x, frozen_q) == expected
    assert best_split(np.asfortranarray(x), np.repeat(q, 2)[::2]) == expected
    assert best_split(x, q.astype(np.float32), actions=np.zeros(30, np.int32)) is not None
    sample = LeafSample(frozen_x, frozen_q, np.zeros(30, np.int64))
    assert KolmogorovSmirnov().best(sample) is not None
    assert len(_kernels.best_of_sample.signatures) == n_signatures


class TestOldBugs:
    """Mistakes of other implementations of Continuous U-Tree, each with a case that shows it."""

    def test_tuples_are_sorted_by_the_attribute_not_by_the_return(self):
        """Sorted by q, every sample has a perfect cut; here x says nothing about q."""
        x = np.array([[4.0], [1.0], [3.0], [2.0]])
        assert best_split(x, [1.0, 0.0, 0.0, 1.0], min_leaf=2) is None

    def test_the_threshold_comes_from_the_sorted_attribute(self):
        """Read from the unsorted list, the threshold cuts somewhere else than the test did."""
        generator = np.random.default_rng(2)
        x = generator.permutation(100).astype(float)[:, None]
        split = best_split(x, (x[:, 0] > 41).astype(float))
        assert split.threshold == 41.5
        assert split.n_left == 42

    def test_the_threshold_is_the_chosen_cut_not_the_middle_of_the_box(self):
        """A node that splits its box in half ignores where the returns change."""
        x = np.linspace(0.0, 1.0, 101)[:, None]
        assert best_split(x, (x[:, 0] > 0.8).astype(float)).threshold == pytest.approx(0.805)

    def test_thresholds_and_returns_are_not_integers(self):
        """Stored as integers, 0.3 and 0.4 become one value."""
        x = np.repeat([[0.3], [0.4]], 10, axis=0)
        split = best_split(x, np.repeat([0.1, 0.2], 10))
        assert 0.3 <= split.threshold < 0.4
        assert split.statistic == 1.0

    def test_siblings_are_compared_not_a_child_with_its_parent(self):
        """Against the whole parent a perfect cut in the middle has D = 1/2 only."""
        x = np.arange(40.0)[:, None]
        assert best_split(x, (x[:, 0] >= 20).astype(float)).statistic == 1.0

    def test_the_best_candidate_wins_and_not_the_first_that_passes(self):
        """Feature 0 passes the test; feature 1 is better, and must not inherit its leftovers."""
        generator = np.random.default_rng(4)
        x = generator.normal(size=(400, 2))
        q = (x[:, 0] > 0) + 3.0 * (x[:, 1] > 0)
        split = best_split(x, q)
        alone = best_split(x[:, 1:], q)
        assert split.feature == 1
        assert (split.threshold, split.statistic) == (alone.threshold, alone.statistic)

    def test_equal_values_are_never_cut_apart(self):
        """The best position lies within equal values: no threshold can reach it."""
        x = np.repeat([[0.0], [1.0], [2.0]], [10, 30, 10], axis=0)
        q = (np.arange(50) >= 25).astype(float)
        split = best_split(x, q)
        assert split.n_left in (10, 40)
        assert split.n_left == (x[:, 0] <= split.threshold).sum()

    def test_every_cut_is_tried(self):
        """Every hundredth cut only: a change after row 1049 of 2000 would be missed."""
        x = np.arange(2000.0)[:, None]
        assert best_split(x, (x[:, 0] > 1049).astype(float)).n_left == 1050


def test_naive_twin_agrees_with_itself():
    """The two oracles, one from the definition and one incremental, find the same cut."""
    generator = np.random.default_rng(1)
    for case in range(30):
        x, q = tied_sample(generator, case, largest=12)
        one = naive.best_cut(x, q, min_leaf=1, score="scaled")
        two = naive.integer_best_cut(x, q, min_leaf=1, score="scaled")
        assert (one and one[1:]) == (two and two[1:])
