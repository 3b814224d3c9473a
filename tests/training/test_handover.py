"""Which tree a run hands over: never one that is worse than what it began with."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.learners import History
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.training import many
from eutree.training.handover import (
    DID_BETTER,
    EARNS_MORE,
    FAILS_MORE,
    NO_LESS,
    NOT_SHOWN,
    NOT_SHOWN_SMALLER,
    TOO_LARGE,
    Duel,
    Handover,
    Judgement,
    judge,
    judged,
)
from eutree.training.result import LearningResult
from eutree.training.run import _own_returns
from eutree.trees import DecisionTree


def policy_of(action, n_leaves=1):
    tree = DecisionTree.single_leaf(1)
    for leaf in range(n_leaves - 1):
        tree = tree.split(leaf, 0, float(leaf))
    return TreePolicy(tree, np.full(n_leaves, action), Schema.anonymous(1, 2))


START, LEARNED = policy_of(0), policy_of(1)


class Game:
    """Plays action 0 or 1 from numbered starts, each as a function of the start's chance says."""

    def __init__(self, *returns, successes=None, seed=0):
        self._returns = returns
        self._successes = successes
        self._seed = seed

    def __call__(self, policy, starts):
        action = int(policy.actions[0])
        chance = [np.random.default_rng((self._seed, k)) for k in starts]
        returns = np.array([self._returns[action](one) for one in chance])
        n = len(starts)
        successes = None
        if self._successes is not None:
            chance = [np.random.default_rng((self._seed, k, 1)) for k in starts]
            successes = np.array([one.random() < self._successes[action] for one in chance])
        return Evaluation(returns, np.full(n, 3), np.full(n, "end"), successes)


def verdict(game, *, sizes=(1, 1), known=None, episodes=None, given=True, **settings):
    handover = Handover(episodes=episodes, **settings)
    duel = Duel(START, LEARNED, game, most=handover.pairs(200), steps=handover.steps(4_000))
    return judge(handover, duel, sizes, known=known, challengers=2, given=given)


def normal(mean):
    return lambda chance: chance.normal(mean, 5.0)


def test_a_gain_is_taken():
    found = verdict(Game(normal(10.0), normal(12.0)))
    assert (found.handed_over, found.why) == ("learned", EARNS_MORE)
    assert found.return_interval.low > 0.0
    assert "if no episode returns less than" in found.condition


def test_no_difference_leaves_the_start():
    found = verdict(Game(normal(10.0), normal(10.0)))
    assert (found.handed_over, found.why) == ("start", NOT_SHOWN)
    assert found.return_interval.low < 0.0 < found.return_interval.high


def duel_of(game, patience):
    return Duel(START, LEARNED, game, most=60, steps=None, patience=patience)


def test_a_clear_lead_is_worth_a_few_episodes_more():
    """Seven pairs of 300 in a range of 500 show nothing yet; to stop there wasted the run."""
    game, known = Game(lambda _: 200.0, lambda _: 500.0), (0.0, 500.0)
    duel = duel_of(game, 7)
    found = judge(Handover(), duel, (2, 5), known=known, challengers=0)
    assert found.why == EARNS_MORE
    assert 7 < found.episodes < 20


@pytest.mark.parametrize("seed", range(4))
def test_who_has_lost_no_pair_plays_on(seed):
    """Ten pairs, of which a start that falls at times lost some, ended the run with the start."""

    def falls(chance):
        return 100.0 if chance.random() < 0.5 else 40.0

    duel = duel_of(Game(falls, lambda _: 100.0, seed=seed), 11)
    found = judge(Handover(), duel, (2, 2), known=(0.0, 100.0), challengers=0)
    assert found.why == EARNS_MORE
    assert 11 < found.episodes <= 60
    level = duel_of(Game(falls, falls, seed=seed), 11)
    assert judge(Handover(), level, (2, 2), known=(0.0, 100.0), challengers=0).episodes == 11


@pytest.mark.parametrize(("gain", "known"), [(0.0, (-20.0, 60.0)), (-5.0, None)])
def test_no_more_is_played_where_the_lead_is_not_clear(gain, known):
    duel = duel_of(Game(normal(10.0), normal(10.0 + gain)), 7)
    found = judge(Handover(), duel, (2, 5), known=known, challengers=0)
    assert (found.why, found.episodes) == (NOT_SHOWN, 7)


