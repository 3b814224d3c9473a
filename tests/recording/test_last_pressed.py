"""While a tree drives, of the keys that are held the one pressed last counts."""

import pytest

from tests.recording.people import Corridor, Person
from tests.recording.test_driving import RIGHT, STAY, always, correcting


@pytest.fixture
def person():
    return Person(Corridor(length=1000, limit=100_000))


def test_the_key_of_no_key_counts_where_it_was_pressed_last(person) -> None:
    """Pressing stop during a held go had no effect."""
    correcting(person, always(0))

    def acts():
        return person.wait(0.25).view.driving.by_hand, person.view.action

    assert acts() == (False, 0)
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
    assert acts() == (False, 0)
