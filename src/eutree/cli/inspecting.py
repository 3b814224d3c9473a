"""The commands that inspect a policy: ``eutree why``, ``diff``, ``verify`` and ``edit``."""

import re
from contextlib import closing, suppress
from dataclasses import replace
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import click
import numpy as np

from eutree.cli import _options as option
from eutree.cli._output import Result, figures_of, said_what_is_played, say
from eutree.cli._policies import (
    in_zoo,
    load_demonstrations,
    load_policy,
    policy_file,
    renamed,
    seen_in,
    seen_in_run,
)
from eutree.display import fixed
from eutree.errors import InvalidArgumentError, UnknownNameError, shown
from eutree.evaluation import evaluate
from eutree.files import check_writable
from eutree.inspection import diff as compare
from eutree.inspection import edit as change
from eutree.inspection import enforce, numbered
from eutree.inspection import verify as verify_policy
from eutree.inspection import why as explain
from eutree.interaction.making import make
from eutree.interaction.names import Names
from eutree.schema import Feature
from eutree.trees.text import labelled

EXIT_REFUTED = 1
_NUMBER = re.compile(r"[0-9]{1,9}")  # of a node or a leaf


@option.command("eutree why expert.json --observation 8,3.2,-1 --demos demos/", helped=False)
@click.argument("policy", type=click.Path(path_type=Path))
@click.option("--observation", required=True, metavar="X,Y,...",
              help="The observation: a number, or a category, for each feature.")  # fmt: skip
@option.path("--demos", text="Demonstrations whose steps in the same leaf to name.")
def why(policy: Path, observation: str, demos: Path | None) -> Result:
    """Say why POLICY decides as it does for an observation, and which change would alter it."""
    loaded = load_policy(policy)
    # ``explain`` counts them: what is too much has to be a number here, and no more.
    features = chain(loaded.schema.features, repeat(Feature("no feature")))
    numbers = [_number(*pair) for pair in zip(observation.split(","), features, strict=False)]
    shown = None if demos is None else load_demonstrations(demos, loaded)
    found = explain(loaded, numbers, demonstrations=shown)
    names = loaded.schema.actions
    return Result(
        {
            "action": names[found.action],
            "leaf": found.leaf,
            "region": found.region,
            "path": [
                figures_of(step, "node threshold value is_true distance")
                | {"feature": loaded.schema.features[step.feature].name}
                for step in found.path
            ],
            "alternatives": [
                figures_of(other, "observation distance leaf words occurs")
                | {"action": names[other.action]}
                for other in found.alternatives
            ],
            "visits": found.visits,
            "values": found.values,
            "demonstrations": None
            if found.support is None
            else [
                figures_of(entry, "episode step") | {"action": names[entry.action]}
                for entry in found.support
            ],
        },
        found.text,
    )


def _number(text: str, feature: Feature) -> float:
    """Return the number that is written, or that of the category with this name."""
    names = feature.categories
    if text.strip() in names:  # also of numbers, as properties have it
        return feature.low + names.index(text.strip())
    with suppress(ValueError):
        return float(text)
    wanted = f"a number or one of {', '.join(names)}" if names else "a number"
    raise InvalidArgumentError(f"--observation must have {wanted} for {feature.name}, got {text!r}")


@option.command("eutree diff runs/a/expert.json runs/a/policy.json", helped=False)
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@option.path("--demos", text="Demonstrations: how many of their steps each change concerns.")
def diff(first: Path, second: Path, demos: Path | None) -> Result:
    """Say where FIRST and SECOND, two policy files, decide differently, and how they are built."""
    one, two = load_policy(first), load_policy(second)
    found = compare(one, two, observations=None if demos is None else seen_in(demos, one))
    names = one.schema.actions
    return Result(
        {
            **figures_of(found, "share visited structure n_leaves"),
            "boxes": [
                figures_of(box, "share words visited")
                | figures_of(box.region, "low high")
                | {"first": names[box.first], "second": names[box.second]}
                for box in found.boxes
            ],
        },
        str(found),
    )


@option.command("eutree verify expert.json --property 'always go when position > 25'", helped=False)
@click.argument("policy", type=click.Path(path_type=Path))
@click.option("--property", "questions", required=True, multiple=True,
              help="What to prove, for example 'always stop when -2 <= opponent_1 <= 2', "
              "'monotone go in position' or 'no dead leaves'. May be repeated.")  # fmt: skip
@option.path("--demos", text="Demonstrations, for dead leaves.")
@option.path("--run", "run_folder", text="Run folder whose observations count, for dead leaves.")
@click.option("--everywhere", is_flag=True,
              help="Ask for all numbers, whatever bounds and kinds features have.")  # fmt: skip
