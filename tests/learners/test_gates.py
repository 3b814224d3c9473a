"""The gate of Conservative Q-Improvement: a cut is made only if the policy gains enough by it."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from eutree.errors import FormatError
from eutree.learners import PRESETS, Problem, Start, Step
from eutree.learners.choices import with_choices
from eutree.learners.gates import AnyGain, ConservativeImprovement, expected_gain
from eutree.learners.registry import from_document, to_document
from eutree.learners.restoring import checked_state
from eutree.schema import Schema
from eutree.splitting import LeafSample, Maximal, Split

FAST = replace(PRESETS["corrected"], retest_growth=1.0, solve_growth=1.0)


def sample_of(rows):
    """Return a leaf's tuples from (feature, action, q), and the cut of the feature at 0.5."""
    x, actions, returns = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
    left = int((x <= 0.5).sum())
    split = Split(
        feature=0, threshold=0.5, statistic=0.0, scaled_statistic=0.0,
        n_left=left, n_right=len(x) - left,
    )  # fmt: skip
    return LeafSample(x[:, None].copy(), returns, actions.astype(np.int64)), split


def spelled_out(sample, split, greedy, share):
    """The formula of the module, in sums over the tuples."""
    rows = list(zip(sample.observations[:, 0], sample.actions, sample.returns, strict=True))

    def q(action, side):
        mine = [r for x, a, r in rows if a == action and side(x)]
        return sum(mine) / len(mine) if mine else None

    total = 0.0
    for side in (lambda x: x <= split.threshold, lambda x: x > split.threshold):
        kept = q(greedy, side)
        if kept is None:
            kept = q(greedy, lambda x: True)
        known = [value for value in (q(a, side) for a in range(4)) if value is not None]
        total += len([x for x, _, _ in rows if side(x)]) / len(rows) * (max([*known, kept]) - kept)
    return share * total


@pytest.mark.parametrize("seed", range(20))
def test_the_gain_is_that_of_the_formula(seed):
    generator = np.random.default_rng(seed)
    n = int(generator.integers(3, 40))
    rows = list(
        zip(generator.random(n), generator.integers(3, size=n), generator.normal(size=n),
            strict=True)
    )  # fmt: skip
    sample, split = sample_of(rows)
    greedy = int(sample.actions[0])
    found = expected_gain(split, sample, greedy, 0.3)
    assert found == pytest.approx(spelled_out(sample, split, greedy, 0.3), abs=1e-12)
    assert found >= 0.0


def test_known_gains():
    swapped = [(0, 0, 10.0), (0, 1, 0.0), (1, 0, 0.0), (1, 1, 6.0)] * 5
    sample, split = sample_of(swapped)  # a side each is best: half of the visits gain 6
    assert expected_gain(split, sample, 0, 1.0) == pytest.approx(3.0)
    assert expected_gain(split, sample, 0, 0.1) == pytest.approx(0.3)
    level = [(0, 0, 10.0), (0, 1, 0.0), (1, 0, 5.0), (1, 1, 1.0)] * 5
    sample, split = sample_of(level)  # returns differ, the best action does not
    assert expected_gain(split, sample, 0, 1.0) == 0.0
    half_tried = [(0, 0, 2.0)] * 4 + [(1, 1, 5.0)] * 4
    sample, split = sample_of(half_tried)  # where a* was not tried, its q is the leaf's
    assert expected_gain(split, sample, 0, 1.0) == pytest.approx(0.5 * 3.0)
    assert expected_gain(split, sample, 3, 1.0) == 0.0


def test_the_first_cut_of_an_exclusive_or_gains_nothing():
    rows = [(x, a, float((x ^ y) == a)) for x, y, a in product((0, 1), repeat=3)] * 10
    sample, split = sample_of(rows)
    assert expected_gain(split, sample, 0, 1.0) == 0.0


