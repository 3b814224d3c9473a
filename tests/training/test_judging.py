"""What a run says of itself: what was gained against the start, and what must not fall."""

import itertools

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli._learning import in_words, present, progress_of
from eutree.display import counted
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.learners import ModelPlanning
from eutree.learners.learner import Decisions
from eutree.policy_search.planner import Planner
from eutree.training.handover import EARNS_MORE, Judgement, judged
from eutree.training.proposals import identity
from eutree.training.run import Run
from tests.corridor import WRONG, Corridor, policy_of
from tests.interaction.sick import Healthy

SHORT = {"evaluate_every": 5, "evaluation_episodes": 40, "seed": 2, "front_steps": 0}


def evaluation(returns, successes=None):
    n = len(returns)
    return Evaluation(np.array(returns), np.ones(n), np.full(n, "end"), successes)


def test_a_judgement_is_paired():
    noise = 100 * np.random.default_rng(0).random(50)
    found = judged(evaluation(noise), evaluation(noise + 8.0), challengers=3)
    assert found.return_change == pytest.approx(8.0)
    low, high = found.return_interval
    assert -20.0 < low < 8.0 < high < 36.0  # 50 pairs do not rule out what was not seen
    assert (found.success_change, found.challengers, found.episodes) == (None, 3, 50)


def test_a_success_that_never_differed_may_differ_yet():
    """Student's interval of equal successes has no width; 100 episodes do not show that."""
    ones = np.ones(100, dtype=bool)
    found = judged(evaluation(np.zeros(100), ones), evaluation(np.zeros(100), ones), challengers=0)
    assert found.success_change == 0.0
    assert -0.15 < found.success_interval.low < -0.03
    assert 0.03 < found.success_interval.high < 0.15


def test_a_judgement_survives_the_log():
    found = judged(evaluation([1.0, 2.0]), evaluation([2.0, 4.0]), challengers=1)
    assert Judgement.from_facts(found.facts()) == found


def test_every_run_says_what_it_gained_on_episodes_of_their_own():
    env = Corridor()
    shown = eutree.record(env, lambda env: policy_of(0, 5.0, 1), episodes=10, seed=1)
    result = eutree.learn(
        env, demonstrations=shown, expert=WRONG, episodes=0, race_steps=4_000, **SHORT
    )
    gained = result.against_start
    assert (result.handed_over, gained.episodes) == ("learned", 300)
    assert gained.return_interval.low > 0.0
    words = in_words(result, "out", recorded=None)
    assert f"return {gained.return_change:+.1f} [" in words
    assert "against the tree that it started from, on 300 episodes of their own" in words
    assert "if no episode returns less than" in words
    assert "handed over: 2 leaves, return" in words


def test_a_run_that_found_nothing_better_says_so():
    env = Corridor()
    best = policy_of(0, 5.0, 1)
    shown = eutree.record(env, lambda env: best, episodes=10, seed=1)
    result = eutree.learn(
        env, demonstrations=shown, expert=best, episodes=0, race_steps=1_000, **SHORT
    )
    assert result.against_start.is_start
    assert result.challengers > 0
    wanted = (
        "nothing better than the tree that it started from was found: "
        f"{counted(result.challengers, 'challenger')} tried"
    )
    assert wanted in in_words(result, "out", recorded=None)


def test_the_curve_of_an_unchanged_policy_is_flat():
    """Once each point had episodes of its own, and chance looked like learning (-1852, -1996)."""
    env = Corridor()
    result = eutree.learn(env, expert=WRONG, episodes=15, **SHORT)
    assert [point.episode for point in result.curve] == [0, 5, 10, 15]
    assert len({point.mean_return for point in result.curve[:3]}) == 1


class Narrow(Healthy):
    """Action 1 earns more and fails where the first number exceeds one half."""

    def step(self, action):
        observation, _, terminated, truncated, _ = super().step(action)
        self.bad = getattr(self, "bad", False) if self.count > 1 else False
        self.bad |= action == 1 and observation[0] > 0.5
        return observation, 2.0 * action, terminated, truncated, {"is_success": not self.bad}


