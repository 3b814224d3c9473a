"""Files of earlier releases name choices that are no more."""

import pytest

from eutree.errors import InvalidArgumentError
from eutree.learners import METHODS
from eutree.learners.registry import from_document, to_document

DELETED = {name: getattr(kind, "deleted", {}) for name, kind in METHODS.items()}
CHOICES = [(name, choice) for name, deleted in DELETED.items() for choice in deleted]
OTHERS = {
    "planner.world_model": "neural",
    "gate": {"type": "ConservativeImprovement", "threshold": 0.5, "decay": 0.9},
    "trial": True,
}


def with_choice(document, choice, value):
    """Return a copy of a method's document with one more choice, such as "planner.growth"."""
    first, _, rest = choice.partition(".")
    inner = with_choice(document[first], rest, value) if rest else value
    return document | {first: inner}


@pytest.mark.parametrize(("name", "choice"), CHOICES)
def test_a_file_that_names_the_usual_value_loads(name, choice):
    usual = METHODS[name]()
    older = with_choice(to_document(usual), choice, DELETED[name][choice])
    assert from_document(older) == usual
    assert choice.partition(".")[0] in older  # and is left as it was


@pytest.mark.parametrize(("name", "choice"), CHOICES)
def test_a_file_that_names_another_value_is_refused_by_name(name, choice):
    document = with_choice(to_document(METHODS[name]()), choice, OTHERS[choice])
    with pytest.raises(InvalidArgumentError, match=f"has the choice '{choice}' no more, which was"):
        from_document(document)
