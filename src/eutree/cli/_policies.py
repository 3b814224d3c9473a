"""The policy that a command is about: a file, or the run folder that holds one."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from eutree.errors import InvalidArgumentError

if TYPE_CHECKING:
    from eutree.data import Demonstrations
    from eutree.interaction.names import Names
    from eutree.policies import TreePolicy
    from eutree.schema import EnvironmentSpec


def load_policy(path: Path, *, hand_edited: bool = False) -> "TreePolicy":
    """Return the policy in a file, or the one that a run folder ended with, with ``--names``.

    With ``hand_edited`` the file may have been changed after it was written.
    """
    from eutree.interaction.names import given_names
    from eutree.policies import TreePolicy

    policy, names = TreePolicy.load(policy_file(path), hand_edited=hand_edited), given_names()
    return policy if names is None else renamed(policy, names)


def load_demonstrations(path: Path, policy: "TreePolicy | None" = None) -> "Demonstrations":
    """Return the demonstrations in a folder, with the features that are derived elsewhere.

    These are what ``--derive`` declares, or else what the policy asks for.
    """
    from eutree.data import Demonstrations, derive
    from eutree.interaction.names import given_names

    demonstrations, names = Demonstrations.load(path), given_names()
    declared = (names and names.derived) or (policy and policy.schema.derived)
    if not declared or demonstrations.schema.derived:
        return demonstrations
    return derive(demonstrations, declared)


def renamed(policy: "TreePolicy", names: "Names") -> "TreePolicy":
    """Return a policy with these names; those of the past follow."""
    from eutree.schema import Schema

    known, size = policy.schema, policy.observation_size
    schema = names.of(Schema(known.features[:size], known.actions, known.controls))
    return replace(policy, schema=schema.with_history(policy.history, policy.past_actions))


def policy_file(path: Path) -> Path:
    """Return the policy's file: ``path`` itself, or ``policy.json`` in a run folder."""
    if not path.is_dir():
        return path
    file = path / "policy.json"
    if not file.exists() or (path / "demonstrations.json").exists():
        raise InvalidArgumentError(
            f"{path} must be a policy file, or a run folder with a policy.json, which a run "
            "writes at its end"
        )
    return file


def check_fits(policy: "TreePolicy", path: Path, spec: "EnvironmentSpec") -> None:
    """Raise InvalidArgumentError unless the policy's features are those of the environment."""
    from eutree.interaction import describe
    from eutree.interaction.deriving import acting_as
    from eutree.interaction.making import make

    schema = describe(acting_as(make(spec), policy))
    wanted = schema.with_history(policy.history, policy.past_actions)
    wanted.check_same(policy.schema, str(path), of=str(spec))
