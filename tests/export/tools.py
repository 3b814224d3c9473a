"""Compilers and other programs that tests need: absent, they skip with a reason or fail."""

import os
import shutil

import pytest


def need(program: str) -> str:
    """Return the path of a program, or skip the test; fail if the tools are required."""
    path = shutil.which(program)
    if path is None:
        if os.environ.get("EUTREE_REQUIRE_TOOLS") == "1":
            pytest.fail(f"{program} is required (EUTREE_REQUIRE_TOOLS=1) and not installed")
        pytest.skip(f"{program} is not installed")
    return path