def verify(
    policy: Path,
    questions: tuple[str, ...],
    demos: Path | None,
    run_folder: Path | None,
    everywhere: bool,
) -> Result:
    """Prove properties of POLICY, a policy file, or refute them with an observation.

    The exit code is 0 if all are proven, 1 if one is refuted.
    """
    loaded = load_policy(policy)
    parts = [] if demos is None else [seen_in(demos, loaded)]
    if run_folder is not None:
        parts.append(seen_in_run(run_folder, loaded))
    rows = np.concatenate(parts) if parts else None
    answers = [
        verify_policy(loaded, question, observations=rows, everywhere=everywhere)
        for question in questions
    ]
    holds = all(answer.holds for answer in answers)
    return Result(
        {
            "holds": holds,
            "answers": [
                figures_of(answer, "property holds share note")
                | {
                    "counter_examples": [
                        figures_of(example, "words leaf point raised share occurs")
                        | figures_of(example.region, "low high")
                        | {"action": loaded.schema.actions[example.action]}
                        for example in answer.counter_examples
                    ]
                }
                for answer in answers
            ],
        },
        "\n".join(map(str, answers)),
        0 if holds else EXIT_REFUTED,
    )


@option.command("eutree edit expert.json --set-threshold 0=18.5 --lock 1 --out new.json")
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
@option.path("--rename", text="File of names for features and actions, as for --names.")
@click.option("--reseal", is_flag=True,
              help="Accept a file that was changed by hand; without --out it is written "
              "again where it is.")  # fmt: skip
@option.output("--out", text="File to write; without it the tree is shown with its numbers.")
@option.count("--episodes", 100, "Episodes of the evaluation before and after, where the policy's "
              "file names its environment; 0 for none.", least=0)  # fmt: skip
@option.environment
@option.seed
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
) -> Result:
    """Change POLICY, a policy file, by hand; say how that changes its return."""
    before = load_policy(policy, hand_edited=reseal)
    if reseal and out is None:
        if in_zoo(policy):
            raise InvalidArgumentError("--out must name the file to write: the zoo's are kept")
        out = policy_file(policy)
    edited = change(
        before,
        thresholds={
            node: option.number(value, "--set-threshold needs a number")
            for node, value in _pairs("threshold", thresholds)
        },
        actions=dict(_pairs("action", actions)),
        lock=lock,
        unlock=unlock,
    )
    if rename is not None:
        names = Names.load(rename)
        if names.derived:
            raise InvalidArgumentError(
                f"--rename must name features and actions alone, got derived {list(names.derived)}"
            )
        named = renamed(edited.policy, names)
        features = map(labelled, named.schema.features[: named.observation_size])
        words = f"named: {', '.join(features)}; {', '.join(named.schema.actions)}"
        edited = replace(edited, policy=named, changes=(*edited.changes, words))
    if rules:
        ruled = enforce(edited.policy, rules)
        anew = ["with the rules nodes and leaves have other numbers"] * bool(edited.changes)
        changes = (*edited.changes, *anew, *ruled.changes)
        edited = replace(ruled, changes=changes)  # it names all leaves that nothing reaches
    if edited.changes and out is None:
        raise InvalidArgumentError("--out must name the file to write, got none")
    if out is not None:
        check_writable(out)
    returns: list[float] = []
    if edited.changes and before.environment is not None and episodes:
        try:
            spec = before.environment.override(env_arguments)
            with closing(make(spec)) as env, said_what_is_played(2 * episodes):
                returns = [
                    evaluate(each, env, episodes=episodes, seed=seed).mean_return
                    for each in (before, replace(edited.policy, schema=before.schema))
                ]
        except UnknownNameError as error:
            say(f"changed, but not played: {error}")
    if out is not None:
        edited.policy.save(out)
    lines = [numbered(edited.policy), *edited.changes, *(f"warning: {w}" for w in edited.warnings)]
    if returns:
        digits = fixed(2, returns)
        both = f"mean return {returns[0]:{digits}} before, {returns[1]:{digits}} after"
        lines.append(f"{both}, on the same {episodes} episodes")
    return Result(
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


def _pairs(what: str, texts: tuple[str, ...]) -> list[tuple[int, str]]:
    pairs: list[tuple[int, str]] = []
    for text in texts:
        number, equals, value = text.partition("=")
        if not equals or not _NUMBER.fullmatch(number.strip()):
            raise InvalidArgumentError(f"--set-{what} must be NUMBER=VALUE, got {shown(text)}")
        if int(number) in dict(pairs):
            raise InvalidArgumentError(f"--set-{what} must name {number.strip()} once, got {texts}")
        pairs.append((int(number), value))
    return pairs