def test_more_episodes_of_a_clear_lead_promise_as_much_as_others():
    """Ten more in five episodes of six and 50 less in one is no gain, however it begins."""

    def tempting(chance):
        return 10.0 if chance.random() < 5 / 6 else -50.0

    found = []
    for seed in range(200):
        duel = duel_of(Game(lambda _: 0.0, tempting, seed=seed), 7)
        found.append(judge(Handover(), duel, (1, 1), known=(-50.0, 10.0), challengers=0))
    assert sum(one.episodes > 7 for one in found) > 30  # whose first seven were clearly ahead
    assert 1 <= sum(one.handed_over == "learned" for one in found) <= 10  # one in twenty


def test_a_start_that_nobody_has_given_gives_way_to_what_earned_more():
    """Five episodes of 500 against 9 show nothing by a bound; a single action has no claim."""
    far = Game(lambda chance: 9.0, lambda chance: 500.0)
    known = (0.0, 500.0)
    assert verdict(far, known=known, episodes=5).why == NOT_SHOWN
    found = verdict(far, known=known, episodes=5, given=False)
    assert (found.handed_over, found.why) == ("learned", DID_BETTER)
    assert found.return_interval.low < 0.0  # what is said of the gain promises no more than before
    assert DID_BETTER in found.verdict()
    assert verdict(far, known=known, given=False).why == EARNS_MORE


def test_a_start_that_nobody_has_given_stays_where_nothing_earned_more():
    less, same = Game(lambda _: 10.0, lambda _: 9.0), Game(lambda _: 10.0, lambda _: 10.0)
    assert verdict(less, episodes=5, given=False).handed_over == "start"
    assert verdict(same, episodes=5, sizes=(1, 3), given=False).handed_over == "start"
    assert verdict(same, episodes=5, sizes=(3, 1), given=False).handed_over == "learned"
    unsuccessful = Game(lambda _: 9.0, lambda _: 10.0, successes=(1.0, 0.2))
    assert verdict(unsuccessful, episodes=5, given=False).why == FAILS_MORE


def assert_handed_over(judgement, why):
    assert judgement.episodes < 10
    assert (judgement.handed_over, judgement.why) == ("learned", why)
    assert judgement.return_change > 400.0


def test_a_short_run_from_nothing_hands_over_what_it_learned():
    """A learned tree of 500 was kept beside a single action of 9, for lack of episodes."""
    result = eutree.learn("CartPole-v1", method="vrd", steps=2000, seed=0)
    assert_handed_over(result.against_start, EARNS_MORE)
    assert result.policy == result.learned


def test_so_do_several(tmp_path):
    runs = eutree.learn_runs(
        "CartPole-v1", runs=1, out=tmp_path / "runs", n_jobs=1, method="vrd", steps=2000, seed=0,
        selection_episodes=3, judging_episodes=3,
    )  # fmt: skip
    assert_handed_over(runs.judgement, DID_BETTER)
    assert runs.policy == runs.result.learned


def test_a_smaller_tree_that_earns_as_much_is_taken_and_one_that_earns_less_is_not():
    same, less = Game(normal(10.0), normal(10.0)), Game(normal(10.0), normal(8.0))
    assert verdict(same, sizes=(9, 5)).why == NO_LESS
    assert verdict(less, sizes=(9, 5)).why == NOT_SHOWN_SMALLER
    assert verdict(less, sizes=(9, 5)).handed_over == "start"


def test_success_is_not_given_away_for_return():
    game = Game(normal(10.0), normal(20.0), successes=(0.98, 0.93))
    found = verdict(game)
    assert (found.handed_over, found.why) == ("start", FAILS_MORE)
    assert found.episodes == 1000  # enough to tell a point
    assert verdict(game, success_margin=0.2).handed_over == "learned"


def test_a_start_that_is_larger_than_asked_for_is_not_handed_over():
    less = Game(normal(10.0), normal(8.0))
    assert verdict(less, sizes=(9, 5), max_leaves=6).why == TOO_LARGE
    assert verdict(less, sizes=(9, 5), max_leaves=6).handed_over == "learned"
    assert verdict(less, sizes=(6, 5), max_leaves=6).handed_over == "start"


