"""A tree that drives in the recorder's picture: the worst first, each failure explained."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations, Episode
from eutree.fitting import Person as Judged
from eutree.interaction import episode_seed
from eutree.interaction.episode import replay
from eutree.interaction.guard import GuardedEnv
from eutree.recording import Recorder, SessionSettings
from eutree.recording.driving import READ_SECONDS
from eutree.recording.events import Away, EpisodeChanged, EpisodeEnded
from eutree.recording.play import REVIEW_SECONDS
from eutree.recording.scenes import (
    Course,
    Programme,
    Scene,
    explained,
    missing,
    scenes,
    worst_first,
)
from eutree.trees import DecisionTree
from tests.recording.people import TICK, Corridor, Person

SCHEMA = GuardedEnv(Corridor()).schema
LEFT, STAY, RIGHT = 0, 1, 2


def always(action):
    tree = DecisionTree.single_leaf(n_features=2)
    return eutree.TreePolicy(tree=tree, actions=np.array([action]), schema=SCHEMA)


def stops_at(place):
    """Walk right up to a place, and stay there for good."""
    tree = DecisionTree.single_leaf(n_features=2).split(leaf=0, feature=0, threshold=place)
    return eutree.TreePolicy(tree=tree, actions=np.array([RIGHT, STAY]), schema=SCHEMA)


def played(tree, episodes=20):
    """Return seeds, returns and successes of a tree in the corridor."""
    result = eutree.evaluate(tree, Corridor(), episodes=episodes, seed=3)
    return [episode_seed(3, k) for k in range(episodes)], result.returns, result.successes.tolist()


def test_failures_come_first_and_then_what_earned_most() -> None:
    returns = np.array([3.0, -1.0, 2.0, -5.0, 4.0])
    assert worst_first(returns, [True, False, True, False, True]) == ([3, 1, 0, 4], 2)
    assert worst_first(returns, None) == ([3, 1, 2], 0)
    assert worst_first(returns, [True] * 5) == ([3, 1, 2], 0)
    assert worst_first(np.zeros(50), [False] * 50)[1] == 6  # nobody watches fifty


def test_why_names_the_decision_that_would_have_been_better() -> None:
    programme = scenes(stops_at(2.0), *played(stops_at(2.0)), GuardedEnv(Corridor()))
    assert programme.note == "20 of 20 episodes failed"
    first = programme.scenes[0].why
    assert "it took only stay with place 3 m" in first
    assert "(it asked for place alone)" in first
    assert "With right for 2 steps, the end would have been 'terminated'." in first


def test_what_is_missing_is_a_failure_that_one_decision_would_have_mended() -> None:
    seeds, _, successes = played(stops_at(2.0))
    env = GuardedEnv(Corridor())
    found = missing(stops_at(2.0), seeds, successes, env)
    assert found.seed == seeds[0]
    assert found.why.startswith("The tree of what you have shown so far fails in 20 of 20 episodes")
    assert "it took only stay" in found.why
    assert missing(always(RIGHT), seeds, [True] * 20, env) is None
    far = GuardedEnv(Corridor(length=500))
    assert missing(always(STAY), seeds, [False] * 20, far) is None  # nothing would have helped


def test_the_next_episode_begins_where_something_was_missing(person) -> None:
    for _ in range(2):
        person.walk()
    assert not person.session.wishes.look  # too few to say
    person.session.wishes.look = False
    person.session.recording._settings = replace(person.session.settings, target=9)
    person.session.settings = person.session.recording._settings
    person.walk()
    assert person.session.wishes.look
    person.session.recording.missing = Scene(4711, "never waited")
    assert person.wait(0.1).view.missing == "never waited"
    person.do("missing").until("playing").press("right").until("review").release("right")
    assert person.view.missing == ""
    shown = stored(person)[-1]
    assert (shown.seed, shown.extras["chosen_start"], shown.is_evidence) == (4711, True, False)
    person.wait(1.0).tap("r").until("playing").press("right").until("review").release("right")
    assert stored(person)[-1].seed == 4711  # the same start again is that start
    person.wait(1.0).walk()
    assert stored(person)[-1].seed != 4711
    assert stored(person)[-1].is_evidence
    assert Judged.of(Demonstrations(tuple(stored(person)), SCHEMA)).episodes == 4


def test_where_nothing_would_have_helped_it_says_so() -> None:
    far = GuardedEnv(Corridor(length=500))
    scene = explained(Scene(episode_seed(0, 0)), always(STAY), far)
    assert "No single decision" in scene.why


def test_without_successes_a_better_return_is_said() -> None:
    cart = gymnasium.make("CartPole-v1")
    env = GuardedEnv(cart)
    tree = DecisionTree.single_leaf(n_features=4)
    push = eutree.TreePolicy(tree=tree, actions=np.array([1]), schema=env.schema)
    result = eutree.evaluate(push, cart, episodes=5, seed=0)
    seeds = [episode_seed(0, k) for k in range(5)]
    programme = scenes(push, seeds, result.returns, None, env)
    assert programme.note == "the lowest of 5 returns"
    assert result.returns[seeds.index(programme.scenes[0].seed)] == result.returns.min()
    assert "it would have earned" in explained(programme.scenes[0], push, env).why


def test_the_way_is_what_was_tested_and_sensed() -> None:
    course = Course(stops_at(2.0))
    assert course.decide(np.array([1.0, 0.0])) == RIGHT
    assert (course.nodes, course.tests) == ((0, 1), ("place 1 m ≤ 2",))
    assert course.decide(np.array([2.5, 0.0])) == STAY
    assert (course.nodes, course.tests) == ((0, 2), ("place 2.5 m > 2",))


def test_a_tree_that_remembers_shows_the_way_of_what_it_remembers() -> None:
    demos = eutree.record(Corridor(), lambda env: always(RIGHT), episodes=2, seed=0)
    past = replace(eutree.fit_expert_tree(demos.with_history(1)), history=1)
    course = Course(past)
    assert [course.decide(np.array([p, p])) for p in (0.0, 1.0)] == [RIGHT, RIGHT]
    assert course.nodes == (0,)


SEEN = np.column_stack([np.arange(9.0), np.arange(9.0)])


@pytest.mark.parametrize(
    ("by_hand", "success", "weights"),
    [
        ("00000000", True, "11111111"),
        ("00000000", None, "11111111"),
        ("00000000", False, "11111100"),
        ("00011000", True, "10011111"),
        ("01011000", True, "01011111"),  # one step in between: shown ones stay
        ("10000111", False, "10000111".replace("0000", "1100")),
    ],
)
def test_what_was_let_pass_is_approved_but_for_the_steps_before(by_hand, success, weights) -> None:
    hands = np.array([int(one) for one in by_hand], dtype=bool)
    episode = Episode(SEEN, np.ones(8), np.zeros(8), True, False, is_success=success)
    assert episode.by_hand is None
    assert episode.weights.tolist() == [1.0] * 8
    driven = replace(episode, steps={"by_hand": hands})
    assert driven.by_hand.tolist() == hands.tolist()
    assert driven.weights.astype(int).tolist() == [int(one) for one in weights]


def test_a_driven_episode_teaches_by_its_weights_and_is_no_evidence_on_the_person() -> None:
    shown = Episode(SEEN, np.full(8, STAY), np.zeros(8), True, False, is_success=True)
    hands = np.array([0, 0, 0, 0, 0, 0, 1, 1], dtype=bool)
    driven = replace(shown, actions=np.array([2, 2, 2, 2, 0, 0, 2, 2]), steps={"by_hand": hands})
    demos = Demonstrations((shown, driven), SCHEMA)
    assert LEFT not in eutree.fit_expert_tree(Demonstrations((driven,), SCHEMA)).actions
    all_alike = eutree.fit_expert_tree(Demonstrations((driven,), SCHEMA), weights=np.ones(8))
    assert LEFT in all_alike.actions  # or the test above could not fail
    assert Judged.of(demos).episodes == 1


def correcting(person, tree, refit=None):
    """Let a tree drive that may be corrected."""
    person.session.driving.offer(Programme(tree, refit=refit or (lambda: tree)))
    return person.do("correct").until("driving")


def stored(person):
    return [output.episode for output in person.outputs if isinstance(output, EpisodeEnded)]


def test_a_held_key_acts_and_letting_go_hands_back(person) -> None:
    correcting(person, always(STAY)).wait(0.35)
    person.press("right").wait(0.3).release("right").wait(0.2)
    assert not person.view.driving.by_hand
    person.press("down").wait(0.2).release("down")  # the action that has no key
    until_over(person)
    (episode,) = stored(person)
    assert episode.by_hand.sum() in (4, 5, 6)
    assert set(episode.actions[~episode.by_hand]) == {STAY}
    assert set(episode.actions[episode.by_hand]) == {RIGHT, STAY}
    assert person.view.driving.n_by_hand == episode.by_hand.sum()


def test_the_key_of_no_key_counts_where_it_was_pressed_last() -> None:
    """Pressing stop during a held go had no effect."""
    person = correcting(Person(Corridor(length=1000, limit=100_000)), always(LEFT))

    def acts():
        return person.wait(0.25).view.driving.by_hand, person.view.action

    assert acts() == (False, LEFT)
    person.press("right")
    assert acts() == (True, RIGHT)
    person.press("down")
    assert acts() == (True, STAY)
    person.release("right")
    assert acts() == (True, STAY)
    person.press("right")
    assert acts() == (True, RIGHT)
    person.release("right")
    assert acts() == (True, STAY)
    person.release("down")
    assert acts() == (False, LEFT)


def test_the_tree_of_all_that_is_stored_drives_on(person) -> None:
    trees = iter([always(RIGHT), always(LEFT)])
    correcting(person, always(STAY), lambda: next(trees))
    until_over(person)
    person.until("driving").wait(2.0)
    assert person.view.driving.number == 2
    assert until_over(person).success
    person.wait(2.0)
    first, second = stored(person)
    assert (set(first.actions), set(second.actions)) == ({STAY}, {RIGHT})
    assert first.seed != second.seed


def test_a_tree_is_fitted_again_behind_what_is_stored(person) -> None:
    """It was fitted to the episode that was being discarded, too."""
    known = []

    def refit():
        changed = [output for output in person.outputs if isinstance(output, EpisodeChanged)]
        known.append((len(stored(person)), len(changed)))
        return always(STAY)

    correcting(person, always(STAY), refit)
    until_over(person)
    assert known == [(1, 0)]
    person.tap("delete").wait(0.2)
    assert known == [(1, 0), (1, 1)]
    person.tap("delete").wait(0.2)  # in the middle of the next one
    assert known[2][0] == 2


def test_an_end_is_read_once_the_tree_is_fitted_to_it(person) -> None:
    """The page was told a second later, and the next episode began when it had just been told."""

    def refit():
        person.now += 1.2  # a clock goes on, whatever is fitted
        return always(STAY)

    correcting(person, always(STAY), refit)
    while not person.view.driving.is_over:
        person.wait(TICK)
    shown = person.now
    while person.view.driving.number == 1:
        person.wait(TICK)
    assert person.now - shown == pytest.approx(READ_SECONDS, abs=3 * TICK)


@pytest.mark.parametrize("steps", [0, 2])
def test_who_discards_when_the_next_has_just_begun_means_the_one_that_ended(person, steps) -> None:
    """The one that ended was kept, and the one under way was discarded."""
    correcting(person, always(STAY))
    until_over(person)
    while person.view.driving.number == 1:
        person.wait(TICK)
    seed = person.session.play.trial.seed
    person.wait(0.1 * steps + 0.05).tap("delete")
    assert [(row.kept, row.comment) for row in person.view.episodes] == [(False, "discarded")]
    assert (person.view.driving.number, person.session.play.trial.seed) == (2, seed)
    person.wait(REVIEW_SECONDS).tap("delete")  # and then the one under way
    assert [(row.result, row.kept) for row in person.view.episodes][1:] == [("stopped", False)]
    assert person.view.driving.number == 3


def test_what_the_person_did_alone_is_not_discarded_where_a_tree_begins(person) -> None:
    correcting(person.walk(), always(STAY)).tap("delete").tap("delete").tap("e").tap("delete")
    assert [row.kept for row in person.view.episodes] == [True]


def test_the_key_that_begins_again_does_not_end_a_pause_of_driving(person) -> None:
    correcting(person, always(STAY)).wait(0.3).tap("p").tap("r").wait(0.2)
    assert person.view.driving.is_paused
    assert not person.tap("enter").view.driving.is_paused


def test_driven_episodes_are_not_counted_as_shown_and_may_be_discarded(person) -> None:
    correcting(person, always(STAY)).wait(0.5).tap("delete")
    assert (stored(person)[0].kept, stored(person)[0].comment) == (False, "discarded")
    until_over(person)
    person.tap("delete")
    assert not person.session.episodes[1].kept
    until_over(person)
    person.tap("escape")
    assert person.view.state == "opening"
    assert person.view.saved == 0
    assert [episode.by_hand for episode in person.view.episodes] == [0, 0, 0]
    assert person.session.episodes[2].kept


def test_who_leaves_in_the_middle_pauses_it_and_the_keys_go_up(person) -> None:
    correcting(person, always(STAY)).press("right").wait(0.3)
    step = person.view.step
    person.tick(Away("gone"))
    assert person.view.driving.is_paused
    assert person.view.held == []
    assert person.wait(2.0).view.step == step
    person.tap("enter").wait(0.5)
    assert not person.view.driving.by_hand
    person.tap("escape")
    assert stored(person)[0].comment == "left early"


@pytest.mark.parametrize("key", ["enter", "space"])
def test_the_key_that_ends_a_pause_of_driving_may_be_an_action_s_and_does_not_act(key) -> None:
    person = Person(Keyed()).walk(key)
    correcting(person, always(STAY)).wait(0.3).press(key).wait(0.3)
    assert person.view.driving.by_hand  # while it drives on the key acts
    person.release(key).tap("p").wait(0.2)
    step, n_by_hand = person.view.step, person.view.driving.n_by_hand
    assert person.press(key).wait(0.3).release(key).view.step > step
    assert (person.view.driving.is_paused, person.view.held) == (False, [])
    assert person.view.driving.n_by_hand == n_by_hand
    person.tap("p").tap("escape")  # and a pause that was left is over
    person.wait(1.0).tap("enter").until("playing")
    assert person.press(key).wait(0.3).view.action == RIGHT


class Keyed(Corridor):
    """A corridor in which Space and Enter act."""

    def get_keys_to_action(self):
        return {("space",): RIGHT, ("enter",): RIGHT, (): STAY}


def test_who_stops_before_the_first_step_has_recorded_what_was_before(person) -> None:
    person.walk()
    reached = person.frames[-1][1]
    correcting(person, always(STAY)).tap("escape").wait(0.3)
    assert (person.view.state, person.view.last) == ("review", 0)
    assert (person.frames[-1][1].pixels == reached.pixels).all()
    correcting(person, always(STAY))
    until_over(person)
    person.tap("enter").tap("escape")
    assert (person.view.state, person.view.last) == ("review", 1)
    person.wait(1.0).tap("enter").wait(1.0).tap("p").tap("e")  # of an own one nothing is said
    assert (person.view.state, person.view.last) == ("review", None)


def test_the_action_taken_is_shown_where_the_one_by_hand_is_masked() -> None:
    person = Person(Walled())
    correcting(person, always(STAY)).press("right").wait(0.3)
    assert person.view.driving.by_hand
    assert person.view.action == LEFT
    person.release("right").wait(0.2)
    assert person.view.action == STAY


class Walled(Corridor):
    """A corridor in which nobody may go to the right."""

    def action_masks(self):
        return np.array([True, True, False])


def test_without_a_way_to_fit_nothing_can_be_corrected(person) -> None:
    person.session.driving.offer(Programme(always(STAY), (Scene(0),)))
    person.do("correct").until("watching")
    assert not person.view.can_correct


def test_corrections_survive_in_the_folder(tmp_path) -> None:
    env = Corridor()
    recorder = Recorder(env, tmp_path / "demos", settings=SessionSettings(countdown=0.0))
    person = Person(session=recorder.session, tick=recorder.tick)
    correcting(person, always(STAY)).press("right").wait(0.3).release("right")
    until_over(person)
    recorder.close()
    (episode,) = Demonstrations.load(tmp_path / "demos").episodes
    assert episode.by_hand.dtype == bool
    assert 1 <= episode.by_hand.sum() < len(episode)
    assert all(result.is_equal for result in replay(Demonstrations.load(tmp_path / "demos"), env))
    again = Recorder(env, tmp_path / "demos")
    assert again.session.recording.n_kept == 0  # none was shown by the person alone


@pytest.fixture
def person():
    return Person(Corridor(length=5, limit=20))


def offer(person, tree, *, failing=True):
    seeds, returns, successes = played(tree)
    person.session.driving.offer(scenes(tree, seeds, returns, successes, GuardedEnv(Corridor())))
    return person.until("watching") if failing else person


def until_over(person, limit=60.0):
    end = person.now + limit
    while not person.view.driving.is_over:
        assert person.now < end
        person.wait(0.1)
    return person.view.driving


def test_the_tree_drives_and_nothing_is_stored(person) -> None:
    offer(person, stops_at(2.0))
    assert not person.outputs
    driving = until_over(person)
    assert (driving.number, driving.of, driving.success) == (1, 6, False)
    assert "With right" in driving.why
    person.wait(30.0)
    assert person.view.driving.number == 1  # a sentence waits for whoever reads it
    for _ in range(driving.of):
        until_over(person)
        person.tap("enter")
    assert person.view.state == "opening"
    assert person.outputs == []
    assert person.session.episodes == []


def test_what_succeeded_goes_on_by_itself(person) -> None:
    offer(person, always(RIGHT))
    assert until_over(person).why == ""
    person.until("opening")


def test_it_pauses_repeats_skips_and_ends_by_keys_and_by_leaving(person) -> None:
    offer(person, stops_at(2.0))
    person.wait(0.5).tap("p")
    step = person.view.step
    assert person.wait(3.0).view.step == step
    assert person.view.driving.is_paused
    person.tap("enter")  # goes on
    assert person.wait(0.5).view.step > step
    person.tap("r")
    assert person.view.step == 0
    person.tap("e")
    assert person.view.driving.number == 2
    person.tick(Away("gone"))
    assert person.view.driving.is_paused
    person.tap("escape")
    assert person.view.state == "opening"
    person.do("watch").until("watching")  # once more


def test_nobody_is_interrupted_and_recording_goes_on_after_it(person) -> None:
    person.tap("enter").until("playing")
    offer(person, always(RIGHT), failing=False)
    person.press("right").wait(0.3)
    assert person.view.state == "playing"
    person.until("review").release("right")
    person.until("watching").tap("escape")
    assert person.view.state == "review"
    assert person.view.episodes[0].success
    person.wait(1.0).tap("enter").until("playing")
    assert [type(output).__name__ for output in person.outputs].count("EpisodeStarted") == 2


def test_the_picture_is_again_that_of_the_words_beside_it(person) -> None:
    """The tree's collision stood above "Goal reached", and above "Show how it is done"."""
    offer(person, stops_at(2.0), failing=False)
    opening = person.frames[0][1]
    person.wait(0.5).tap("escape").wait(0.3)
    assert (person.view.state, person.frames[-1][1].number) == ("opening", person.frame)
    assert (person.frames[-1][1].pixels == opening.pixels).all()
    person.tap("enter").until("playing").press("right").until("review").release("right")
    reached = person.frames[-1][1]
    person.do("watch").until("watching").wait(0.5)
    assert (person.frames[-1][1].pixels != reached.pixels).any()
    person.tap("escape").wait(0.3)
    assert person.view.state == "review"
    assert (person.frames[-1][1].pixels == reached.pixels).all()
    person.wait(1.0).tap("enter").until("playing")
    assert (person.frames[-1][1].pixels != reached.pixels).any()


def test_the_seed_of_a_scene_is_what_is_seen(person) -> None:
    seed = next(s for s in range(20) if GuardedEnv(Corridor()).reset(s)[0] == 1.0)
    person.session.driving.offer(Programme(always(RIGHT), (Scene(seed),)))
    person.until("watching")
    assert person.session.play.trial.observation.tolist() == [1.0, 0.0]


def test_a_tree_may_be_offered_while_another_drives(person) -> None:
    offer(person, stops_at(2.0))
    person.wait(0.5)
    offer(person, always(RIGHT)).tick()
    assert person.view.driving.note == "no failure seen"
    assert person.view.step == 0
