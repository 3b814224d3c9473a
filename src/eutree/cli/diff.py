"""``eutree diff``: what changed between two policies."""

from pathlib import Path

import click

from eutree.cli._options import json_option
from eutree.cli._output import Output
from eutree.cli._policies import load_policy


@click.command(epilog="Example: eutree diff runs/a/expert.json runs/a/policy.json")
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@json_option
def diff(first: Path, second: Path, as_json: bool) -> None:
    """Say where FIRST and SECOND, two policy files, decide differently, and how they are built."""
    from eutree.inspection import diff as compare

    one, two = load_policy(first), load_policy(second)
    found = compare(one, two)
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
                }
                for box in found.boxes
            ],
            "structure": found.structure,
            "n_leaves": found.n_leaves,
        },
        str(found),
    )
