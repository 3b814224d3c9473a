"""Which of two trees is believed to be the better, by episodes that neither was fitted to."""

import dataclasses

import numpy as np
import pytest

from eutree.data import Demonstrations, Episode
from eutree.evaluation import off_policy
from eutree.evaluation.log_gains import FittedLog, Gains, cuts
from eutree.evaluation.off_policy import FEWEST_HELD_OUT, Judge, hold_out
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from tests.worlds import ROOM, room_episode

SEEDS = range(6)


def heats_below(threshold):
    tree = DecisionTree.single_leaf(2).split(0, 0, threshold)
    return TreePolicy(tree=tree, actions=np.array([1, 0]), schema=ROOM)


OPERATOR = heats_below(22.0)  # what the log shows, with one action in ten at random


def compared(policy, seed, n_episodes=24):
    generator = np.random.default_rng(seed)
    log = [room_episode(generator, OPERATOR.act, random=0.1) for _ in range(n_episodes)]
    known, held_out = hold_out(log, generator)
    judge = Judge(
        other=OPERATOR, known=known, held_out=held_out, discount=0.99, generator=generator
    )
    return judge.of(policy)


@pytest.mark.parametrize("threshold", [22.5, 25.0])
def test_a_worse_tree_is_not_believed(threshold):
    found = [compared(heats_below(threshold), seed) for seed in SEEDS]
    assert not any(one.believed for one in found)
    assert np.mean([one.gain for one in found]) < 0.0


def test_a_better_tree_is_believed_where_the_log_is_long_enough():
    found = [compared(heats_below(20.5), seed, n_episodes=360) for seed in SEEDS]
    believed = [one for one in found if one.believed]
    assert len(believed) >= 3
    said = believed[0].describe()
    assert "believed to beat fit: by single deviations +" in said
    assert "if single deviations add up, and no episode speaks against it more strongly" in said


def test_deviations_that_gain_one_by_one_are_not_enough():
    """Never to heat pays at 22 degrees, but ends in the cold, which the world model predicts."""
    found = [compared(heats_below(15.0), seed) for seed in SEEDS]
    assert np.mean([one.gain for one in found]) > 0.0
    assert all(one.predicted < 0.0 for one in found[:3])
    assert sum(one.believed for one in found) <= 1


def test_the_same_tree_gains_nothing():
    found = compared(heats_below(22.0), 0)
    assert (found.gain, found.believed, found.tried) == (0.0, False, 0)
    assert found.low <= 0.0
    assert "this is the tree of fit" in found.describe()


def test_too_few_episodes_decide_nothing():
    generator = np.random.default_rng(0)
    log = [room_episode(generator, OPERATOR.act) for _ in range(3 * FEWEST_HELD_OUT - 1)]
    known, held_out = hold_out(log, generator)
    assert (len(known), held_out) == (len(log), ())
    judge = Judge(
        other=OPERATOR, known=known, held_out=held_out, discount=0.99, generator=generator
    )
    found = judge.of(heats_below(20.0))
    assert not found.believed
    assert found.facts() == {
        "gain": None,
        "low": None,
        "predicted": None,
        "n_held_out": 0,
        "believed": False,
        "condition": "",
        "tried": 0,
        "needed": 0,
    }
    assert "0 episodes could be held out" in found.describe()


def test_one_deviation_is_estimated_without_bias():
    """One step, two actions of chances 3/4 and 1/4 that earn 1 and 3: the other one gains 2."""
    generator = np.random.default_rng(1)
    one, two = (
        TreePolicy(tree=DecisionTree.single_leaf(1), actions=np.array([a]),
                   schema=Schema.anonymous(1, 2))
        for a in (1, 0)
    )  # fmt: skip

    def episode():
        action = int(generator.random() < 0.25)
        reward = 3.0 if action else 1.0
        return Episode(generator.random((2, 1)), [action], [reward], True, False)

    judge = Judge(
        other=two,
        known=[episode() for _ in range(4000)],
        held_out=[episode() for _ in range(4000)],
        discount=1.0,
        generator=generator,
    )
    found = judge.of(one)
    assert abs(found.gain - 2.0) < 0.2
    assert 1.5 < found.low < 2.0
    assert np.isnan(found.predicted)
    assert "if no episode returns less than 1 or more than 3" in found.describe()


def test_held_out_episodes_are_a_third_and_nothing_is_in_both():
    log = [room_episode(np.random.default_rng(k), OPERATOR.act, steps=2) for k in range(20)]
    known, held_out = hold_out(log, np.random.default_rng(3))
    assert (len(known), len(held_out)) == (14, 6)
    assert {id(e) for e in known} | {id(e) for e in held_out} == {id(e) for e in log}
    assert pytest.approx(1 / 3) == off_policy.HELD_OUT


