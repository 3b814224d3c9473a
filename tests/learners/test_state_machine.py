"""Tree, history and MDP under any order of episodes, splits, new trees and saves."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)

from eutree.files import read_arrays, write_arrays
from eutree.learners import PAPER, Start, Step, UTree
from eutree.learners.history import TERMINAL
from eutree.mdp import TransitionCounts
from eutree.splitting import Split
from eutree.trees import DecisionTree
from tests import naive_learning
from tests.worlds import Walk

NUMBERS = st.sampled_from([-1.0, -0.5, 0.0, 0.25, 0.5, 1.0])  # few, so that they meet thresholds


@pytest.mark.promise(19)
class Learner(RuleBasedStateMachine):
    """A learner beside the list of all its transitions; after each rule all is built anew."""

    max_transitions: int | None = None

    @initialize(discount=st.sampled_from([0.9, 1.0]))
    def start(self, discount):
        self.settings = replace(PAPER, discount=discount, max_transitions=self.max_transitions)
        self.learner = UTree(DecisionTree.single_leaf(2), 2, self.settings)
        self.rows = []

    @rule(data=st.data(), length=st.integers(1, 6), ending=st.sampled_from(["end", "cut", "stop"]))
    def add_episode(self, data, length, ending):
        """Add an episode that terminates or is truncated; or discard it before its end."""
        learner = self.learner
        observations = [np.array(data.draw(st.tuples(NUMBERS, NUMBERS))) for _ in range(length + 1)]
        learner.start_episode(observations[0], np.random.default_rng(0))
        for step in range(length):
            action, reward = data.draw(st.integers(0, 1)), data.draw(st.sampled_from([0.1, -2.0]))
            if ending == "stop" and step == length - 1:
                learner.discard_episode()
                return
            last = step == length - 1
            terminated, truncated = last and ending == "end", last and ending == "cut"
            before, after = observations[step], observations[step + 1]
            learner.observe(Step(action, reward, after, terminated, truncated))
            if ending != "stop":
                self.rows.append((before, action, reward, after, terminated))
        if ending != "stop":
            learner.end_episode()

    @rule(data=st.data(), feature=st.integers(0, 1), threshold=NUMBERS)
    def split(self, data, feature, threshold):
        """Split any leaf anywhere, also so that one side is empty."""
        leaf = data.draw(st.integers(0, self.learner.tree.n_leaves - 1))
        made = self.learner._split(leaf, Split(feature, threshold, 1.0, 1.0, 1, 1))
        tree = self.learner.tree
        self.learner.tree = tree.split_each([(made.leaf, made.feature, made.threshold)])

    @rule(seed=st.integers(0, 9))
    def update(self, seed):
        self.learner.update(np.random.default_rng(seed))

    @rule()
    def save_and_load(self):
        """Go on with what a file gives back, which saves to the same bytes again."""
        with TemporaryDirectory() as folder:
            path = Path(folder) / "learner.npz"
            write_arrays(path, self.learner.state())
            saved = path.read_bytes()
            self.learner = self.settings.restore(Walk.problem, Start(), read_arrays(path))
            write_arrays(path, self.learner.state())
            assert path.read_bytes() == saved

    @invariant()
    def history_holds_every_transition(self):
        history = self.learner.history
        columns = zip(
            history.observations.tolist(),
            history.actions.tolist(),
            history.rewards.tolist(),
            history.next_observations.tolist(),
            (history.entered == TERMINAL).tolist(),
            strict=True,
        )
        wanted = [(o.tolist(), a, r, p.tolist(), t) for o, a, r, p, t in self.rows]
        stored = list(columns)
        if self.max_transitions is None:
            assert stored == wanted
        else:
            assert len(stored) <= self.max_transitions
            ahead = iter(wanted)
            assert all(row in ahead for row in stored)  # some of them, in order

    @invariant()
    def labels_and_lists_follow_from_the_tree(self):
        history, tree = self.learner.history, self.learner.tree
        left, entered = naive_learning.labels_of(tree, history)
        assert history.left.tolist() == left
        assert history.entered.tolist() == entered
        for leaf in range(tree.n_leaves):
            assert history.leaving.of(leaf).tolist() == naive_learning.rows_of(left, leaf)
            assert history.entering.of(leaf).tolist() == naive_learning.rows_of(entered, leaf)

    @invariant()
    def counts_equal_a_recount(self):
        mine, history = self.learner.mdp, self.learner.history
        n_leaves = self.learner.tree.n_leaves
        visits, sums = np.zeros((n_leaves, 2)), np.zeros((n_leaves, 2))
        successors = Counter()
        rows = zip(history.left, history.actions, history.rewards, history.entered, strict=True)
        for leaf, action, reward, entered in rows:
            visits[leaf, action] += 1
            sums[leaf, action] += reward
            successors[leaf, action, entered] += 1
        assert mine.counts.visits.tolist() == visits.tolist()
        np.testing.assert_allclose(mine.counts.reward_sums, sums, rtol=1e-12, atol=1e-12)
        for leaf in range(n_leaves):
            for action in range(2):
                found = mine.counts.successors(leaf, action)
                counted = {k[2]: n for k, n in successors.items() if k[:2] == (leaf, action)}
                assert dict(zip(found[0].tolist(), found[1].tolist(), strict=True)) == counted


Learner.TestCase.settings = settings(max_examples=25, stateful_step_count=20, deadline=None)
TestLearner = Learner.TestCase


@pytest.mark.promise(19)
class Forgetful(Learner):
    """The same learner when it may remember a few transitions only."""

    max_transitions = 9


Forgetful.TestCase.settings = Learner.TestCase.settings
TestForgetful = Forgetful.TestCase


def test_the_machine_catches_a_split_that_forgets_to_relabel(monkeypatch):
    """The control: counts that a split leaves as they were are found."""
    monkeypatch.setattr(TransitionCounts, "relabel", lambda *_, **__: None)
    quick = settings(
        Learner.TestCase.settings,
        database=None,
        max_examples=300,
        derandomize=True,
        phases=[Phase.generate],  # the smallest example is not needed here
        report_multiple_bugs=False,
    )
    with pytest.raises(AssertionError):
        run_state_machine_as_test(Learner, settings=quick)
