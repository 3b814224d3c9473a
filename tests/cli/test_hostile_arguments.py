"""Arguments that ended in "internal error", in silence or in a request for terabytes of memory."""

import sys
from pathlib import Path

import gymnasium
import pytest
from gymnasium.spaces import Box, Discrete

from eutree.schema import MAX_ACTIONS
from tests.interaction.sick import Healthy

POLICY = Path(__file__).parents[1] / "golden" / "v2" / "policy.json"
DIGITS = "1" * 5000
EDIT, LEARN = ("edit", POLICY, "--out", "x"), ("learn", "--out", "x", "eutree/Evasion2-v0")
MODULES = {
    "syntax_error": "def (",
    "raises_at_import": "1 / 0",
    "exits_at_import": "import sys; sys.exit(0)",
    "without_environment": "class Env: pass",
}


class CannotBeMade(Healthy):
    def __init__(self, *, exits=False):
        if exits:
            sys.exit(0)
        raise LookupError("no simulator here")


class ManyActions(Healthy):
    action_space = Discrete(10**6)


class ManyNumbers(Healthy):
    observation_space = Box(0.0, 1.0, (20_000,))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name, text in MODULES.items():
        (tmp_path / f"{name}.py").write_text(text)
    for kind in (CannotBeMade, ManyActions, ManyNumbers):
        gymnasium.register(f"{kind.__name__}-v0", kind)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    for kind in (CannotBeMade, ManyActions, ManyNumbers):
        gymnasium.registry.pop(f"{kind.__name__}-v0")
    for name in MODULES:
        sys.modules.pop(name, None)


HOSTILE = [
    ((*EDIT, "--set-threshold", f"{DIGITS}=1"), "--set-threshold must be NUMBER=VALUE, got '111"),
    ((*EDIT, "--set-threshold", f"0={DIGITS}"), "must be a number in [0, inf), got inf"),
    ((*EDIT, "--set-action", f"{DIGITS}=go"), "--set-action must be NUMBER=VALUE, got '111"),
    ((*EDIT, "--set-action", f"0={DIGITS}"), "unknown action '111"),
    (("record", "eutree/Evasion2-v0", "--web", "--out", "x", "--keys", f"left={DIGITS}"),
     "unknown action '111"),
    ((*LEARN, "--env-arg", f"noise={'[' * 100_000}"), "noise is nested too deeply"),
    ((*LEARN, "--env-arg", f"noise={'[' * 99}{']' * 99}"), "must be nested at most 40 deep"),
    ((*LEARN, "--env-arg", "noise=1e400"), "noise must be made of finite numbers"),
    ((*LEARN, "--import", ""), "must be the name of a module, as in Python, got ''"),
    ((*LEARN, "--import", ".."), "must be the name of a module, as in Python, got '..'"),
    ((*LEARN, "--import", "syntax_error"), "it raised SyntaxError"),
    ((*LEARN, "--import", "raises_at_import"), "it raised ZeroDivisionError: division by zero"),
    ((*LEARN, "--import", "exits_at_import"), "it raised SystemExit: 0"),
    (("learn", "--out", "x", "syntax_error:X-v0"), "cannot make syntax_error:X-v0: SyntaxError"),
    (("learn", "--out", "x", "exits_at_import:X-v0"), "X-v0: SystemExit: 0"),
    (("learn", "--out", "x", "without_environment:Env"), "Environment `Env` doesn't exist"),
    (("learn", "--out", "x", "..:Env"), "must be named ID or MODULE:ID"),
    (("learn", "--out", "x", "GymV26Environment-v0"), "cannot make GymV26Environment-v0: "),
    (("learn", "--out", "x", "phys2d/CartPole-v1", "--env-arg", "no_such=1"),
     "cannot make phys2d/CartPole-v1"),
    (("learn", "--out", "x", "CannotBeMade-v0"), "LookupError: no simulator here"),
    (("learn", "--out", "x", "CannotBeMade-v0", "--env-arg", "exits=true"), "SystemExit: 0"),
    (("learn", "--out", "x", "ManyActions-v0"), f"at most {MAX_ACTIONS:,} actions, got 1,000,000"),
    (("learn", "--out", "x", "ManyNumbers-v0"), "from 1 to 10,000 numbers, got 20,000"),
    ((*LEARN, "--history", str(10**30)), "is not in the range"),
    ((*LEARN, "--history", str(10**6)), "history must be from 0 to 3332"),
    ((*LEARN, "--seed", str(10**30)), "is not in the range"),
    ((*LEARN, "--episodes", DIGITS), "is not a valid integer"),
]  # fmt: skip


@pytest.mark.promise(22)
@pytest.mark.parametrize(("line", "message"), HOSTILE, ids=[message for _, message in HOSTILE])
def test_a_hostile_argument_gives_one_line(line, message, eutree, folder):
    answer = eutree(*line)
    assert (answer.code, answer.out) == (2, "")
    assert message in answer.err
    assert answer.err.startswith("error: ")
    assert answer.err.count("\n") == 1
    assert len(answer.err) < 2100
    assert not (folder / "x").exists()
