"""Who acts, by name: a scripted expert, a policy file, or a controller of the user's own."""

import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click

from eutree.cli._options import look_in_this_folder
from eutree.cli._policies import load_policy
from eutree.errors import InvalidArgumentError, UnknownNameError, described
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from eutree.evaluation import Against, Evaluation
    from eutree.interaction.acting import Controller
    from eutree.policies import TreePolicy

_Command = TypeVar("_Command", bound=Callable[..., Any])

OWN = "MODULE:NAME or FILE.py:NAME"
_HINT = f"One of your own is named {OWN}: a policy, its class, or a function."


def controller(name: str, option: str, spec: EnvironmentSpec) -> "Controller":
    """Return who is named to act in an environment.

    Args:
        name: A scripted expert of the environment, a policy file or run folder, or ``MODULE:NAME``
            or ``FILE.py:NAME``: anything with SB3's ``predict``, its class, a function that makes
            such a thing for an environment, or one from an observation to an action.
        option: The option that named it, for messages.
        spec: The environment.

    Raises:
        UnknownNameError: The name means none of these.
        InvalidArgumentError: The module cannot be imported, or the policy is of another task.
    """
    from eutree.cli._policies import check_fits
    from eutree.envs.experts import known_experts

    known = known_experts(spec.id)
    if name in known:
        return known[name]
    if is_own(name):
        return own_controller(name, option)
    path = Path(name)
    if path.suffix == ".py":
        raise InvalidArgumentError(f"{option} {name}: name what decides in it: {name}:NAME")
    if not path.exists():
        raise UnknownNameError(option, name, known, hint=_HINT)
    policy = load_policy(path)
    check_fits(policy, path, spec)
    return policy


def is_own(name: str) -> bool:
    """Return whether a name is that of something in a module, and not of a file."""
    return ":" in name and not Path(name).exists()


def own_controller(name: str, option: str) -> "Controller":
    """Return what ``MODULE:NAME`` or ``FILE.py:NAME`` names.

    Raises:
        InvalidArgumentError: It is not there, or importing it fails.
    """
    module, _, attribute = name.rpartition(":")
    found: Any = _imported(module, f"{option} {name}")
    for part in attribute.split("."):
        if not hasattr(found, part):
            raise InvalidArgumentError(f"{option} {name}: {module} has no {attribute!r}")
        found = getattr(found, part)
    return cast("Controller", found)


def _imported(module: str, what: str) -> object:
    """Import a module that the user has named; its author is told what it does wrong."""
    look_in_this_folder()
    if module.endswith(".py"):
        file = Path(module).resolve()
        if not file.is_file():
            raise InvalidArgumentError(f"{what}: there is no file {module}")
        if str(file.parent) not in sys.path:  # where other processes look for it, too
            sys.path.insert(0, str(file.parent))
        module = file.stem
    if not all(part.isidentifier() for part in module.split(".")):
        raise InvalidArgumentError(f"{what}: must be {OWN}")
    try:
        return importlib.import_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise InvalidArgumentError(
            f"{what}: cannot import {module!r}: {described(error)}"
        ) from error


def against_option(command: _Command) -> _Command:
    """Add ``--against``: who else plays the episodes of the result."""
    text = f"Play the same episodes with another: an expert, a policy file, {OWN}."
    return click.option("--against", metavar="NAME", help=text)(command)


class Rival:
    """Who plays the episodes of a result, too; found before the result is made.

    Args:
        name: As ``--against`` has it.
        spec: Where both play.

    Raises:
        UnknownNameError: The name means nothing that acts; see ``controller``.
    """

    def __init__(self, name: str, spec: EnvironmentSpec) -> None:
        self.name = name
        self._spec = spec
        self._controller = controller(name, "--against", spec)

    def meets(
        self, policy: "TreePolicy", *, episodes: int, seed: int, n_jobs: int | None
    ) -> "Rivalry":
        """Let a policy and the rival play the same episodes."""
        from eutree.evaluation import evaluate

        one = evaluate(policy, self._spec, episodes=episodes, seed=seed, n_jobs=n_jobs)
        return self.follows(one, seed=seed, n_jobs=n_jobs)

    def follows(self, policy: "Evaluation", *, seed: int, n_jobs: int | None) -> "Rivalry":
        """Let the rival play the episodes that a policy has played."""
        from eutree.evaluation import against, evaluate
        from eutree.interaction.making import make
        from eutree.interaction.return_range import return_range

        n = policy.episodes
        other = evaluate(self._controller, self._spec, episodes=n, seed=seed, n_jobs=n_jobs)
        env = make(self._spec)
        known = return_range(env)
        env.close()
        return Rivalry(self.name, policy, against(policy, other, known=known))


@dataclass(frozen=True)
class Rivalry:
    """A policy and a rival in the same episodes, as commands say it."""

    name: str
    policy: "Evaluation"
    found: "Against"

    def facts(self) -> dict[str, Any]:
        """Return it for ``--json``."""
        return {"name": self.name, **self.found.facts()}

    def lines(self) -> str:
        """Return what the rival did and what the policy earned more, a line each."""
        return f"{self.name}: {self.found.other}\n{self.found.describe(self.name)}"

    def all_lines(self) -> str:
        """Return the same after what the policy did."""
        return f"the result: {self.policy}\n{self.lines()}"
