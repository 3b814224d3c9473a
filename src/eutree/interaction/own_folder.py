"""An environment that changes the working folder does so for itself: relative paths stay ours."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary

import gymnasium

_FOLDERS: "WeakKeyDictionary[gymnasium.Env[Any, Any], str]" = WeakKeyDictionary()


@contextmanager
def made_here() -> Iterator[list[gymnasium.Env[Any, Any]]]:
    """Come back to the working folder; the environments put into the list stay where they went."""
    made: list[gymnasium.Env[Any, Any]] = []
    ours = folder()
    try:
        yield made
    finally:
        there = folder()
        if there != ours:
            os.chdir(ours)
            _FOLDERS.update({env.unwrapped: there for env in made})


class OwnFolder:
    """The working folder of one environment, which is that of the process until it is changed.

    Args:
        env: The environment.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        self._theirs = _FOLDERS.get(env.unwrapped, "")
        self._ours = ""

    def __enter__(self) -> None:
        self._ours = folder()
        if self._theirs:
            os.chdir(self._theirs)

    def __exit__(self, *exception: object) -> None:
        there = folder()
        self._theirs = "" if there == self._ours else there
        if self._theirs and self._ours:
            os.chdir(self._ours)


def folder() -> str:
    """Return the working folder; "" where it was deleted."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return ""
