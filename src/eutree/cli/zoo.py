"""``eutree zoo``: the trees that come with the package."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from eutree.cli._options import json_option
from eutree.cli._output import Output

if TYPE_CHECKING:
    from eutree.zoo import Card


@click.command(epilog="Example: eutree zoo MountainCar-v0")
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
        {"trees": [{"name": one.name} | asdict(one) for one in shown]},
        "\n".join([HEAD, *(line for one in shown for line in _lines(one, full=task is not None))]),
    )


HEAD = "name                    leaves  return [95 %]              worst    steps  proven"


def _lines(one: "Card", *, full: bool) -> Iterator[str]:
    """Yield a tree's row and, in full, what is proven of it and what learned it."""
    low, high = one.interval
    returns = f"{one.mean_return:.1f} [{low:.1f}, {high:.1f}]"
    proven = "yes" if one.proven else ""
    yield (
        f"{one.name:<22}  {one.leaves:>6}  {returns:<24}  {one.worst:>6.1f}  {one.steps:>7,}"
        f"  {proven}"
    ).rstrip()
    if full and one.proven:
        yield f"  proven: {one.proven}"
    if full and one.module:
        yield f"  its task is an example of the repository: --import {one.module}"
    if full:
        yield f"  learned by: {one.command} ({one.commit}, {one.date})"
