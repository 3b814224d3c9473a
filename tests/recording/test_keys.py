"""Names of keys, what they mean, and which keys control a recording."""

import gymnasium
import pytest
from hypothesis import given
from hypothesis import strategies as st

import eutree  # noqa: F401 - registers the environments
from eutree.errors import InvalidArgumentError
from eutree.interaction.guard import GuardedEnv
from eutree.recording.keys import (
    CONTROL_KEYS,
    KeyMap,
    keys_of_environment,
    parse_keys,
    suggested_keys,
)
from eutree.schema import Schema
from tests.recording.people import Corridor

SCHEMA = Schema(Schema.anonymous(1, 1).features, ("left", "stay", "right"))


def own_keys(name: str) -> KeyMap:
    env = gymnasium.make(name)
    return keys_of_environment(env, GuardedEnv(env).schema)


def test_evasion_goes_with_space_or_right_and_stops_without() -> None:
    keys = own_keys("eutree/Evasion2-v0")
    assert (keys.keys, keys.idle, keys.chosen) == (("right", "space"), 0, True)
    assert keys.keys_of(1) == ["right", "space"]
    assert [keys.action(held, 1) for held in ([], ["q"], ["space"], ["space", "right"])] == [
        0, 0, 1, 1,
    ]  # fmt: skip


def test_codes_of_pygame_1_are_understood() -> None:
    keys = own_keys("MountainCar-v0")
    assert (keys.keys, keys.idle) == (("left", "right"), 1)
    assert keys.action(["left", "right"], 0) == 1


def test_suggested_keys_are_arrows_where_they_fit() -> None:
    cart = own_keys("CartPole-v1")
    assert (cart.keys, cart.idle, cart.chosen) == (("left", "right"), None, False)
    assert cart.action([], 1) == 1  # nothing is idle: the last action goes on
    acrobot = own_keys("Acrobot-v1")
    assert (acrobot.keys, acrobot.idle) == (("1", "3"), 1)


def suggested(*actions: str) -> list[list[str]]:
    schema = Schema(Schema.anonymous(1, 1).features, actions)
    keys = suggested_keys(schema)
    return [keys.keys_of(action) for action in range(len(actions))]


def test_an_arrow_is_a_direction_and_no_particle_of_a_verb() -> None:
    taxi = own_keys("Taxi-v4" if "Taxi-v4" in gymnasium.registry else "Taxi-v3")
    assert [taxi.keys_of(action) for action in range(6)] == [
        ["down"], ["up"], ["right"], ["left"], ["space"], ["enter"],
    ]  # fmt: skip
    assert suggested("move-up", "shut down", "Turn Left") == [["up"], ["space"], ["left"]]
    assert suggested("pick_up", "put_down") == [["1"], ["2"]]
    assert suggested("speed up", "give back", "accelerate to the right", "toggle", "drop") == [
        ["space"], ["enter"], ["right"], ["4"], ["5"],
    ]  # fmt: skip
    assert suggested("left", "west") == [["left"], ["2"]]  # no two actions share a key
    lander = [["left"], ["up"], ["right"]]
    assert suggested("nothing", "left engine", "main engine", "right engine")[1:] == lander


@given(
    st.lists(st.text("abcdefgup downleftright_", min_size=1), min_size=1, max_size=20, unique=True)
)
def test_every_suggested_key_means_one_action(names: list[str]) -> None:
    schema = Schema(Schema.anonymous(1, 1).features, tuple(f"{n} {k}" for k, n in enumerate(names)))
    keys = suggested_keys(schema)
    meant = [key for action in range(len(names)) for key in keys.keys_of(action)]
    assert len(meant) == len(set(meant)) == len(names) - (keys.idle is not None)


def test_the_key_pressed_last_counts() -> None:
    keys = parse_keys("left=0,right=2", SCHEMA)
    assert keys.idle == 1
    assert keys.action(["left", "right"], 0) == 2
    assert keys.action(["right", "left"], 0) == 0


def test_written_keys() -> None:
    keys = parse_keys("A=left, space=2, a+space=stay, none=0", SCHEMA)
    assert (keys.keys, keys.idle) == (("a", "space"), 0)
    assert keys.action(["a", "space"], 0) == 1
    assert parse_keys("==1", SCHEMA).keys == ("+",)
    assert parse_keys("+=1,-=0", SCHEMA).keys == ("+", "-")


def test_a_name_may_have_commas_in_it() -> None:
    """A key could not be given to an action of parts."""
    names = ("a 0, b 0", "a 0, b 1", "a 1", "a 1,", "a 0")
    schema = Schema(Schema.anonymous(1, 1).features, names)
    keys = parse_keys("left=a 0, b 0,right=a 0, b 1, up=a 1,down=4,none=a 0, b 0", schema)
    assert [keys.keys_of(action) for action in range(5)] == [
        ["left"], ["right"], ["up"], [], ["down"],
    ]  # fmt: skip
    assert keys.idle == 0
    with pytest.raises(InvalidArgumentError, match="unknown action 'a 2'"):
        parse_keys("left=a 2, b 1", schema)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "KEY=ACTION pairs such as left=0,right=1, got ''"),
        ("left", "got 'left'"),
        ("=1", "got '=1'"),
        ("left=3", "unknown action '3'"),
        ("left=-1", "unknown action '-1'"),
        ("left=lef", "Did you mean 'left'"),
        ("rihgt=1", "unknown key 'rihgt'. Did you mean 'right'"),
        ("none=1", "at least one action a key"),
        ("left=0,left=2", "must give a key one action, got 'left=0,left=2'"),
    ],
)
def test_mistakes_are_named(text: str, message: str) -> None:
    with pytest.raises(InvalidArgumentError) as caught:
        parse_keys(text, SCHEMA)
    assert message in str(caught.value)


def test_a_key_chosen_for_an_action_leaves_no_other() -> None:
    env = Corridor()
    keys = keys_of_environment(env, SCHEMA).with_key("X", 2)
    assert keys.keys_of(2) == ["x"]
    assert keys.action(["right"], 0) == 1
    assert keys.with_key("left", 1).keys_of(0) == []


def test_an_action_that_loses_its_key_has_the_one_that_is_free_now() -> None:
    """The other action could not be taken any more, and no word was said."""
    keys = parse_keys("left=0,right=2,a+left=1", SCHEMA).with_key("right", 0)
    assert [keys.keys_of(action) for action in range(3)] == [["right"], ["a+left"], ["left"]]


@given(
    st.sets(st.sampled_from(sorted({k for ks in CONTROL_KEYS.values() for k in ks})), max_size=6)
)
def test_controls_never_share_a_key(taken: set[str]) -> None:
    keys = KeyMap(tuple((frozenset([key]), 0) for key in sorted(taken or {"q"})))
    controls = keys.controls()
    assert not set(controls.values()) & set(keys.keys)
    assert len(set(controls.values())) == len(controls)


@given(st.lists(st.sampled_from("abc"), unique=True), st.integers(0, 2))
def test_the_action_is_one_of_the_map(held: list[str], last: int) -> None:
    keys = parse_keys("a=0,b=2,a+b=1", SCHEMA)
    assert keys.action(held, last) in (0, 1, 2)
    if {"a", "b"} <= set(held):
        assert keys.action(held, last) == 1