TWO = Schema.anonymous(2, 2)


def chooses(threshold):
    tree = DecisionTree.single_leaf(2).split(0, 0, threshold)
    return TreePolicy(tree=tree, actions=np.array([0, 1]), schema=TWO)


def two_step_log(seed, reward, n_episodes=120):
    """Return episodes of two steps whose actions are random; reward of (0 or 1, generator)."""
    generator = np.random.default_rng(seed)

    def episode():
        seen = generator.random((3, 2))
        actions = generator.integers(0, 2, 2)
        rewards = [
            reward(bool(a and x <= 0.5), generator)
            for a, x in zip(actions, seen[:-1, 0], strict=True)
        ]
        return Episode(seen, actions, rewards, terminated=True, truncated=False)

    return [episode() for _ in range(n_episodes)]


def rarely_lost(departs, generator):
    return 0.1 - 40.0 * (generator.random() < 0.005) if departs else 0.0


def of_log(log, seed=0, learned=0.0, **options):
    known, held_out = hold_out(log, np.random.default_rng(seed))
    generator = np.random.default_rng(seed)
    judge = Judge(
        other=chooses(0.5), known=known, held_out=held_out,
        discount=0.99, generator=generator, **options,
    )  # fmt: skip
    return judge.of(chooses(learned))


def test_rare_losses_that_were_not_seen_are_no_gain_where_the_range_is_known():
    """The action pays 0.1 and loses 40 in one of 200 cases: Student mostly believed in it."""
    believed = [
        of_log(two_step_log(seed, rarely_lost, 450), return_range=(-80.0, 0.2)).believed
        for seed in range(20)
    ]
    assert sum(believed) == 0


def test_where_the_range_is_not_known_the_sentence_has_the_condition():
    without_loss = [
        log
        for log in (two_step_log(seed, rarely_lost, 700) for seed in range(30))
        if min(episode.undiscounted_return for episode in log) >= 0.0
    ]
    found = of_log(without_loss[0])
    assert found.believed
    assert found.describe().endswith(
        "if no episode returns less than 0 or more than 0.2, the worst and the best seen"
    )
    assert found.facts()["condition"].startswith("if no episode returns less than 0")


def test_actions_that_were_hardly_tried_are_not_believed_in_without_a_range():
    def paying(departs, generator):
        return 5.0 * departs + 0.3 * generator.normal()

    log = two_step_log(0, paying, 180)
    unknown, known = of_log(log), of_log(log, return_range=(-4.0, 14.0))
    assert unknown.low > 0.0
    assert unknown.tried < unknown.needed
    assert not unknown.believed
    assert f"it was followed at {unknown.tried} steps at which they differ, and 300 are needed" in (
        unknown.describe()
    )
    assert known.believed
    assert known.condition == ""


def gain_by_hand(episode, chance):
    """Return the number of an episode, from the definition: weights of both trees, by loops."""
    weights = [1.0, 1.0]
    first = None
    for k, action in enumerate(episode.actions.tolist()):
        x = episode.observations[k, 0]
        wanted = [int(x > 0.0), int(x > 0.5)]
        if wanted[0] == wanted[1]:
            continue
        first = k if first is None else first
        for tree in (0, 1):
            weights[tree] *= (action == wanted[tree]) / chance(k)[wanted[tree]]
    return weights[0] - weights[1], first


def test_the_gain_of_whole_episodes_is_that_of_its_twin():
    log = two_step_log(5, lambda departs, generator: departs + generator.normal(), 60)
    known, held_out = log[:40], log[40:]
    fitted = FittedLog(known, 2, 0.99)
    limits = (-9.0, 9.0)
    found = fitted.gains(chooses(0.0), chooses(0.5), held_out, limits, most_weight=1000.0)
    assert found.whole
    for value, episode in zip(found.values, held_out, strict=True):
        weight, first = gain_by_hand(episode, lambda k, e=episode: fitted.told(e).chances[k])
        if first is None:
            assert value == 0.0
            continue
        ahead = float(fitted._value.predict(episode.observations[first : first + 1])[0])
        usual = episode.rewards[:first].sum() + ahead
        assert value == pytest.approx(weight * (episode.rewards.sum() - usual))
        assert value >= found.worst