def learned(**options):
    env = Narrow()
    return eutree.learn(env, episodes=25, race_steps=1_500, **SHORT, **options)


def test_what_must_not_fall_does_not():
    free, kept = learned(), learned(keep_success=True)
    rates = [point.success_rate for point in free.curve]
    assert min(rates) < rates[0] == 1.0  # return alone gives success away
    assert free.curve[-1].mean_return > 0.0
    rates = [point.success_rate for point in kept.curve]
    assert all(later >= before for before, later in itertools.pairwise(rates))
    assert kept.policy.n_leaves == kept.curve[-1].n_leaves


def test_success_cannot_be_kept_where_none_is_reported():
    with pytest.raises(InvalidArgumentError, match="keep_success needs an environment that"):
        eutree.learn(Corridor(), expert=WRONG, episodes=5, keep_success=True, **SHORT)


def test_progress_shows_the_present_also_while_racing():
    """Once it showed an old evaluation as the present one, and nothing at all while racing."""
    env = gymnasium.make("eutree/Evasion2-v0")
    seen = []

    def note(run):
        label, count, total = progress_of(run)
        assert 0 <= count <= total
        seen.append((label, present(run), run.at.updated_at, run.policy().n_leaves))

    eutree.learn(
        env,
        method="paper",
        episodes=24,
        evaluate_every=15,
        evaluation_episodes=5,
        race_steps=300,
        seed=1,
        on_progress=note,
    )
    updated = next(one for one in seen if one[2] == 20)
    assert updated[1].startswith(f"{updated[3]} leaves; at episode 15: ")
    racing = [words for label, words, *_ in seen if label == "racing"]
    assert racing
    assert all("challengers won" in words for words in racing)


def test_a_method_that_asks_for_no_judgement_says_so_where_it_hands_over_what_is_worse():
    shown = eutree.record(Corridor(), lambda env: policy_of(0, 5.0, 1), episodes=5, seed=1)
    result = eutree.learn(
        Corridor(), demonstrations=shown, expert=WRONG, method="paper", episodes=4, **SHORT
    )
    words = in_words(result, "out", recorded=None)
    assert result.handed_over == "learned"
    assert "This method hands over what it learned, whatever it earns" in words


def test_where_the_range_of_returns_is_known_no_judgement_has_a_condition():
    """That of methods which ask for none had one all the same."""
    options = {**SHORT, "return_range": (-100.0, 100.0)}
    shown = eutree.record(Corridor(), lambda env: policy_of(0, 5.0, 1), episodes=5, seed=1)
    result = eutree.learn(
        Corridor(), demonstrations=shown, expert=WRONG, method="paper", episodes=4, **options
    )
    assert result.against_start.episodes > 0
    assert result.against_start.condition == ""


def test_one_pair_is_one_episode_and_no_end_of_an_interval_is_a_negative_zero():
    found = judged(evaluation([5.0]), evaluation([5.0]))
    words = found.describe(5)
    assert words.startswith(
        "return +0.0 [0.0, 0.0] against the tree that it started from, on 1 episode of their own"
    )


def trying(tree, monkeypatch, **more):
    """Let planning end with a tree on trial, and the start as policy."""
    monkeypatch.setattr(Planner, "_deserves", lambda *_: False)
    monkeypatch.setattr(ModelPlanning, "on_trial", lambda _: Decisions(tree.tree, tree.actions))
    env = Corridor()
    shown = eutree.record(env, lambda env: policy_of(0, 5.0, 1), episodes=10, seed=1)
    asked = {"episodes": 6, "judge_episodes": 300} | SHORT
    result = eutree.learn(env, demonstrations=shown, expert=WRONG, **asked, **more)
    assert identity(result.learned) == identity(WRONG)
    return result


def test_the_tree_that_is_on_trial_at_the_end_meets_a_start_that_was_kept(monkeypatch, tmp_path):
    good = policy_of(0, 5.0, 1)
    result = trying(good, monkeypatch, out=tmp_path / "run")
    assert not (tmp_path / "run" / "picked.json").exists()
    assert (result.handed_over, result.against_start.why) == ("learned", EARNS_MORE)
    assert identity(result.policy) == identity(good)
    assert not result.is_start