def test_rare_losses_are_not_taken_for_a_gain():
    """A tenth more in most episodes, 59 less in one of 250: worse on average."""

    def tempting(chance):
        return 1.0 - 59.0 * (chance.random() < 0.004)

    wrong = [
        verdict(Game(lambda chance: 0.9, tempting, seed=seed), known=(-58.0, 1.0)).handed_over
        for seed in range(60)
    ]
    assert wrong.count("learned") <= 3  # one in twenty


def test_a_rule_without_a_promise_would_take_them():
    """The control: by the sign of the mean of 100 episodes most of them would be taken."""
    chance = np.random.default_rng(0)
    means = (0.1 - 59.0 * (chance.random((60, 100)) < 0.004)).mean(axis=1)
    assert (means > 0.0).sum() > 30


@pytest.mark.parametrize("seen", [None, (-450.0, 60.0), (45.0, 75.0)])
def test_what_a_tree_lost_before_is_not_forgotten(seen):
    """The run had seen -450 of the learned tree, and the duel's 40 pairs nothing below 50."""
    game = Game(lambda _: 50.0, lambda chance: 68.0 + chance.uniform(-8.0, 8.0))
    duel = Duel(START, LEARNED, game, most=40, steps=None, patience=20, seen=seen)
    found = judge(Handover(), duel, (1, 2), known=None, challengers=0)
    if seen is not None and seen[0] < 0.0:
        assert (found.handed_over, found.why) == ("start", NOT_SHOWN)
        assert "no episode returns less than -450" in found.condition
    else:
        assert (found.handed_over, found.why) == ("learned", EARNS_MORE)


def test_own_episodes_of_a_tree_are_those_in_which_each_action_is_its_own():
    history = History(1, 1)
    played = [([0, 0], -7.0, True), ([0, 1], -90.0, True), ([0], -3.0, False), ([1], 5.0, True)]
    for actions, earned, ends in [*played, ([0], -800.0, None)]:  # the last was shown
        n = len(actions)
        history.append_episode(
            np.zeros((n + 1, 1)), np.array(actions), np.r_[earned, np.zeros(n - 1)],
            np.zeros(n + 1, dtype=np.int32), terminated=ends is not False,
            demonstrated=ends is None,
        )  # fmt: skip
    assert _own_returns(history, START) == (-7.0, -7.0)  # it was cut short of two steps
    assert _own_returns(history, START, LEARNED) == (-7.0, 5.0)
    assert _own_returns(History(1, 1), START) is None


def test_it_takes_no_more_steps_than_it_may():
    game = Game(normal(10.0), normal(10.0))
    duel = Duel(START, LEARNED, game, most=5000, steps=600)
    found = judge(Handover(), duel, (1, 1), known=None, challengers=0)
    assert found.handed_over == "start"
    assert 600 <= found.steps < 1_500  # what was under way ends


@pytest.mark.parametrize("name", ["error", "success_margin"])
def test_settings_are_checked(name):
    with pytest.raises(InvalidArgumentError, match=f"{name} must be"):
        Handover(**{name: 2.0})
    with pytest.raises(InvalidArgumentError, match="judge_episodes must be"):
        Handover(episodes=-1)


def test_a_judgement_survives_the_log():
    found = verdict(Game(normal(10.0), normal(12.0), successes=(0.5, 0.6)))
    assert Judgement.from_facts(found.facts()) == found


def test_an_older_judgement_is_read():
    facts = judged(
        Game(normal(1.0), normal(1.0))(START, range(3)),
        Game(normal(1.0), normal(1.0))(LEARNED, range(3)),
    ).facts()
    old = {name: facts[name] for name in ("episodes_compared", "return", "return_interval",
           "success", "success_interval", "challengers")}  # fmt: skip
    assert Judgement.from_facts(old).handed_over == "learned"
    assert Judgement.from_facts(old).verdict() == ""


JUDGED = Judgement.same(challengers=0)
OPTIONS = {"episodes": 20, "evaluate_every": 20, "evaluation_episodes": 5, "seed": 3}