def test_a_tree_is_cut_to_what_held_out_episodes_support():
    """Of eight leaves one split is worth something; the others are noise."""
    tree = DecisionTree.single_leaf(2).split(0, 0, 0.5)
    for leaf, threshold in ((0, 0.2), (1, 0.4), (2, 0.45)):
        tree = tree.split(leaf, 1, threshold)
    noisy = TreePolicy(tree=tree, actions=np.array([1, 1, 0, 1, 1]), schema=TWO)
    log = two_step_log(1, lambda departs, generator: 2.0 * departs + 0.3 * generator.normal(), 400)
    known, held_out = hold_out(log, np.random.default_rng(0))
    judge = Judge(
        other=chooses(0.5), known=known, held_out=held_out, discount=0.99,
        generator=np.random.default_rng(0), return_range=(-3.0, 7.0),
    )  # fmt: skip
    chosen, found = judge.chosen(noisy)
    assert found.believed
    assert chosen.n_leaves < noisy.n_leaves
    assert judge.of(chosen).gain >= judge.of(noisy).gain - 0.1


def test_locked_leaves_are_not_cut():
    tree = chooses(0.2)
    locked = dataclasses.replace(tree, locked=(0,))
    log = FittedLog(two_step_log(1, rarely_lost, 20), 2, 0.99)
    assert cuts(locked, log) == [locked]
    assert len(cuts(tree, log)) == 2


def masked_log(seed, reward, n_episodes=900):
    """Return episodes of a step: half are free, where 1 is taken in three of ten, half forced to 0.

    The reward is of whether the step was free, and of the action.
    """
    generator = np.random.default_rng(seed)

    def episode():
        free = bool(generator.random() < 0.5)
        action = int(free and generator.random() < 0.3)
        return Episode(
            generator.random((2, 2)), [action], [reward(free, action)], terminated=True,
            truncated=False, steps={"allowed": np.array([[True, free]])},
        )  # fmt: skip

    return [episode() for _ in range(n_episodes)]


def of_masked_log(seed, reward):
    log = masked_log(seed, reward)
    known, held_out = hold_out(log, np.random.default_rng(seed))
    judge = Judge(
        other=chooses(1.0), known=known, held_out=held_out, discount=0.99,
        generator=np.random.default_rng(seed), return_range=(0.0, 1.0),
    )  # fmt: skip
    return judge.of(chooses(0.0))


def test_a_tree_gains_only_where_its_action_was_allowed():
    """Forced steps earn nothing, whoever decides: they speak for no tree."""
    worse = [
        of_masked_log(seed, lambda free, action: free * (0.6 - 0.1 * action)) for seed in SEEDS
    ]
    better = [of_masked_log(seed, lambda free, action: float(action)) for seed in SEEDS]
    assert np.mean([one.gain for one in worse]) == pytest.approx(-0.05, abs=0.03)
    assert np.mean([one.gain for one in better]) == pytest.approx(0.5, abs=0.05)
    assert not any(one.believed for one in worse)
    assert all(one.believed and one.low < 0.5 for one in better)


def test_the_chances_of_masked_actions_are_those_among_the_allowed():
    """Of three actions the one that is seldom allowed is taken most where it is."""
    generator = np.random.default_rng(0)
    liking = np.array([1.0, 2.0, 5.0])

    def episode():
        allowed = generator.random((10, 3)) < (0.95, 0.5, 0.2)
        allowed[~allowed.any(axis=1), 0] = True
        chances = liking * allowed / (liking * allowed).sum(axis=1, keepdims=True)
        actions = [generator.choice(3, p=row) for row in chances]
        return Episode(
            generator.random((11, 2)), actions, np.zeros(10), terminated=True, truncated=False,
            steps={"allowed": allowed},
        ), chances  # fmt: skip

    log = [episode() for _ in range(500)]
    fitted = FittedLog([one for one, _ in log], 3, 0.99)
    told = np.concatenate([fitted.told(one).chances for one, _ in log])
    assert np.abs(told - np.concatenate([chances for _, chances in log])).mean() < 0.02
    assert not told[~np.concatenate([one.allowed for one, _ in log])].any()


def lasting(first, n, ended=True):
    """Return an episode of n steps of -1 in which an action decides at the first one."""
    places = np.column_stack([np.arange(n + 1.0), np.full(n + 1, float(first))])
    places[0, 1] = 0.5
    ending = "" if ended else "stopped"
    actions = [first] + [0] * (n - 1)
    return Episode(places, actions, -np.ones(n), terminated=ended, truncated=False, ending=ending)


def first_action(action):
    """Return the tree that begins with an action, and goes on with 0."""
    tree = DecisionTree.single_leaf(2).split(0, 0, 0.5)
    return TreePolicy(tree, np.array([action, 0]), Schema.anonymous(2, 2))


