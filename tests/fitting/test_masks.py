"""Fitting to demonstrations in which actions were masked."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.data.episode import allowed_in
from eutree.distillation import DistillationSettings, distill
from eutree.fitting.diagnosis import Harm, about_size, in_words
from eutree.fitting.playing import repairs

ID = "Gates-v0"


class Gates(gymnasium.Env):
    """Right is 0 below the middle and 2 above it; 1 is half as good; each is barred at times."""

    max_steps = 20
    observation_space = spaces.Box(0.0, 1.0, (2,), np.float64)
    action_space = spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.n_steps = 0
        return self.draw(), {"action_mask": self.mask}

    def draw(self):
        self.x = self.np_random.random(2)
        self.mask = (self.np_random.random(3) < 0.6).astype(np.int8)
        self.mask[0] |= not self.mask.any()
        return self.x

    def step(self, action):
        reward = 1.0 if action == wanted(self.x) else 0.5 * (action == 1)
        self.n_steps += 1
        return self.draw(), reward, self.n_steps >= 20, False, {"action_mask": self.mask}


def wanted(observation):
    """Return the right action; where it is barred, the first that is not is taken for it."""
    return 2 if observation[0] > 0.5 else 0


@pytest.fixture(scope="module", autouse=True)
def registered():
    gymnasium.register(ID, entry_point=Gates)
    yield
    del gymnasium.registry[ID]


@pytest.fixture(scope="module")
def demos():
    return eutree.record(ID, wanted, episodes=10, seed=0)


@pytest.fixture(scope="module")
def report(demos):
    return eutree.fit(demos, episodes=20)


def test_a_leaf_falls_back_on_what_was_shown_in_it(demos, report):
    policy = report.policy
    decided, _ = policy.predict(demos.observations, action_masks=allowed_in(demos))
    assert np.array_equal(decided, demos.actions)
    assert policy.leaves.visits.sum() == demos.n_transitions
    against = eutree.evaluate(policy, ID, episodes=50, seed=1).mean_return
    assert against > eutree.evaluate(wanted, ID, episodes=50, seed=1).mean_return - 0.1


def test_steps_at_which_the_mask_decided_are_no_fault_of_the_tree(demos, report):
    assert report.training_accuracy == 1.0
    assert report.warnings == ()
    one = eutree.fit(eutree.record(ID, lambda seen: 1, episodes=5, seed=0), episodes=0)
    assert one.policy.n_leaves == 1
    assert not any("single leaf" in warning for warning in one.warnings)


def test_a_single_leaf_is_said_to_take_its_action_where_it_is_allowed():
    """It was said to take it always, though it takes another where that one is masked."""
    chance = np.random.default_rng(0)
    demos = eutree.record(ID, lambda seen: int(2 * (chance.random() < 0.8)), episodes=5, seed=0)
    policy = replace(eutree.fit_expert_tree(demos), masked=True)
    one = replace(policy, tree=eutree.DecisionTree.single_leaf(2), actions=[2], leaves=None)
    (said,) = about_size(one, demos)
    assert "it takes action_2 wherever it is allowed, although" in said
    (always,) = about_size(replace(one, masked=False), demos)
    assert "it always takes action_2, although" in always
    harm = Harm(0, "timeout", 1.0, 1.0, holds_on=False, shown=(40, 0, 60))
    said = in_words(harm, one, 100)
    assert "so it takes action_2 wherever it is allowed." in said
    assert "pass through leaf 0 (action_2 everywhere). There" in said


def test_a_repaired_tree_keeps_no_visits_of_other_leaves(demos, report):
    repaired = [policy for leaf in (0, 1) for policy, _ in repairs(report.policy, demos, leaf)]
    assert repaired
    assert all(policy.leaves is None for policy in repaired)


def test_distilling_counts_the_teachers_actions_under_masks():
    settings = DistillationSettings(iterations=2, episodes=5, validation_episodes=2)
    _, told = distill(wanted, ID, settings)
    assert min(made.agreement for made in told.rounds) > 0.9
