"""``eutree fit``: demonstrations to expert tree."""

from pathlib import Path

import click

from eutree.cli._options import count_option, json_option, path_option
from eutree.cli._output import Output


@click.command(epilog="Example: eutree fit demos/ --out expert.json")
@click.argument("demonstrations", type=click.Path(path_type=Path))
@path_option("--out", text="File to write.", required=True)
@count_option("--min-objects", 2, "C4.5's m: the fewest transitions on a side of a test.")
@click.option("--confidence", type=float, default=0.25, show_default=True,
              help="C4.5's CF: the smaller, the more is pruned.")  # fmt: skip
@click.option("--no-pruning", is_flag=True, help="Keep the unpruned tree.")
@click.option("--shift-delay", is_flag=True,
              help="Label what was on the screen when the key was pressed.")  # fmt: skip
@json_option
def fit(
    demonstrations: Path,
    out: Path,
    min_objects: int,
    confidence: float,
    no_pruning: bool,
    shift_delay: bool,
    as_json: bool,
) -> None:
    """Fit the expert tree to DEMONSTRATIONS with C4.5: observations to the expert's actions."""
    from eutree.c45 import C45Settings
    from eutree.data import Demonstrations
    from eutree.learners.expert_tree import fit_expert_tree

    output = Output(as_json=as_json)
    demos = Demonstrations.load(demonstrations)
    if shift_delay:
        from eutree.data.timing import shift_delay as shifted

        demos = shifted(demos)
    settings = C45Settings(min_objects=min_objects, confidence=confidence, prune=not no_pruning)
    expert = fit_expert_tree(demos, settings=settings)
    expert.save(out)
    right = expert.predict(demos.observations)[0] == demos.actions
    accuracy = float(right.mean())
    output.result(
        {
            "n_leaves": expert.n_leaves,
            "n_transitions": demos.n_transitions,
            "training_accuracy": accuracy,
            "path": str(out),
        },
        f"{expert}\n{expert.n_leaves} leaves from {demos.n_transitions} transitions of "
        f"{len(demos)} episodes; {accuracy:.1%} of the expert's actions; written to {out}",
    )