def test_of_an_episode_that_was_stopped_the_worst_is_taken():
    """Those that a person stopped after 5 of 100 steps of -1 seemed better than 20 steps."""
    chosen = np.random.default_rng(0).random(300) < 0.5
    log = [lasting(1, 5, ended=False) if one else lasting(0, 20) for one in chosen.tolist()]
    shown = Demonstrations(tuple(log), Schema.anonymous(2, 2))
    found = off_policy.Log.of(shown, first_action(0), (-100.0, 0.0), seed=0)
    _, judged = found.chosen(first_action(1), discount=0.99)
    assert judged.gain < -50.0
    assert not judged.believed
    unknown = dataclasses.replace(found, return_range=None)
    assert not unknown.chosen(first_action(1), discount=0.99)[1].believed


def test_a_choice_that_is_rare_but_free_has_its_chances():
    """Pruned by errors, a coin tossed in one of 30 steps was likely to 98 %, as the others are."""
    heads = np.random.default_rng(0).random(300) < 0.5
    log = [lasting(1, 30) if one else lasting(0, 20) for one in heads.tolist()]
    fitted = FittedLog(log, 2, 0.99)
    chances = np.array([fitted.told(episode).chances[0] for episode in log])
    assert np.abs(chances[:, 1] - heads.mean()).max() < 0.05
    late = fitted.told(log[0]).chances[5]
    assert late[0] > 0.99


def test_of_a_free_choice_nothing_false_is_believed():
    """Episodes of -30 or -20, by the toss of a coin: the longer are no gain."""
    heads = np.random.default_rng(0).random(300) < 0.5
    log = [lasting(1, 30) if one else lasting(0, 20) for one in heads.tolist()]
    shown = Demonstrations(tuple(log), Schema.anonymous(2, 2))
    said = off_policy.Log.of(shown, first_action(0), (-40.0, 0.0), seed=0)
    _, worse = said.chosen(first_action(1), discount=0.99)
    assert worse.gain == pytest.approx(-10.0, abs=2.0)
    assert not worse.believed
    other = dataclasses.replace(said, expert=first_action(1))
    _, better = other.chosen(first_action(0), discount=0.99)
    assert better.gain == pytest.approx(10.0, abs=2.0)
    assert better.believed
    assert 5.0 < better.low < 10.0


def test_chances_that_change_by_degrees_are_followed():
    """One leaf holds all places in which an action is likelier than not, if errors prune."""
    generator = np.random.default_rng(3)
    places = generator.random((6001, 3))
    truth = 1.0 / (1.0 + np.exp(-6.0 * (places[:-1, 0] - 0.5)))
    actions = (generator.random(6000) < truth).astype(int)
    log = [
        Episode(places[k : k + 21], actions[k : k + 20], np.zeros(20), True, False)
        for k in range(0, 6000, 20)
    ]
    fitted = FittedLog(log, 2, 0.99)
    said = np.concatenate([fitted.told(episode).chances[:, 1] for episode in log])
    assert np.abs(said - truth).mean() < 0.06


def test_actions_at_random_have_the_chances_of_chance():
    """No test is kept that tells nothing."""
    generator = np.random.default_rng(4)
    places, actions = generator.random((4001, 4)), generator.integers(3, size=4000)
    log = [
        Episode(places[k : k + 21], actions[k : k + 20], np.zeros(20), True, False)
        for k in range(0, 4000, 20)
    ]
    fitted = FittedLog(log, 3, 0.99)
    said = np.concatenate([fitted.told(episode).chances for episode in log])
    assert np.abs(said - 1.0 / 3.0).max() < 0.03


def test_a_gain_beyond_all_returns_is_no_gain():
    """Where the log's chances are wrong, weights of 200 made a loss of 10 a gain of 24,000."""
    judge = Judge(
        other=first_action(0), known=[], held_out=[lasting(0, 5)] * 4, discount=1.0,
        generator=np.random.default_rng(0), return_range=(-100.0, 0.0),
    )  # fmt: skip
    known = {"gain": 500.0, "predicted": np.nan, "n_held_out": 80}
    far = off_policy.OffPolicyComparison(low=300.0, most=100.0, **known)
    assert not far.believed
    assert "no two returns differ by more than 100" in far.describe()
    assert off_policy.OffPolicyComparison(low=90.0, most=100.0, **known).believed
    with pytest.MonkeyPatch.context() as patched:
        gains = Gains(np.full(4, 500.0), np.full(4, 500.0), -1.0, True, 400)
        patched.setattr(Judge, "_gains", lambda self, learned: gains)
        assert judge.of(first_action(1)).most == 100.0
