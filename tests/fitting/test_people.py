"""Simulated people: late, misjudging, asleep now and then, and the same for the same number."""

import numpy as np
import pytest
from benchmarks.people import TASKS, Person, Task, Traits, folder, person, take_over

import eutree

SHARP = Traits(delay=0.0, noise=0.0, lapse=0.0)
TASK = Task(make=TASKS["evasion"].make, interval=1.0, spread=(1.0,), idle=0, styles={})


def hands(traits, wants=lambda seen, moved, held: (seen[..., 0] > 0.5).astype(int)):
    return Person("test", wants, TASK, traits, np.random.default_rng(0))


def actions_of(hands, observations):
    state, actions = None, []
    for observation in observations:
        action, state = hands.predict(np.atleast_1d(observation), state)
        actions.append(int(action))
    return actions


def test_sharp_hands_follow_their_style():
    assert actions_of(hands(SHARP), [0.0, 1.0, 0.0]) == [0, 1, 0]


def test_late_hands_act_on_what_was_on_the_screen():
    late = Traits(delay=1.0, noise=0.0, lapse=0.0)
    assert actions_of(hands(late), [1.0, 0.0, 0.0, 1.0]) == [1, 1, 0, 0]
    later = Traits(delay=1.6, noise=0.0, lapse=0.0)  # 0.4 of what was there one decision ago
    assert actions_of(hands(later), [1.0, 0.0, 0.0, 0.0, 0.0]) == [1, 1, 1, 0, 0]


def test_a_missed_first_decision_is_the_idle_action():
    missed = Traits(delay=0.0, noise=0.0, lapse=0.0, misses_first=True)
    assert actions_of(hands(missed), [1.0, 1.0, 1.0]) == [0, 1, 1]


def test_a_lapse_keeps_the_last_key():
    asleep = Traits(delay=0.0, noise=0.0, lapse=1.0)
    assert actions_of(hands(asleep), [1.0, 0.0, 0.0, 1.0]) == [1, 1, 1, 1]
    lapses = Traits(delay=0.0, noise=0.0, lapse=0.1)
    changing = np.arange(2000) % 2
    kept = np.mean(np.array(actions_of(hands(lapses), changing))[1:] != changing[1:])
    assert abs(kept - 0.1) < 4 * np.sqrt(0.1 * 0.9 / 2000)


def test_what_is_misjudged_has_the_spread_of_the_noise():
    def wants(seen, moved, held):
        return seen[..., 0]

    noisy = Traits(delay=0.0, noise=0.3, lapse=0.0)
    seen, _ = hands(noisy, wants).predict(np.zeros((5000, 1)))
    assert abs(seen.std() - 0.3) < 4 * 0.3 / np.sqrt(2 * 5000)


@pytest.mark.parametrize("task", TASKS)
def test_a_folder_repeats_and_another_one_differs(task):
    first, again = (folder(task, 3, episodes=2) for _ in range(2))
    assert first.digest == again.digest
    other = 3 + len(TASKS[task].styles)
    assert first.digest != folder(task, other, episodes=2).digest
    assert first.expert == person(task, other).__name__  # the same style, with other hands


def test_who_tires_reacts_later_and_who_learns_misjudges_less():
    tired, learning = (person("new-evasion", number) for number in (2, 3))
    assert (tired.__name__, learning.__name__) == ("tired", "learning")
    before = tired.traits.delay, learning.traits.noise
    for hands in (tired, learning):
        actions_of(hands, [[float(k), 0.0, 0.0] for k in range(150)])
    assert tired.traits.delay > before[0] + 0.1
    assert learning.traits.noise <= before[1]


def test_whoever_takes_over_leaves_episodes_that_say_so():
    shown = folder("evasion", 2, episodes=3)
    known = take_over("evasion", 2, shown, eutree.fit_expert_tree(shown))
    assert known.episodes[:3] == shown.episodes
    driven = known.episodes[3:]
    assert driven
    assert not any(episode.is_evidence for episode in driven)
    acted = [episode.by_hand.mean() for episode in driven]
    assert 0.0 < sum(acted) < len(acted)


def test_one_episode_and_many_side_by_side_are_the_same_person():
    env = TASKS["evasion"].make()
    quiet = Traits(delay=0.25, noise=0.0, lapse=0.0)
    wants = TASKS["evasion"].styles["waits"](quiet, np.random.default_rng(0))
    hands = Person("waits", wants, TASKS["evasion"], quiet, np.random.default_rng(0))
    together = eutree.evaluate(hands, env, episodes=12, seed=1)
    alone = eutree.evaluate(hands, env, episodes=1, seed=1)
    assert together.returns[0] == alone.returns[0]
    assert together.success_rate > 0.5
