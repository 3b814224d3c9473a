"""``eutree prove``: a certificate about trajectories."""

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
    seed_option,
)
from eutree.cli._output import Output
from eutree.cli._policies import load_policy
from eutree.errors import InvalidArgumentError
from eutree.schema import EnvironmentSpec

if TYPE_CHECKING:
    from eutree.policies import TreePolicy
    from eutree.proof import Certificate

EXIT_CODES = {"proven": 0, "refuted": 1, "undecided": 3}


@click.command(cls=Helped, epilog="Example: eutree prove expert.json --sampled --html proof.html")
@click.argument("policy", type=click.Path(path_type=Path))
@click.argument("question", metavar="[PROPERTY]", required=False)
@click.option("--env", "environment", metavar="ID", help="In place of the one POLICY names.")
@output_option("--html", text="Write a page: the certificate, and the starts coloured by steps.")
@output_option("--out", text="Write the certificate, for export --certificate.")
@click.option("--sampled", is_flag=True,
              help="A statistical certificate even where a plant is known.")  # fmt: skip
@count_option("--episodes", 1000, "How many episodes a statistical certificate draws.")
@click.option("--confidence", type=float, default=0.99, show_default=True,
              help="Of a statistical certificate.")  # fmt: skip
@click.option("--range", "returns", type=float, nargs=2, metavar="LOW HIGH",
              help="Lowest and highest return there can be, for bounds of its mean.")  # fmt: skip
@env_arg_option
@seed_option
@json_option
@click.pass_context
def prove(
    context: click.Context,
    policy: Path,
    question: str | None,
    environment: str | None,
    html: Path | None,
    out: Path | None,
    sampled: bool,
    episodes: int,
    confidence: float,
    returns: tuple[float, float] | None,
    env_arguments: dict[str, Any],
    seed: int,
    as_json: bool,
) -> None:
    """Prove how every episode of POLICY goes, or refute it with a start.

    PROPERTY is 'arrives [within N steps]', 'stays in CONDITIONS [for N steps]', 'avoids CONDITIONS
    [for N steps]', 'succeeds with probability at least P' or 'returns at least R [with probability
    at least P]'; the environment's plant has one of its own. Where no plant is known the
    certificate is statistical: it rests on episodes.

    The exit code is 0 if it is proven, 1 if it is refuted, 3 if it is left undecided.
    """
    from eutree.files import check_writable, write_text
    from eutree.proof import save_certificate
    from eutree.report.proof_page import proof_page

    output = Output(as_json=as_json)
    loaded = load_policy(policy)
    for path in (html, out):
        if path is not None:
            check_writable(path)
    spec = _spec(loaded, policy, environment, env_arguments)
    found = None if sampled else _proven(loaded, spec, question)
    if found is None:
        found = _sampled(loaded, policy, spec, question, (episodes, seed), (confidence, returns))
    figures = found.figures()
    if out is not None:
        save_certificate(out, found, loaded)
    if html is not None:
        write_text(html, proof_page(found, title=str(spec), policy=loaded))
        figures["path"] = str(html)
    output.result(figures, str(found))
    context.exit(EXIT_CODES[found.verdict])


def _spec(
    policy: "TreePolicy", path: Path, environment: str | None, arguments: dict[str, Any]
) -> EnvironmentSpec:
    if environment is not None:
        return EnvironmentSpec(environment, arguments)
    if policy.environment is None:
        raise InvalidArgumentError(f"{path} names no environment; name one: --env ID")
    return override(policy.environment, arguments)


def _proven(
    policy: "TreePolicy", spec: EnvironmentSpec, question: str | None
) -> "Certificate | None":
    """Return the proof or its failure; None where the environment has no plant."""
    from eutree.proof import plant_of
    from eutree.proof import prove as prove_policy

    plant = plant_of(spec)
    return None if plant is None else prove_policy(policy, plant, question)


def _sampled(
    policy: "TreePolicy",
    path: Path,
    spec: EnvironmentSpec,
    question: str | None,
    drawn: tuple[int, int],
    sure: tuple[float, tuple[float, float] | None],
) -> "Certificate":
    """Return the statistical certificate of a property."""
    from eutree.cli._policies import check_fits
    from eutree.evaluation import evaluate
    from eutree.proof.sampling import Sampling, asked_of_episodes, certify_sample

    sampling = Sampling(confidence=sure[0], returns=sure[1])
    asked = asked_of_episodes(question, str(spec), sampling)
    check_fits(policy, path, spec)
    episodes, seed = drawn
    evaluation = evaluate(policy, spec, episodes=episodes, seed=seed)
    return certify_sample(evaluation, asked, environment=str(spec), sampling=sampling)
