"""When a person decided: what was on the screen, and how late the keys came."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations, Episode
from eutree.data.timing import estimate_delay, has_times, shift_delay
from eutree.errors import InvalidArgumentError
from eutree.schema import Schema
from tests.interaction.people import TICK, Corridor, Person


def timed(pictures, edges=(), frames=None):
    """Four steps, one a second, at places 0, 10, 20, 30; ``edges`` of the key a."""
    episode = Episode(
        observations=np.array([[0.5, 0.0], [10.5, 1.0], [20.5, 2.0], [30.5, 3.0], [40.5, 4.0]]),
        actions=[0, 0, 1, 1],
        rewards=np.zeros(4),
        terminated=False,
        truncated=False,
        steps={
            "time": np.array([1.0, 2.0, 3.0, 4.0]),
            "picture": np.array(pictures),
            "frame": np.array(pictures if frames is None else frames),
        },
        extras={"keys": ["a"], "edges": [["a", True, *edge] for edge in edges]},
    )
    return Demonstrations((episode,), Schema.anonymous(2, 2))


SMOOTH, STILL = [1, 31, 61, 91], [1, 2, 3, 4]


def test_a_key_is_labelled_with_what_moved_on_the_screen() -> None:
    demos = timed(SMOOTH, [(2.5, 46)])
    shifted = shift_delay(demos)
    assert shifted.observations[:, 0].tolist() == [0.5, 10.5, 15.5, 30.5]
    assert shifted.observations[:, 1].tolist() == [0.0, 1.0, 1.0, 3.0]  # a count is not halved
    assert shifted.actions.tolist() == demos.actions.tolist()
    assert demos.observations[:, 0].tolist() == [0.5, 10.5, 20.5, 30.5]  # as recorded


def test_a_still_picture_stays_what_it_was() -> None:
    assert shift_delay(timed(STILL, [(2.5, 3)])).observations[2, 0] == 20.5
    late = shift_delay(timed(STILL, [(2.02, 2)]))  # pressed before the next picture was drawn
    assert late.observations[2, 0] == 10.5


def test_a_screen_that_is_behind_is_taken_at_its_word() -> None:
    demos = timed(SMOOTH, frames=[1, 16, 46, 76])
    assert shift_delay(demos).observations[:, 0].tolist() == [0.5, 5.5, 15.5, 25.5]
    assert estimate_delay(demos).screen == pytest.approx(np.mean([0, 15, 15, 15]) / 30)


def test_a_reaction_time_looks_further_back() -> None:
    shifted = shift_delay(timed(SMOOTH, [(2.5, 46)]), delay=0.2)
    assert shifted.observations[:, 0] == pytest.approx([0.5, 8.5, 13.5, 28.5], abs=0.05)


def test_a_pause_is_not_a_wait() -> None:
    demos = timed(SMOOTH, [(1.5, 16), (3.2, 70)])
    late = {**demos.episodes[0].steps, "time": np.array([1.0, 2.0, 3.0, 90.0])}
    paused = replace(demos, episodes=(replace(demos.episodes[0], steps=late),))
    assert estimate_delay(paused).wait == 0.5


def test_turns_have_no_delay() -> None:
    demos = timed(SMOOTH, [(2.5, 46)])
    turns = replace(demos.episodes[0], extras={**demos.episodes[0].extras, "turn_based": True})
    turns = replace(demos, episodes=(turns,))
    assert np.array_equal(shift_delay(turns).observations, turns.observations)


def test_what_was_not_timed_is_refused() -> None:
    env = gymnasium.make("eutree/Evasion2-v0")
    scripted = eutree.record(env, eutree.experts.wait_at_crossing, episodes=2)
    assert not has_times(scripted)
    for function in (shift_delay, estimate_delay):
        with pytest.raises(InvalidArgumentError, match="episode 0 has none"):
            function(scripted)
    with pytest.raises(InvalidArgumentError, match="delay must be"):
        shift_delay(timed(STILL), delay=-0.1)


@pytest.mark.parametrize("delay", [0.2, 0.45])
def test_the_reaction_of_a_person_at_the_engine_is_found(delay) -> None:
    """They press or let go a while after every picture, of which there is one a second."""
    person = Person(Corridor(length=10**6, limit=12), fps=1.0, target=3)
    for _ in range(2):
        person.tap("enter").until("playing")
        held = False
        while person.view.state == "playing":
            step = person.view.step
            while person.view.step == step and person.view.state == "playing":
                person.wait(TICK)
            if person.view.state == "playing":
                person.wait(delay)
                (person.release if held else person.press)("right")
                held = not held
        person.release("right").wait(1.0)
    env = person.session.env
    demos = Demonstrations(tuple(person.session.episodes), env.schema, env.spec)
    found = estimate_delay(demos)
    assert found.reaction == pytest.approx(delay, abs=3 * TICK)
    assert found.wait == pytest.approx(1.0 - delay, abs=3 * TICK)
    assert found.n_edges >= 20
