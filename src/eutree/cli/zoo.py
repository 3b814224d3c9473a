"""``eutree zoo``: the trees that come with the package."""

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from eutree.cli._options import json_option
from eutree.cli._output import Output

if TYPE_CHECKING:
    from rich.table import Table

    from eutree.zoo import Card


@click.command(epilog="Example: eutree show zoo:MountainCar-v0 --html page.html")
@click.argument("task", required=False)
@json_option
def zoo(task: str | None, as_json: bool) -> None:
    """List the learned trees that come with the package, or those of TASK.

    Each NAME can stand, as zoo:NAME, wherever a command takes a policy file; zoo:TASK is the
    smallest tree as good as the best.
    """
    from eutree.zoo import card, cards

    shown = cards() if task is None else [one for one in cards() if one.task == card(task).task]
    Output(as_json=as_json).result(
        {"trees": [{"name": one.name} | asdict(one) for one in shown]}, _table(shown)
    )


def _table(shown: "tuple[Card, ...] | list[Card]") -> "Table":
    """Return a row for each tree."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title="Trees of the zoo; show one with: eutree show zoo:NAME")
    for name in ("name", "leaves", "return [95 %]", "worst", "success", "steps", "proven"):
        table.add_column(name, justify="left" if name in ("name", "proven") else "right")
    for one in shown:
        low, high = one.interval
        table.add_row(
            escape(one.name),
            str(one.leaves),
            escape(f"{one.mean_return:.1f} [{low:.1f}, {high:.1f}]"),
            f"{one.worst:.1f}",
            "" if one.success is None else f"{100 * one.success:.1f} %",
            f"{one.steps:,}",
            escape(one.proven or ""),
        )
    return table