def test_the_threshold_decays_with_steps_and_is_exclusive():
    gate = ConservativeImprovement(threshold=8.0, decay=0.5)
    assert [gate.admits(lambda: 1.0, steps) for steps in range(6)] == [False] * 4 + [True] * 2
    assert not ConservativeImprovement(threshold=0.0).admits(lambda: 0.0, 10**9)
    assert AnyGain().admits(lambda: 1 / 0, 0)  # nothing is computed that nobody asks for


def test_a_refused_leaf_is_looked_at_again():
    gate = ConservativeImprovement(threshold=1e9, decay=1.0)
    learner = replace(ASIDE, retest_growth=1.5, gate=gate).start(Sorting(2).problem, Start())
    world = Sorting(2)
    world.run(learner)
    learner.update(world.generator)
    assert learner._tests.tested_at.tolist() == [0]


class Sorting:
    """Single steps: x is drawn from [0, 1); its bin, of as many as actions, is the right action."""

    def __init__(self, bins):
        self.bins = bins
        self.problem = Problem(Schema.anonymous(1, bins))
        self.generator = np.random.default_rng(bins)

    def run(self, learner, episodes=60):
        for _ in range(episodes):
            x = self.generator.random()
            learner.start_episode(np.array([x]), self.generator)
            action = learner.act()
            reward = 10.0 * (action == int(x * self.bins)) + self.generator.random()
            learner.observe(Step(action, reward, np.array([x]), terminated=True, truncated=False))
            learner.end_episode()


ASIDE = replace(FAST, exploration=1.0, significance=Maximal(alpha=0.01))


def test_only_cuts_that_gain_are_made():
    for gate, n_leaves in (
        (AnyGain(), 2),
        (ConservativeImprovement(threshold=4.0, decay=1.0), 2),  # it gains 5
        (ConservativeImprovement(threshold=6.0, decay=1.0), 1),
    ):
        world = Sorting(2)
        learner = replace(ASIDE, gate=gate).start(world.problem, Start())
        world.run(learner, 400)
        learner.update(world.generator)
        assert learner.tree.n_leaves == n_leaves


def test_a_split_puts_the_threshold_back():
    gate = ConservativeImprovement(threshold=20.0, decay=0.995)
    world, made = Sorting(4), []  # every cut in the middle of a leaf gains 2.5
    learner = replace(ASIDE, gate=gate).start(world.problem, Start())
    for _ in range(25):
        world.run(learner)
        splits = learner.update(world.generator).splits
        assert len(splits) <= 1
        made += [learner.history.n_seen] * len(splits)
    waits = np.diff([0, *made])
    assert len(made) >= 2
    assert waits.min() >= 277  # 20 * 0.995 ** 277 is 5


def test_restored_it_goes_on_to_the_same_bytes(tmp_path):
    method = replace(ASIDE, gate=ConservativeImprovement(threshold=5.0, decay=0.998))
    world = Sorting(2)
    learner = method.start(world.problem, Start())
    for _ in range(12):
        world.run(learner)
        learner.update(world.generator)
    state = learner.state()
    assert state["split_at"][0] > 0
    checked_state(tmp_path / "x.npz", state, method, world.problem, Start())
    twin = method.restore(world.problem, Start(), state)
    for one in (learner, twin):
        world = Sorting(2)
        world.run(one, 300)
        one.update(world.generator)
    assert {k: v.tobytes() for k, v in twin.state().items()} == {
        k: v.tobytes() for k, v in learner.state().items()
    }
    late = state | {"split_at": np.array([10**9])}
    with pytest.raises(FormatError, match="split_at"):
        checked_state(tmp_path / "x", late, method, world.problem, Start())


def test_it_is_chosen_by_name_and_its_choices_with_it():
    method = with_choices(
        PRESETS["paper"], {"gate.threshold": 0.5, "gate.type": "ConservativeImprovement"}
    )
    assert method.gate == ConservativeImprovement(threshold=0.5)
    assert from_document(to_document(method)) == method
