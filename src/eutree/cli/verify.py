"""``eutree verify``: a proof or a counter-example."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from eutree.cli._options import json_option, path_option
from eutree.cli._output import Output
from eutree.cli._policies import load_demonstrations, load_policy

if TYPE_CHECKING:
    from eutree.arrays import Floats
    from eutree.policies import TreePolicy

EXIT_REFUTED = 1


@click.command(
    epilog="Example: eutree verify expert.json --property 'always go when position > 25'"
)
@click.argument("policy", type=click.Path(path_type=Path))
@click.option("--property", "questions", required=True, multiple=True,
              help="What to prove, for example 'always stop when -2 <= opponent_1 <= 2', "
              "'monotone go in position' or 'no dead leaves'. May be repeated.")  # fmt: skip
@path_option("--demos", text="Demonstrations, for dead leaves.")
@path_option("--run", "run_folder", text="Run folder whose observations count, for dead leaves.")
@click.option("--everywhere", is_flag=True,
              help="Ask for all numbers, not only those within the features' bounds.")  # fmt: skip
@json_option
@click.pass_context
def verify(
    context: click.Context,
    policy: Path,
    questions: tuple[str, ...],
    demos: Path | None,
    run_folder: Path | None,
    everywhere: bool,
    as_json: bool,
) -> None:
    """Prove properties of POLICY, a policy file, or refute them with an observation.

    The exit code is 0 if all are proven, 1 if one is refuted.
    """
    from eutree.inspection import verify as verify_policy

    loaded = load_policy(policy)
    rows = _observations(loaded, demos, run_folder)
    answers = [
        verify_policy(loaded, question, observations=rows, everywhere=everywhere)
        for question in questions
    ]
    holds = all(answer.holds for answer in answers)
    Output(as_json=as_json).result(
        {
            "holds": holds,
            "answers": [
                {
                    "property": answer.property,
                    "holds": answer.holds,
                    "share": answer.share,
                    "counter_examples": [
                        {
                            "words": example.words,
                            "action": loaded.schema.actions[example.action],
                            "leaf": example.leaf,
                            "point": example.point,
                            "raised": example.raised,
                            "low": example.region.low,
                            "high": example.region.high,
                            "share": example.share,
                        }
                        for example in answer.counter_examples
                    ],
                }
                for answer in answers
            ],
        },
        "\n".join(map(str, answers)),
    )
    context.exit(0 if holds else EXIT_REFUTED)


def _observations(
    policy: "TreePolicy", demos: Path | None, run_folder: Path | None
) -> "Floats | None":
    from eutree.training import stored_observations

    if run_folder is not None:
        return stored_observations(run_folder)
    if demos is not None:
        shown = load_demonstrations(demos, policy)
        return shown.with_history(policy.history, policy.past_actions).observations
    return None
