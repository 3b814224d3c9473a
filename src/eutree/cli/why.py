"""``eutree why`` and ``eutree diff``: why a policy decides so, and where two differ."""

from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from eutree.cli._options import json_option, path_option
from eutree.cli._output import Output
from eutree.cli._policies import load_demonstrations, load_policy
from eutree.errors import InvalidArgumentError

if TYPE_CHECKING:
    from eutree.arrays import Floats
    from eutree.data import Demonstrations
    from eutree.policies import TreePolicy


@click.command(epilog="Example: eutree why expert.json --observation 8,3.2,-1 --demos demos/")
@click.argument("policy", type=click.Path(path_type=Path))
@click.option("--observation", required=True, metavar="X,Y,...",
              help="The observation, a number for each feature.")  # fmt: skip
@path_option("--demos", text="Demonstrations whose steps in the same leaf to name.")
@json_option
def why(policy: Path, observation: str, demos: Path | None, as_json: bool) -> None:
    """Say why POLICY decides as it does for an observation, and what would change it."""
    from eutree.inspection import why as explain

    try:
        numbers = [float(part) for part in observation.split(",")]
    except ValueError:
        raise InvalidArgumentError(
            f"--observation must be numbers with commas between, got {observation!r}"
        ) from None
    loaded = load_policy(policy)
    shown = None if demos is None else load_demonstrations(demos, loaded)
    found = explain(loaded, numbers, demonstrations=shown)
    names = loaded.schema.actions
    Output(as_json=as_json).result(
        {
            "action": names[found.action],
            "leaf": found.leaf,
            "region": found.region,
            "path": [
                {
                    "node": step.node,
                    "feature": loaded.schema.features[step.feature].name,
                    "threshold": step.threshold,
                    "value": step.value,
                    "is_true": step.is_true,
                    "distance": step.distance,
                }
                for step in found.path
            ],
            "alternatives": [
                {
                    "action": names[other.action],
                    "observation": other.observation,
                    "distance": other.distance,
                    "leaf": other.leaf,
                    "words": other.words,
                }
                for other in found.alternatives
            ],
            "visits": found.visits,
            "values": found.values,
            "demonstrations": None
            if found.support is None
            else [
                {"episode": entry.episode, "step": entry.step, "action": names[entry.action]}
                for entry in found.support
            ],
        },
        found.text,
    )


@click.command(epilog="Example: eutree diff runs/a/expert.json runs/a/policy.json")
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@path_option("--demos", text="Demonstrations: how many of their steps each change concerns.")
@json_option
def diff(first: Path, second: Path, demos: Path | None, as_json: bool) -> None:
    """Say where FIRST and SECOND, two policy files, decide differently, and how they are built."""
    from eutree.inspection import diff as compare

    one, two = load_policy(first), load_policy(second)
    recorded = None if demos is None else load_demonstrations(demos, one)
    found = compare(one, two, observations=None if recorded is None else _seen(one, recorded))
    names = one.schema.actions
    Output(as_json=as_json).result(
        {
            "share": found.share,
            "boxes": [
                {
                    "share": box.share,
                    "first": names[box.first],
                    "second": names[box.second],
                    "low": box.region.low,
                    "high": box.region.high,
                    "words": box.words,
                    "visited": box.visited,
                }
                for box in found.boxes
            ],
            "visited": found.visited,
            "structure": found.structure,
            "n_leaves": found.n_leaves,
        },
        str(found),
    )


def _seen(policy: "TreePolicy", recorded: "Demonstrations") -> "Floats":
    """Return what the policy sees before each recorded decision."""
    return np.concatenate(
        [policy.features.of_episode(e.observations, e.actions)[:-1] for e in recorded.episodes]
    )
