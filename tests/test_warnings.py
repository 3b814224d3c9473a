"""A warning names the line of whoever called, however deep it arises."""

from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import pytest

from eutree.errors import warn


def function_in(module: str, calls: Callable[..., object], *arguments: str) -> Callable[[], None]:
    """Return a function of a module of this name that does nothing but call."""
    scope: dict[str, Any] = {"__name__": module, "calls": calls, "arguments": arguments}
    exec(compile("def function():\n    calls(*arguments)", f"{module}.py", "exec"), scope)
    function: Callable[[], None] = scope["function"]
    return function


def named(function: Callable[[], None]) -> str:
    with pytest.warns(UserWarning, match="so it is") as told:
        function()
    return told[0].filename


def test_it_is_the_first_outside_of_eutree():
    said = function_in("eutree.data.somewhere", warn, "so it is")
    assert named(function_in("eutree.cli.somewhere", said)) == __file__
    assert named(function_in("mine", function_in("eutree", said))) == "mine.py"
    assert named(function_in("eutree_of_mine", said)) == "eutree_of_mine.py"


def test_another_package_that_warns_is_passed_over():
    said = function_in("method.deep", warn, "so it is")
    assert named(function_in("method.front", function_in("eutree.training", said))) == __file__


def test_so_is_what_runs_the_body_of_a_context_manager():
    said = function_in("eutree.data.somewhere", warn, "so it is")

    scope: dict[str, Any] = {"__name__": "eutree.recording"}
    exec("def enters(said):\n    said()\n    yield", scope)

    def opened() -> None:
        with contextmanager(scope["enters"])(said):
            pass

    assert named(opened) == __file__