@pytest.fixture(scope="module")
def shown():
    env = gymnasium.make("eutree/Evasion2-v0")
    return eutree.record(env, eutree.experts.wait_at_crossing, episodes=8, seed=0)


@pytest.mark.parametrize("method", ["corrected", "planning"])
def test_a_run_keeps_its_expert_where_learning_loses_it(shown, method, tmp_path):
    """The u-tree forgets its expert's policy in the first episodes; what is kept beside is it."""
    env = gymnasium.make("eutree/Evasion2-v0")
    result = eutree.learn(env, demonstrations=shown, method=method, out=tmp_path / "run", **OPTIONS)
    judgement = result.against_start
    if judgement.is_start:
        return
    stored = TreePolicy.load(tmp_path / "run" / "policy.json")
    assert stored == result.policy
    beside = tmp_path / "run" / "learned.json"
    assert beside.exists() == (result.handed_over == "start")
    if result.handed_over == "start":
        assert result.policy == result.expert
        assert TreePolicy.load(beside) == result.learned
    assert result.environment_steps.judging == judgement.steps


def test_the_paper_hands_over_what_it_learned(shown):
    env = gymnasium.make("eutree/Evasion2-v0")
    result = eutree.learn(env, demonstrations=shown, method="paper", **OPTIONS)
    assert result.policy == result.learned
    assert result.against_start.episodes == OPTIONS["evaluation_episodes"]


def test_nothing_is_played_where_nothing_may_be(shown):
    env = gymnasium.make("eutree/Evasion2-v0")
    result = eutree.learn(
        env, demonstrations=shown, method="corrected", judge_episodes=0, **OPTIONS
    )
    assert result.against_start is None
    assert result.policy == result.learned


def test_an_interrupted_run_hands_over_the_same(shown, tmp_path):
    env = gymnasium.make("eutree/Evasion2-v0")
    options = OPTIONS | {"demonstrations": shown, "method": "corrected"}
    whole = eutree.learn(env, out=tmp_path / "whole", **options)
    left = iter(range(200))
    eutree.learn(env, out=tmp_path / "part", stop=lambda: next(left, None) is None, **options)
    again = eutree.learn(env, out=tmp_path / "part", resume=True, **options)
    assert again.policy == whole.policy
    assert again.against_start == whole.against_start
    assert again.episodes == whole.episodes


def test_the_winner_of_many_runs_has_to_deserve_it_too(shown, tmp_path):
    """What was lucky on the selection episodes is judged again beside the start."""
    options = {k: v for k, v in OPTIONS.items() if k != "episodes"}
    runs = eutree.learn_runs(
        "eutree/Evasion2-v0",
        runs=2,
        out=tmp_path / "runs",
        n_jobs=1,
        selection_episodes=20,
        judging_episodes=40,
        episodes=40,
        demonstrations=shown,
        **options,
    )
    stored = TreePolicy.load(tmp_path / "runs" / "policy.json")
    assert stored == runs.policy
    if runs.result.is_start:
        assert runs.judgement is None
    else:
        assert runs.judgement.episodes == 40
        assert runs.judged.n_leaves == runs.policy.n_leaves


@pytest.mark.parametrize(("keeps", "wanted"), [(True, "start"), (False, "learned")])
def test_the_winner_of_many_runs_keeps_success_where_it_is_asked_to(
    shown, tmp_path, monkeypatch, keeps, wanted
):
    """Half a point is less than a point; once the winner was judged without being told."""
    options = {k: v for k, v in OPTIONS.items() if k != "episodes"}
    spec = {"demonstrations": shown, "episodes": 1, "keep_success": keeps, "n_jobs": 1}
    asked = []

    def judge_(handover, *_, **__):
        asked.append(handover.success_margin)
        return replace(JUDGED, handed_over=wanted)

    monkeypatch.setattr(many, "judge", judge_)
    monkeypatch.setattr(LearningResult, "is_start", False)
    found = eutree.learn_runs(
        "eutree/Evasion2-v0", runs=1, out=tmp_path / "runs", selection_episodes=2,
        judging_episodes=4, method="planning", **spec, **options,
    )  # fmt: skip
    assert asked == [0.0 if keeps else 0.01]
    assert found.judgement.handed_over == wanted