@pytest.mark.parametrize(("tried", "taken"), [((0, 5.0, 1), True), ((0, 7.1, 1), False)])
def test_the_tree_that_is_on_trial_at_the_end_meets_the_learned_one(
    monkeypatch, tmp_path, tried, taken
):
    """The learned tree, which had been adopted, was handed over whatever waited behind it."""
    tree = policy_of(*tried)
    monkeypatch.setattr(Run, "learned", lambda _: WRONG)
    monkeypatch.setattr(ModelPlanning, "on_trial", lambda _: Decisions(tree.tree, tree.actions))
    asked = {"episodes": 8, "judge_episodes": 300, "seed": 2}
    result = eutree.learn(Corridor(), expert=policy_of(0), **asked)
    assert result.environment_steps.front > 0
    assert identity(result.policy) == identity(tree if taken else WRONG)
    assert ("; last adopted: " in in_words(result, tmp_path, recorded=None)) == taken
    assert identity(result.learned) == identity(WRONG)


def test_a_tree_on_trial_that_earns_no_more_is_kept_beside_the_start(monkeypatch, tmp_path):
    tree = policy_of(1, 5.0, 1)  # an action more, and no better
    result = trying(tree, monkeypatch, out=tmp_path / "run")
    kept = eutree.TreePolicy.load(tmp_path / "run" / "picked.json")
    assert identity(kept) == identity(tree) == identity(result.picked)
    assert result.handed_over == "start"
    assert identity(result.policy) == identity(WRONG)


class Breaking(Corridor):
    """A corridor that breaks off after some steps, of all its episodes."""

    steps_made, last = 0, np.inf

    def step(self, action):
        if self.steps_made >= self.last:
            raise RuntimeError("the sensor broke")
        return super().step(action)


def test_a_judgement_that_broke_off_is_held_again_to_the_same_end(monkeypatch, tmp_path):
    """What the tree on trial had played was counted twice, and left fewer pairs to the contest."""
    tree = policy_of(0, 5.0, 1)
    monkeypatch.setattr(Run, "learned", lambda _: WRONG)
    monkeypatch.setattr(ModelPlanning, "on_trial", lambda _: Decisions(tree.tree, tree.actions))

    def run(name, last, **more):
        monkeypatch.setattr(Breaking, "steps_made", 0)
        monkeypatch.setattr(Breaking, "last", last)
        asked = {"expert": policy_of(0), "episodes": 8, "seed": 2, "out": tmp_path / name}
        return eutree.learn(Breaking(), **asked, **more)

    whole = run("whole", np.inf)
    assert identity(whole.picked) == identity(tree)
    with pytest.raises(eutree.EutreeError, match="the sensor broke"):
        run("broken", Breaking.steps_made - 15)
    again = run("broken", np.inf, resume=True)
    assert again.against_start == whole.against_start
    assert again.environment_steps == whole.environment_steps
    assert again.evaluation_episodes == whole.evaluation_episodes


def test_a_run_that_ended_with_the_tree_on_trial_is_made_longer(monkeypatch, tmp_path):
    """Its checkpoint has a pick, and no front that the pick would be of."""
    tree = policy_of(0, 5.0, 1)
    monkeypatch.setattr(Run, "learned", lambda _: WRONG)
    monkeypatch.setattr(ModelPlanning, "on_trial", lambda _: Decisions(tree.tree, tree.actions))
    asked = {"expert": policy_of(0), "judge_episodes": 300, "seed": 2, "out": tmp_path / "run"}
    first = eutree.learn(Corridor(), episodes=8, **asked)
    assert identity(first.picked) == identity(tree)
    assert first.front == ()
    longer = eutree.learn(Corridor(), episodes=9, resume=True, **asked)
    assert longer.episodes == 9
    assert identity(longer.policy) == identity(tree)
