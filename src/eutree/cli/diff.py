"""``eutree diff``: what changed between two policies."""

from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from eutree.cli._options import json_option, path_option
from eutree.cli._output import Output
from eutree.cli._policies import load_demonstrations, load_policy

if TYPE_CHECKING:
    from eutree.arrays import Floats
    from eutree.data import Demonstrations
    from eutree.policies import TreePolicy


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
