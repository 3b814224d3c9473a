"""Pictures: the right things in the right places; windows that need no display."""

import sys

import gymnasium
import numpy as np
import pytest

from eutree.envs import painting as render
from eutree.envs._dynamics import EvasionParameters, EvasionState
from eutree.envs.evasion import EvasionEnv
from eutree.envs.painting import PAPER
from eutree.errors import MissingExtraError

pytest.importorskip("pygame", reason="needs the extra record")

PARAMETERS = EvasionParameters(n_opponents=2)


def state(position: float = 4.0, opponents: tuple = (5.0, -7.0), heading: float = 1.0):
    return EvasionState(
        position=np.array(position),
        opponents=np.array(opponents, dtype=np.float64),
        directions=np.full(len(opponents), heading),
    )


def pixel(image: np.ndarray, along: float, across: float) -> list[int]:
    x, y = render.Scale.fit(PARAMETERS).at(along, across)
    return image[round(y / render.SMOOTHING), round(x / render.SMOOTHING)].astype(int).tolist()


def is_near(color: list[int], expected: tuple[int, ...], tolerance: int = 25) -> bool:
    return max(abs(a - b) for a, b in zip(color, expected, strict=True)) <= tolerance


def test_everybody_is_where_the_state_says() -> None:
    image = render.picture(PARAMETERS, state())
    assert image.shape == (400, 600, 3)
    assert image.dtype == np.uint8
    off_centre = 0.38  # beside the white middle of a disc
    assert is_near(pixel(image, 4.0, off_centre), render.AGENT)
    assert is_near(pixel(image, 10.0 + off_centre, 5.0), render.OPPONENT)
    assert is_near(pixel(image, 20.0 + off_centre, -7.0), render.OPPONENT)
    assert is_near(pixel(image, 30.0, 0.0), render.GOAL_COLOR)
    assert is_near(pixel(image, 16.0, 5.0), PAPER)
    assert is_near(pixel(image, 14.5, 0.0), render.PATH)
    assert is_near(pixel(image, 8.0, 1.0), render.GATE, 110)
    assert not is_near(pixel(image, 8.0, 1.0), PAPER, 60)


def test_picture_is_a_function_of_the_state() -> None:
    first = render.picture(PARAMETERS, state())
    assert (first == render.picture(PARAMETERS, state())).all()
    for other in (
        state(position=4.5),
        state(opponents=(5.0, -6.5)),
        state(heading=-1.0),  # the trail shows where an opponent is heading
    ):
        assert (first != render.picture(PARAMETERS, other)).any()


def test_collision_and_goal_change_the_agents_colour() -> None:
    hit = render.picture(PARAMETERS, state(position=9.0, opponents=(1.5, -7.0)))
    assert is_near(pixel(hit, 9.0, 0.38), render.OPPONENT)
    there = render.picture(PARAMETERS, state(position=30.0))
    assert is_near(pixel(there, 30.0, 0.38), render.GOAL_COLOR)


def test_an_opponent_touches_the_ring_at_the_collision_distance() -> None:
    """Its disc and the ring meet half-way: the space between them is what is left."""
    for distance, touching in ((2.6, False), (2.05, True)):
        # Heading down, so that its trail is not in between.
        there = state(position=10.0, opponents=(distance, 9.0), heading=-1.0)
        image = render.picture(PARAMETERS, there)
        between = 2.0 - render.DISC + 0.12
        color = pixel(image, 10.0, between)
        assert is_near(color, render.OPPONENT, 70) == touching


@pytest.mark.parametrize("count", [1, 3, 6, 12])
@pytest.mark.parametrize("arguments", [{}, {"path_length": 4.0}, {"main_path_length": 200.0}])
def test_any_proportions_fit(count: int, arguments: dict) -> None:
    env = EvasionEnv(n_opponents=count, render_mode="rgb_array", **arguments)
    env.reset(seed=0)
    image = env.render()
    paper = np.array(PAPER)
    border = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert (border == paper).all()
    assert (image != paper).any()


def test_between_two_steps() -> None:
    env = EvasionEnv(render_mode="rgb_array")
    env.reset(seed=1)
    start = env.render()
    assert (env.render_between(0.5) == start).all()  # nothing has moved yet
    env.step(1)
    assert (env.render_between(0.0) == start).all()
    assert (env.render_between(1.0) == env.render()).all()
    halfway = env.render_between(0.5)
    assert (halfway != start).any()
    assert (halfway != env.render()).any()


def test_window_without_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    env = gymnasium.make("eutree/Evasion2-v0", render_mode="human", time_step=0.05)
    env.reset(seed=0)
    for _ in range(3):
        env.step(1)
    assert env.render() is None
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2)
    inner = env.unwrapped
    assert (shown == render.picture(inner.parameters, inner.state)).all()
    env.close()
    assert not pygame.display.get_init()
    env.close()


def test_missing_pygame_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'eutree\[record\]'"):
        EvasionEnv(render_mode="rgb_array")
    EvasionEnv()


def test_rendering_without_a_mode_says_how() -> None:
    env = EvasionEnv()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert env.render() is None
