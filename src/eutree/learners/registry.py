"""The methods by name, and the presets: methods with all choices made."""

from eutree.learners.learner import Method
from eutree.validation import check_choice

METHODS: dict[str, type[Method]] = {}
PRESETS: dict[str, Method] = {}


def method(name: str) -> Method:
    """Return a method by its name or that of a preset, with all choices made.

    Raises:
        UnknownNameError: There is no such method or preset.
    """
    check_choice("method", name, [*METHODS, *PRESETS])
    return PRESETS[name] if name in PRESETS else METHODS[name]()


def preset(name: str) -> Method:
    """Return the method of a preset."""
    return PRESETS[check_choice("preset", name, PRESETS)]
