"""What a file may choose of the environment that it names."""

import gymnasium
import pytest

from eutree.errors import FormatError, InvalidArgumentError
from eutree.files.schema_document import EnvironmentDocument, environment_from_document
from eutree.interaction.making import make
from tests.interaction.sick import Healthy

CALLED = []


class Imports(Healthy):
    """An environment such as Gymnasium's own for others: it imports what its argument names."""

    def __init__(self, env_id="", size=1, map_name="data/small.txt", **more):
        CALLED.append((env_id, size, map_name, more))


@pytest.fixture
def registered():
    gymnasium.register("Imports-v0", Imports)
    CALLED.clear()
    yield
    gymnasium.registry.pop("Imports-v0")


def from_file(arguments, name="Imports-v0"):
    return environment_from_document(EnvironmentDocument(name, arguments), "policy.json")


@pytest.mark.promise(1)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"env_id": "os:Env-v0"}, "'env_id' of Imports-v0, which could name a file or a module"),
        ({"env_id": ["../secret"]}, "could name a file or a module"),
        ({"map_name": {"data/large.txt": 1}}, "could name a file or a module"),
        (
            {"code": 1},
            "'code' of Imports-v0, which is none of its own: "
            "action_grid, decode, disable_env_checker, env_id",
        ),
        ({"entry_point": "x"}, "none of its own"),
    ],
)
def test_a_file_chooses_no_arguments_that_could_do_harm(registered, arguments, message):
    spec = from_file(arguments)
    with pytest.raises(InvalidArgumentError, match=f"no file may choose .*{message}"):
        make(spec)
    assert not CALLED
    make(spec.override(arguments))  # as a user's own choice
    assert len(CALLED) == 1


def test_what_an_environment_says_of_itself_may_be_chosen(registered):
    harmless = {"env_id": "north", "size": 3, "map_name": "data/small.txt", "max_episode_steps": 7}
    assert make(from_file(harmless)).spec.max_episode_steps == 7
    speed = from_file({"opponent_speed": 2.5, "crossings": [9.0, 21.0]}, "eutree/Evasion2-v0")
    assert make(speed).unwrapped.parameters.opponent_speed == 2.5
    assert make(from_file({"map_name": "8x8"}, "FrozenLake-v1")).observation_space.n == 64


@pytest.mark.promise(1)
def test_no_file_opens_a_window():
    with pytest.raises(FormatError, match="must not choose a render_mode"):
        from_file({"render_mode": "human"})


def test_an_environment_that_is_made_is_no_spec():
    with pytest.raises(InvalidArgumentError, match="spec must be a EnvironmentSpec, got <"):
        make(gymnasium.make("CartPole-v1"))
