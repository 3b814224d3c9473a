"""Recording what a policy sees: pictures where they can be had, one clear line where not."""

from dataclasses import replace
from io import BytesIO
from typing import Any

import gymnasium
import numpy as np
import pytest

from eutree.envs.experts import wait_at_crossing
from eutree.errors import EnvironmentFault, EutreeError, InvalidArgumentError, UnknownNameError
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.episode import Stream
from eutree.recording import record
from eutree.report import watch
from eutree.report.watching import (
    encode,
    film,
    film_if_possible,
    watch_if_possible,
)
from eutree.schema import EnvironmentSpec, Schema
from tests.export.policies import EVASION, policy_of, tree

EVASION_2 = EnvironmentSpec("eutree/Evasion2-v0")


def test_watching_does_not_change_the_episode() -> None:
    pytest.importorskip("pygame")
    image = pytest.importorskip("PIL.Image")
    policy = policy_of(tree(9, 3), EVASION)
    (watched,) = watch(policy, episodes=1, seed=3)
    guarded = GuardedEnv(gymnasium.make("eutree/Evasion2-v0"))
    plain = run_episode(guarded, policy, episode_seed(3, 0, Stream.WATCHING))
    np.testing.assert_array_equal(watched.episode.observations, plain.observations)
    np.testing.assert_array_equal(watched.episode.actions, plain.actions)
    assert len(watched.frames) == len(plain.observations)
    assert image.open(BytesIO(watched.frames[0])).size == (480, 320)


def test_pictures_are_encoded_by_threads_in_their_order() -> None:
    pytest.importorskip("pygame")
    pytest.importorskip("PIL")
    policy, told = policy_of(tree(9, 3), EVASION), list[int]()
    (watched, _) = watch(policy, episodes=2, seed=3, on_episode=told.append)
    guarded = GuardedEnv(gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array"))
    guarded.reset(watched.episode.seed)
    taken = [encode(guarded.picture())]
    for action in watched.episode.actions.tolist():
        guarded.step(action)
        taken.append(encode(guarded.picture()))
    assert list(watched.frames) == taken
    assert len(set(taken)) > len(taken) / 2
    assert told == [1, 2]


def test_a_recorded_episode_is_filmed_as_it_was() -> None:
    pytest.importorskip("pygame")
    pytest.importorskip("PIL")
    env = gymnasium.make("eutree/Evasion2-v0")
    (shown,) = record(env, wait_at_crossing, episodes=1, seed=4).episodes
    watched = film(EVASION_2, shown)
    assert len(watched.frames) == len(shown.observations)
    assert len(set(watched.frames)) > len(watched.frames) / 2
    faster = EnvironmentSpec("eutree/Evasion2-v0", {"opponent_speed": 4.2})
    with pytest.raises(InvalidArgumentError, match="must go as recorded"):
        film(faster, shown)
    without = film_if_possible(faster, shown, by="me")
    assert (without.episode, without.frames, without.by) == (shown, (), "me")


def test_without_pictures() -> None:
    policy = policy_of(tree(9, 3), EVASION)
    watched = watch(policy, episodes=2, seed=3, pictures=False)
    assert [entry.frames for entry in watched] == [(), ()]


def test_pictures_stop_at_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    monkeypatch.setattr("eutree.report.watching.PICTURE_LIMIT", 1)
    first, second = watch(policy_of(tree(9, 3), EVASION), episodes=2, seed=3)
    assert len(first.frames) == len(first.episode.observations)
    assert second.frames == ()


def test_wrong_environments_are_refused() -> None:
    policy = policy_of(tree(9, 3), EVASION)
    with pytest.raises(InvalidArgumentError, match="the policy names none"):
        watch(replace(policy, environment=None))
    with pytest.raises(UnknownNameError, match="unknown environment 'eutree/Evasion9-v0'"):
        watch(policy, EnvironmentSpec("eutree/Evasion9-v0"))
    with pytest.raises(InvalidArgumentError, match="environment with 2 features"):
        watch(policy_of(tree(3, 2), Schema.anonymous(2, 2)), EVASION_2, pictures=False)


def test_pictures_must_be_pictures() -> None:
    env = GuardedEnv(gymnasium.make("eutree/Evasion2-v0"))
    for picture in (None, np.zeros((4, 4)), np.zeros((4, 4, 3))):
        with pytest.raises(EnvironmentFault, match="must return an image"):
            env.picture(lambda picture=picture: picture)


class Blind(gymnasium.Env[Any, Any]):
    """An environment that cannot draw itself."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 - as Gymnasium declares it
    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, render_mode: str | None = None) -> None:
        self.render_mode = render_mode

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return np.zeros(1, dtype=np.float32), 0.0, True, False, {}

    def render(self) -> Any:
        raise OSError("no display")


@pytest.fixture
def blind() -> Any:
    gymnasium.register("Blind-v0", entry_point=Blind)
    yield EnvironmentSpec("Blind-v0")
    del gymnasium.registry["Blind-v0"]


def test_an_environment_that_never_draws_is_not_asked_to(
    blind: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gymnasium would warn, in colours, and its constructor might not take a render mode."""
    monkeypatch.setattr(Blind, "metadata", {"render_modes": []})
    policy = policy_of(tree(2, 1), Schema.anonymous(1, 2))
    watched, problem = watch_if_possible(policy, blind, episodes=1, seed=0)
    assert len(watched) == 1
    words = "Blind-v0 draws none: its metadata['render_modes'] must name rgb_array"
    assert problem == f"no pictures: {words}"


def test_an_environment_that_cannot_draw_is_watched_without_pictures(blind: Any) -> None:
    policy = policy_of(tree(2, 1), Schema.anonymous(1, 2))
    with pytest.raises(EutreeError, match="render raised OSError"):
        watch(policy, blind, episodes=1)
    watched, problem = watch_if_possible(policy, blind, episodes=2, seed=0)
    assert len(watched) == 2
    assert watched[0].frames == ()
    assert problem.startswith("no pictures: Blind-v0")
    assert "render raised" in problem


class Undrawn(gymnasium.Env[Any, Any]):
    """Draws what it does while it does it, for which a part is missing."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}  # noqa: RUF012
    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)
    moment = ""

    def __init__(self, render_mode: str | None = None) -> None:
        self.render_mode = render_mode

    def draw(self, moment: str) -> None:
        if self.render_mode and moment == self.moment:
            raise SystemExit("no graphics card")

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.draw("reset")
        return np.zeros(1), {}

    def step(self, action: Any) -> Any:
        self.draw("step")
        return np.ones(1), 1.0, True, False, {}

    def render(self) -> Any:
        self.draw("render")
        return np.zeros((8, 8, 3), np.uint8)


@pytest.mark.parametrize("moment", ["reset", "step", "render"])
def test_a_page_without_pictures_where_drawing_fails(moment: str) -> None:
    gymnasium.register("Undrawn-v0", type("Undrawn", (Undrawn,), {"moment": moment}))
    policy = policy_of(tree(2, 1), Schema.anonymous(1, 2))
    try:
        watched, problem = watch_if_possible(
            policy, EnvironmentSpec("Undrawn-v0"), episodes=2, seed=0
        )
    finally:
        del gymnasium.registry["Undrawn-v0"]
    assert [len(one.episode) for one in watched] == [1, 1]
    assert [one.frames for one in watched] == [(), ()]
    assert problem.startswith("no pictures: Undrawn-v0")
    assert "SystemExit: no graphics card" in problem
