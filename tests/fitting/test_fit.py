"""Fitting: what is chosen, what is repaired, what is said about it."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from benchmarks.people import folder

import eutree
from eutree.c45 import C45Settings
from eutree.data import Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.fitting import Person, playing
from eutree.fitting.diagnosis import TOLD, about_result, harms, in_words
from eutree.fitting.fit import mend, race
from eutree.fitting.playing import Played, Player, blame, practise, repairs, shown_in
from eutree.learners.starts import RELEASE_8, SETTINGS, FittedTree, fitted_trees, promising
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from eutree.world_model.action_trees import n_leaves
from tests.fitting.door import Careful, Corridor

STANDS_STILL = 16  # a folder of which the tree of release 8 never arrives


@pytest.fixture(scope="module")
def corridor():
    return Corridor()


@pytest.fixture(scope="module")
def shown(corridor):
    return eutree.record(corridor, Careful(), episodes=12, seed=3)


def leaf(action, schema):
    return TreePolicy(DecisionTree.single_leaf(schema.n_features), np.array([action]), schema)


def by_hand(schema, *, door):
    """Return the tree place <= 3.5: walk, else ``door`` = (action where gap <= 0.5, elsewhere)."""
    tree = DecisionTree.single_leaf(2).split(leaf=0, feature=0, threshold=3.5)
    tree = tree.split(leaf=1, feature=1, threshold=0.5)
    return TreePolicy(tree, np.array([1, *door]), schema)


def wrong(episode, **changes):
    return replace(episode, **changes)


class TestDoubt:
    """A tree that chance may have made look as good as what was shown."""

    def test_an_interval_that_reaches_below_the_person_is_a_doubt(self, corridor, shown):
        tree = by_hand(shown.schema, door=(0, 1))  # walks in at a gap of 0.5 to 0.7: 2 of 5 fail
        few, many = (Player(corridor, 0).play(tree, n, 0).evaluation for n in (40, 1000))
        person = Person(Player(corridor, 9).play(tree, 15, 0).evaluation)
        assert not about_result(person, few, doubts=False)
        (sentence,) = about_result(person, few, doubts=True)
        assert "Too close to tell" in sentence
        assert f"{few.successes.sum()} of 40 (" in sentence
        assert about_result(Person(many), many, doubts=True) == []

    def test_returns_are_doubted_like_successes(self, corridor, shown):
        tree = by_hand(shown.schema, door=(0, 1))
        played = Player(corridor, 0).play(tree, 40, 0).evaluation
        played = replace(played, successes=None)
        (sentence,) = about_result(Person(played), played, doubts=True)
        assert "on average" in sentence
        assert (
            about_result(
                Person(replace(played, returns=played.returns - 1000.0)), played, doubts=True
            )
            == []
        )

    def test_a_doubtful_tree_gets_the_leaf_and_the_cause(self, corridor, shown):
        tree = by_hand(shown.schema, door=(0, 1))
        mixed = replace(shown, episodes=Player(corridor, 1).play(tree, 100, 0).episodes)
        report = eutree.fit(mixed, corridor, episodes=100, settings=RELEASE_8)
        assert report.verdict.is_open
        assert "Too close to tell" in report.warnings[0]
        assert "leaf" in report.warnings[1]


class TestWithoutSuccess:
    """Where only returns say how well it went, as in Acrobot, which ends where it succeeds."""

    def silent(self, episodes):
        return tuple(replace(episode, is_success=None) for episode in episodes)

    def test_an_episode_below_the_mean_is_no_bad_end(self, corridor, shown):
        tree = eutree.fit_expert_tree(shown)
        played = Player(corridor, 0).play(tree, 40, 0)
        played = replace(played, episodes=self.silent(played.episodes))
        returns = played.evaluation.returns
        assert played.evaluation.successes is None
        one = shown.episodes[0]
        spread = [returns.min(), returns.max() + 30.0]  # their mean is above most of the episodes
        rewards = [np.append(np.zeros(len(one) - 1), value) for value in spread]
        known = tuple(replace(one, rewards=r, is_success=None) for r in rewards)
        assert (returns < np.mean(spread)).mean() > 0.05
        assert harms(played, replace(shown, episodes=known)) == []

    def test_what_earns_less_than_all_that_was_shown_is_said_so(self, corridor, shown):
        tree = by_hand(shown.schema, door=(0, 1))
        played = Player(corridor, 0).play(tree, 40, 0)
        played = replace(played, episodes=self.silent(played.episodes))
        lowest = float(played.evaluation.returns.max())
        one = shown.episodes[0]
        rewards = np.append(np.zeros(len(one) - 1), lowest)
        known = replace(shown, episodes=(replace(one, rewards=rewards, is_success=None),))
        found = harms(played, known)
        assert found
        said = in_words(found[0], tree, 10)
        assert f"earn less than any episode shown ({lowest:.4g})" in said
        assert "badly" not in said


class TestFit:
    def test_a_tree_that_is_as_good_is_returned_without_a_warning(self, corridor, shown):
        report = eutree.fit(shown, corridor, episodes=100)
        assert report.warnings == ()
        assert report.verdict.word == "as good"
        assert report.played.success_rate == report.person.success_rate == 1.0
        assert report.person.episodes == 12
        assert report.training_accuracy == 1.0
        assert "shown: 12 of 12 (75 to 100 %); this tree: 100 of 100 (96 to 100 %): as good" in str(
            report
        )

    def test_the_same_seed_gives_the_same_report(self, corridor, shown):
        first, again = (eutree.fit(shown, corridor, episodes=10, seed=3) for _ in range(2))
        assert first.policy.to_bytes() == again.policy.to_bytes()
        assert str(first) == str(again)

    def test_who_waits_is_not_turned_into_a_tree_that_waits_for_ever(self):
        demonstrations = folder("evasion", STANDS_STILL)
        plain = eutree.fit(demonstrations, settings=RELEASE_8, episodes=60)
        assert plain.policy == eutree.fit_expert_tree(demonstrations)
        assert plain.played.success_rate < 0.1
        assert plain.verdict.is_worse
        (harm,) = [text for text in plain.warnings if "hold on to the end in leaf" in text]
        assert "'time limit'" in harm
        assert "stop where" in harm
        chosen = eutree.fit(demonstrations, episodes=100)
        assert chosen.played.success_rate > 0.6
        assert not [text for text in chosen.warnings if "hold on to the end" in text]

    def test_practice_makes_what_is_missing_and_is_kept_where_it_is_better(self):
        demonstrations = folder("evasion", 2)
        alone = eutree.fit(demonstrations, episodes=100)
        told = []
        report = eutree.fit(
            demonstrations,
            episodes=100,
            practise=100,
            on_progress=lambda stage, count, most: told.append((stage, count, most)),
        )
        assert alone.verdict.is_worse
        assert f"{alone.played.successes.sum()} of 100 (" in alone.warnings[0]
        assert "leaf" in alone.warnings[1]
        assert report.played.success_rate > alone.played.success_rate + 0.1
        assert "100 episodes of practice" in report.choice
        stages = list(dict.fromkeys(stage for stage, _, _ in told))
        assert stages == ["choosing", "repairing", "judging", "practising", "comparing"]
        assert ("judging", 100, 100) in told
        assert all(0 <= count <= most for _, count, most in told)
        assert report.before_practice.policy == alone.policy
        assert report.before_practice.warnings == alone.warnings

    def test_practice_that_gains_nothing_is_said_and_dropped(self, corridor, shown):
        report = eutree.fit(shown, corridor, episodes=20, practise=2)
        assert report.warnings == ("2 episodes of practice made nothing better of it.",)

    def test_every_episode_is_counted(self, corridor, shown):
        told = []
        report = eutree.fit(shown, corridor, episodes=20, on_progress=lambda *a: told.append(a))
        assert report.episodes_played == len(told)
        assert sum(stage == "judging" for stage, _, _ in told) == 20
        fixed = eutree.fit(shown, corridor, episodes=20, settings=RELEASE_8)
        assert fixed.episodes_played == 20
        assert fixed.n_candidates == 1

    def test_without_playing_the_choice_is_made_by_episodes_left_out(self, shown):
        report = eutree.fit(shown, episodes=0)
        assert report.played is None
        assert report.verdict is None
        assert report.warnings == ()

    def test_an_environment_that_cannot_be_made_is_said(self, shown):
        unknown = replace(shown, environment=EnvironmentSpec("Nowhere-v3"))
        report = eutree.fit(unknown, episodes=10)
        assert report.played is None
        assert "was not played" in report.warnings[-1]
        assert "Nowhere-v3" in report.warnings[-1]
        with pytest.raises(InvalidArgumentError, match="practise must be 0 without"):
            eutree.fit(unknown, practise=1)

    def test_another_environment_is_refused(self, shown):
        with pytest.raises(InvalidArgumentError, match="the environment"):
            eutree.fit(shown, "eutree/Evasion2-v0")

    def test_practice_has_to_be_judged(self, corridor, shown):
        with pytest.raises(InvalidArgumentError, match="episodes must be at least 1 to practise"):
            eutree.fit(shown, corridor, episodes=0, practise=10)

    def test_an_environment_without_successes_is_judged_by_its_return(self):
        demonstrations = folder("cartpole", 0, episodes=4)
        report = eutree.fit(demonstrations, episodes=2)
        assert report.person.success_rate is None
        assert report.played.success_rate is None
        assert " in 4 episodes" in str(report)

    def test_results_that_nobody_knows_are_not_made_up(self, corridor, shown):
        unknown = [
            wrong(e, rewards=np.full(len(e), np.nan), is_success=None) for e in shown.episodes
        ]
        report = eutree.fit(replace(shown, episodes=tuple(unknown)), corridor, episodes=5)
        assert "shown: unknown returns in 12 episodes" in str(report)
        assert report.verdict.word == "not comparable"


class TestBadInput:
    def sentences(self, demonstrations, corridor):
        return eutree.fit(demonstrations, corridor, episodes=5).warnings

    def test_an_action_that_never_occurs(self, corridor, shown):
        episodes = [wrong(e, actions=np.ones_like(e.actions)) for e in shown]
        found = self.sentences(replace(shown, episodes=tuple(episodes)), corridor)
        assert found[0].startswith("The demonstrations never show wait:")

    def test_of_many_actions_that_never_occur_a_few_are_named(self, shown):
        schema = replace(shown.schema, actions=tuple(f"u{k}" for k in range(40)))
        found = eutree.fit(Demonstrations(shown.kept, schema)).warnings
        named = " nor ".join(f"u{k}" for k in range(2, 2 + TOLD))
        assert found[0].startswith(f"The demonstrations never show {named} nor {38 - TOLD} more: ")

    def test_an_action_that_occurs_only_where_it_was_dropped(self, corridor, shown):
        episodes = [
            wrong(e, actions=np.ones_like(e.actions), extras={"dropped_action": 0}) for e in shown
        ]
        found = self.sentences(replace(shown, episodes=tuple(episodes)), corridor)
        assert found[0].startswith("The demonstrations show wait only as the last action of an ep")
        assert not any("never show" in sentence for sentence in found)

    def test_nothing_but_failures(self, corridor, shown):
        episodes = [wrong(e, is_success=False) for e in shown]
        found = self.sentences(replace(shown, episodes=tuple(episodes)), corridor)
        assert found[0].startswith("All 12 demonstrations failed:")

    def test_nothing_but_interruptions(self, corridor, shown):
        episodes = [wrong(e, terminated=False, ending="interrupted") for e in shown]
        found = self.sentences(replace(shown, episodes=tuple(episodes)), corridor)
        assert found[0].startswith("None of the 12 demonstrations was played to its end")

    def test_nothing_but_episodes_that_a_tree_drove(self, corridor, shown):
        driven = [
            replace(e, steps={**e.steps, "by_hand": np.arange(len(e)) > len(e) - 2}) for e in shown
        ]
        found = self.sentences(replace(shown, episodes=tuple(driven)), corridor)
        assert "(a tree drove in 12)" in found[0]
        assert "interrupted" not in found[0]

    def test_nothing_that_says_how_well_the_person_does_for_several_reasons(self, corridor, shown):
        episodes = list(shown)
        episodes[0] = wrong(episodes[0], terminated=False, ending="stopped")
        episodes[1:] = [replace(e, extras={"chosen_start": True}) for e in episodes[1:]]
        found = self.sentences(replace(shown, episodes=tuple(episodes)), corridor)
        assert "(begun at a chosen start: 11, interrupted or stopped: 1)" in found[0]

    def test_a_table_that_does_not_say_how_episodes_ended(self, corridor, shown):
        episodes = [wrong(e, terminated=False, ending="") for e in shown]
        found = self.sentences(replace(shown, episodes=tuple(episodes)), corridor)
        assert found[0].startswith("None of the 12 demonstrations says how it ended: no column")

    def test_one_leaf_where_two_actions_were_shown(self, corridor, shown):
        generator = np.random.default_rng(0)
        by_chance = [wrong(e, actions=(generator.random(len(e)) < 0.8).astype(int)) for e in shown]
        noise = replace(shown, episodes=tuple(by_chance))
        report = eutree.fit(noise, corridor, episodes=5, settings=C45Settings(min_objects=100))
        assert report.policy.n_leaves == 1
        (found,) = [text for text in report.warnings if "single leaf" in text]
        assert "always takes walk, although wait" in found

    def test_nothing_at_all(self, shown):
        with pytest.raises(InvalidArgumentError, match="at least one transition"):
            eutree.fit(replace(shown, episodes=()))


class TestFittedTrees:
    def test_release_8_comes_first_and_no_tree_twice(self, shown):
        found = fitted_trees(shown, settings=SETTINGS, histories=(0, 1))
        assert found[0].policy == eutree.fit_expert_tree(shown)
        assert str(found[0]) == "C4.5 of release 8"
        assert len({entry.policy.to_bytes() for entry in found}) == len(found)

    def test_episodes_left_out_are_never_learned_from(self):
        """Each episode has a place of its own: a tree of the others knows nothing of it."""
        schema = Schema.anonymous(1, 2)
        episodes = tuple(
            Episode(
                observations=np.array([[float(k)], [float(k)]]),
                actions=np.array([k % 2]),
                rewards=np.zeros(1),
                terminated=True,
                truncated=False,
            )
            for k in range(10)
        )
        lossless = C45Settings.lossless()
        (found,) = fitted_trees(
            Demonstrations(episodes, schema), settings=(lossless,), histories=(0,)
        )
        decided = found.policy.predict(np.arange(10.0)[:, np.newaxis])[0]
        assert (decided == np.arange(10) % 2).all()
        assert found.correct.mean() < 0.5

    def test_what_was_seen_before_is_taken_where_it_explains_more(self, corridor):
        """The action is the one that the observation before asks for."""
        generator = np.random.default_rng(0)
        episodes = []
        for _ in range(10):
            seen = generator.random((31, 1))
            before = np.concatenate([seen[:1], seen[:-2]])
            actions = (before[:, 0] > 0.5).astype(int)
            episodes.append(Episode(seen, actions, np.zeros(30), True, False))
        late = Demonstrations(tuple(episodes), Schema.anonymous(1, 2))
        report = eutree.fit(late, episodes=0)
        assert report.policy.history == 1
        assert "with one previous observation" in report.choice
        assert eutree.fit(late, episodes=0, history=0).policy.history == 0
        prompt = [wrong(e, actions=(e.observations[:-1, 0] > 0.5).astype(int)) for e in episodes]
        found = fitted_trees(
            replace(late, episodes=tuple(prompt)), settings=SETTINGS, histories=(0, 1)
        )
        assert {entry.policy.history for entry in promising(found, 8)} == {0}


class TestRace:
    def test_the_better_tree_wins_within_the_budget(self, corridor, shown):
        trees = [leaf(0, shown.schema), leaf(1, shown.schema), eutree.fit_expert_tree(shown)]
        found = [FittedTree(tree, RELEASE_8, np.ones(1)) for tree in trees]
        player = Player(corridor, seed=0)
        winner, played = race(found, player, 60)
        assert winner is found[2]
        assert played.policy is trees[2]
        assert player.episodes <= 60
        assert len(played.episodes) == 2 * 12  # of three trees, and twice as many of the best two

    def test_the_first_wins_ties_and_a_block_is_the_same_for_all(self, corridor, shown):
        tree = eutree.fit_expert_tree(shown)
        found = [FittedTree(tree, RELEASE_8, np.ones(1)) for _ in range(2)]
        assert race(found, Player(corridor, seed=0), 20)[0] is found[0]
        player = Player(corridor, seed=5)
        first, again = (player.play(tree, 3, block=2) for _ in range(2))
        other = player.play(tree, 3, block=3)
        assert all(a.equals(b) for a, b in zip(first.episodes, again.episodes, strict=True))
        assert not first.episodes[0].equals(other.episodes[0])


class TestWorths:
    def test_success_counts_before_the_return_and_the_return_among_equals(self, corridor, shown):
        played = Player(corridor, 0).play(eutree.fit_expert_tree(shown), 2, 0)
        lucky, rich = played.episodes
        low = wrong(lucky, rewards=np.full(len(lucky), -50.0), is_success=True)
        high = wrong(rich, rewards=np.full(len(rich), 50.0), is_success=False)
        more = wrong(low, rewards=np.full(len(lucky), -49.0))
        worths = Played(played.policy, (low, high, more)).worths
        assert worths[2] > worths[0] > worths[1]
        silent = tuple(wrong(episode, is_success=None) for episode in (low, high))
        worths = Played(played.policy, silent).worths
        assert worths[1] > worths[0]

    def test_episodes_of_a_block_go_on_where_they_stopped(self, corridor, shown):
        player, tree = Player(corridor, 0), eutree.fit_expert_tree(shown)
        whole, second = player.play(tree, 5, 3), player.play(tree, 3, 3, first=2)
        pairs = zip(whole.episodes[2:], second.episodes, strict=True)
        assert all(one.equals(other) for one, other in pairs)


class TestRepair:
    def test_the_leaf_that_waits_for_ever_is_blamed(self, corridor, shown):
        tree = by_hand(shown.schema, door=(0, 0))
        played = Player(corridor, seed=0).play(tree, 10, block=0)
        guilt = blame(played, played.failed(0.0))
        assert played.failed(0.0).all()
        assert guilt.argmax() in (1, 2)
        assert guilt.max() > guilt[0]

    def test_the_three_repairs_of_a_leaf(self, shown):
        tree = by_hand(shown.schema, door=(0, 0))
        counts = shown_in(tree, shown)
        assert counts.sum() == shown.n_transitions
        assert counts[0].tolist() == [0, 48]
        assert counts[2, 1] == 12
        found = list(repairs(tree, shown, 2))
        relabelled, cut, dropped = (policy for policy, _ in found)
        assert relabelled.predict([[4.0, 0.6]])[0] == [1]
        assert relabelled.predict([[4.0, 0.4]])[0] == [0]
        assert cut.predict([[4.0, 0.6], [4.0, 0.9], [4.0, 0.4], [1.0, 0.1]])[0].tolist() == [
            *(0, 1, 0, 1)
        ]
        assert dropped.n_leaves == 2
        assert "walk in place of wait" in found[0][1]

    def test_a_repair_is_what_makes_the_tree_move(self, corridor, shown):
        stuck = FittedTree(by_hand(shown.schema, door=(0, 0)), RELEASE_8, np.ones(1))
        player = Player(corridor, seed=1)
        played = player.play(stuck.policy, 20, block=0)
        assert played.evaluation.success_rate == 0.0
        mended, again = mend(stuck, played, shown, player, 20)
        assert again.evaluation.success_rate > 0.9
        assert "a leaf cut further" in str(mended)

    def test_a_tree_as_good_as_the_person_is_left_alone(self, corridor, shown):
        good = FittedTree(eutree.fit_expert_tree(shown), RELEASE_8, np.ones(1))
        player = Player(corridor, seed=1)
        played = player.play(good.policy, 20, block=0)
        assert mend(good, played, shown, player, 20) == (good, played)
        assert player.episodes == 20


class TestPerson:
    def test_only_what_ended_counts(self, shown):
        person = Person.of(shown)
        assert (person.success_rate, person.episodes) == (1.0, 12)
        assert person.mean_return == 10.0
        left = [wrong(shown.episodes[0], terminated=False), *shown.episodes[1:]]
        assert Person.of(replace(shown, episodes=tuple(left))).episodes == 11

    @pytest.mark.parametrize(("rate", "above"), [(0.96, False), (0.98, False), (0.9, True)])
    def test_three_points_are_the_same(self, shown, rate, above):
        successes = np.arange(100) < 100 * rate
        episodes = [wrong(shown.episodes[0], is_success=bool(success)) for success in successes]
        figures = Played(eutree.fit_expert_tree(shown), tuple(episodes)).evaluation
        won = np.arange(200) < 197
        own = Evaluation(np.full(200, 10.0), np.ones(200), np.full(200, "end"), won)
        assert Person(own).is_above(figures) is above


class TestPractice:
    def test_the_challenger_on_trial_at_the_end_is_returned_too(self):
        """Its evaluation was cut short: it has to be played before anybody trusts it."""
        demonstrations = folder("evasion", 2)
        env = gymnasium.make("eutree/Evasion2-v0")
        tree = eutree.fit_expert_tree(demonstrations)
        played = Player(env, 0).play(tree, 30, 0).episodes
        seen = []
        found = practise(
            tree, demonstrations, played, env, episodes=20, seed=2, on_progress=seen.append
        )
        plan = seen[-1].learner.plan
        assert plan.challenger is not None
        policy, challenger = found
        assert policy.n_leaves == n_leaves(plan.incumbent)
        assert challenger.n_leaves == n_leaves(plan.challenger)
        assert challenger.environment == policy.environment

    def test_only_the_last_steps_of_long_plays_are_known(self, corridor, shown, monkeypatch):
        monkeypatch.setattr(playing, "MOST_KNOWN", 20)
        played = Player(corridor, 0).play(by_hand(shown.schema, door=(0, 1)), 50, 0).episodes
        kept = playing._recent(played)
        assert sum(map(len, kept)) <= 20 < sum(map(len, kept)) + len(played[-len(kept) - 1])
        assert kept == played[-len(kept) :]
