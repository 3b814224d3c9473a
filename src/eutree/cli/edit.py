"""``eutree edit``: change thresholds and actions by hand, and lock what must stay."""

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli._commands import Helped
from eutree.cli._options import (
    count_option,
    env_arg_option,
    json_option,
    output_option,
    override,
    path_option,
    seed_option,
)
from eutree.cli._output import Output
from eutree.cli._policies import in_zoo, load_policy, policy_file, renamed
from eutree.errors import InvalidArgumentError, shown
from eutree.trees.text import labelled

if TYPE_CHECKING:
    from eutree.policies import TreePolicy

_NUMBER = re.compile(r"[0-9]{1,9}")  # of a node or a leaf


@click.command(
    cls=Helped,
    epilog="Example: eutree edit expert.json --set-threshold 0=18.5 --lock 1 --out new.json",
)
@click.argument("policy", type=click.Path(path_type=Path))
@click.option("--set-threshold", "thresholds", multiple=True, metavar="NODE=VALUE",
              help="New threshold of a test. May be repeated.")  # fmt: skip
@click.option("--set-action", "actions", multiple=True, metavar="LEAF=NAME",
              help="New action of a leaf. May be repeated.")  # fmt: skip
@click.option("--lock", multiple=True, type=int, metavar="NODE",
              help="Node below which learning and edits change nothing; repeatable.")  # fmt: skip
@click.option("--unlock", multiple=True, type=int, metavar="NODE",
              help="Node below which nothing stays locked; repeatable.")  # fmt: skip
@click.option("--enforce", "rules", multiple=True, metavar="PROPERTY",
              help="Make true, and lock: 'always ACTION when CONDITIONS'; repeatable.")  # fmt: skip
@path_option("--rename", text="File of names for features and actions, as for --names.")
@click.option("--reseal", is_flag=True,
              help="Accept a file that was changed by hand; without --out it is written "
              "again where it is.")  # fmt: skip
@output_option("--out", text="File to write; without it the tree is shown with its numbers.")
@count_option(
    "--episodes",
    100,
    "Episodes of the evaluation before and after, where the policy's file "
    "names its environment; 0 for none.",
    least=0,
)
@env_arg_option
@seed_option
@json_option
def edit(
    policy: Path,
    thresholds: tuple[str, ...],
    actions: tuple[str, ...],
    lock: tuple[int, ...],
    unlock: tuple[int, ...],
    rules: tuple[str, ...],
    rename: Path | None,
    reseal: bool,
    out: Path | None,
    episodes: int,
    env_arguments: dict[str, Any],
    seed: int,
    as_json: bool,
) -> None:
    """Change POLICY, a policy file, by hand; say what that does to its return."""
    from eutree.evaluation import evaluate
    from eutree.files import check_writable
    from eutree.inspection import edit as change
    from eutree.inspection import enforce, numbered
    from eutree.interaction.names import Names

    output, before = Output(as_json=as_json), load_policy(policy, hand_edited=reseal)
    if reseal and out is None:
        if in_zoo(policy):
            raise InvalidArgumentError("--out must name the file to write: the zoo's are kept")
        out = policy_file(policy)
    edited = change(
        before,
        thresholds={node: _number(value) for node, value in _pairs("threshold", thresholds)},
        actions=dict(_pairs("action", actions)),
        lock=lock,
        unlock=unlock,
    )
    if rename is not None:
        named = renamed(edited.policy, Names.load(rename))
        edited = replace(edited, policy=named, changes=(*edited.changes, _names_of(named)))
    if rules:
        ruled = enforce(edited.policy, rules)
        edited = replace(ruled, changes=edited.changes + ruled.changes, warnings=edited.warnings)
    if edited.changes and out is None:
        raise InvalidArgumentError("--out must name the file to write, got none")
    if out is not None:
        check_writable(out)
    returns: list[float] = []
    if edited.changes and before.environment is not None and episodes:
        spec = override(before.environment, env_arguments)
        returns = [
            evaluate(each, spec, episodes=episodes, seed=seed).mean_return
            for each in (before, edited.policy)
        ]
    if out is not None:
        edited.policy.save(out)
    lines = [numbered(edited.policy), *edited.changes, *(f"warning: {w}" for w in edited.warnings)]
    if returns:
        lines.append(
            f"mean return {returns[0]:.2f} before, {returns[1]:.2f} after, on the same "
            f"{episodes} episodes"
        )
    output.result(
        {
            "changes": edited.changes,
            "warnings": edited.warnings,
            "mean_return_before": returns[0] if returns else None,
            "mean_return_after": returns[1] if returns else None,
            "locked": edited.policy.locked,
            "path": None if out is None else str(out),
        },
        "\n".join(lines),
    )


def _names_of(policy: "TreePolicy") -> str:
    """Return the names of the features of an observation and of the actions."""
    features = policy.schema.features[: policy.observation_size]
    return f"named: {', '.join(map(labelled, features))}; {', '.join(policy.schema.actions)}"


def _pairs(what: str, texts: tuple[str, ...]) -> list[tuple[int, str]]:
    pairs = []
    for text in texts:
        number, equals, value = text.partition("=")
        if not equals or not _NUMBER.fullmatch(number.strip()):
            raise InvalidArgumentError(f"--set-{what} must be NUMBER=VALUE, got {shown(text)}")
        pairs.append((int(number), value))
    return pairs


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InvalidArgumentError(f"--set-threshold needs a number, got {shown(text)}") from None
