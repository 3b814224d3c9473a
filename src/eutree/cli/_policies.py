"""The policy that a command is about: a file, or the run folder that holds one."""

from pathlib import Path
from typing import TYPE_CHECKING

from eutree.errors import InvalidArgumentError

if TYPE_CHECKING:
    from eutree.policies import TreePolicy


def load_policy(path: Path, *, hand_edited: bool = False) -> "TreePolicy":
    """Return the policy in a file, or the one that a run folder ended with.

    With ``hand_edited`` the file may have been changed after it was written.
    """
    from eutree.policies import TreePolicy

    return TreePolicy.load(policy_file(path), hand_edited=hand_edited)


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
