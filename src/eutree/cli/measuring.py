"""How a policy does in its environment: ``eutree evaluate`` and ``prove``."""

from pathlib import Path
from typing import Any

import click

from eutree.cli import _options as option
from eutree.cli._output import Result, figures_of, said_what_is_played, say
from eutree.cli._policies import against_option, check_fits, controller, load_policy, set_against
from eutree.cli.parts import cluster, workers_options
from eutree.display import counted
from eutree.errors import InvalidArgumentError
from eutree.evaluation import evaluate as evaluate_policy
from eutree.files import check_writable, write_text
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec

EXIT_CODES = {"proven": 0, "refuted": 1, "undecided": 3}


@option.command("eutree evaluate runs/a/policy.json --episodes 1000")
@click.argument("policy", type=click.Path(path_type=Path))
@click.argument("environment", required=False)
@option.count("--episodes", 100, "How many episodes.")
@against_option
@workers_options("the episodes, where they take more than a few seconds")
@option.environment
@option.seed
def evaluate(
    policy: Path,
    environment: str | None,
    episodes: int,
    against: str | None,
    n_jobs: int,
    backend: str,
    address: str | None,
    env_arguments: dict[str, Any],
    seed: int,
) -> Result:
    """Evaluate POLICY, a policy file or a run folder, in ENVIRONMENT, or in the one it names.

    Intervals are of 95 %: Wilson's of the success rate, Student's of the mean return. One in
    twenty is the 5 % quantile of the returns.
    """
    loaded = load_policy(policy)
    hint = f"eutree evaluate {policy} ENVIRONMENT"
    spec = _spec(loaded, policy, environment, env_arguments, hint)
    check_fits(loaded, policy, spec)
    rival = None if against is None else controller(against, "--against", spec)
    total = episodes if rival is None else 2 * episodes
    with cluster(backend, address), said_what_is_played(total):
        result = evaluate_policy(loaded, spec, episodes=episodes, seed=seed, n_jobs=n_jobs)
        found = set_against(rival, spec, result, name=against, seed=seed, n_jobs=n_jobs)
    return Result(
        {
            **figures_of(result, "episodes success_rate success_interval mean_return"),
            **figures_of(result, "return_interval worst_return return_quantile_05 warning"),
            "n_leaves": loaded.n_leaves,
            "mean_length": result.mean_length,
            "environment": str(spec),
            "against": None if found is None else found.facts(),
        },
        f"{spec}, {result}; {result.extremes}"
        + (f"\n{result.warning}" if result.warning else "")
        + ("" if found is None else f"\n{found}"),
    )


@option.command("eutree prove expert.json --sampled --html proof.html")
@click.argument("policy", type=click.Path(path_type=Path))
@click.argument("question", metavar="[PROPERTY]", required=False)
@click.option("--env", "environment", metavar="ID", help="In place of the one POLICY names.")
@option.output("--html", text="Write a page: the certificate, and the starts coloured by steps.")
@option.output("--out", text="Write the certificate, for export --certificate.")
@click.option("--sampled", is_flag=True,
              help="A statistical certificate even where a plant is known.")  # fmt: skip
@option.count("--episodes", 1000, "How many episodes a statistical certificate draws.")
@click.option("--confidence", type=float, default=0.99, show_default=True,
              help="Of a statistical certificate.")  # fmt: skip
@click.option("--range", "returns", type=float, nargs=2, metavar="LOW HIGH",
              help="Lowest and highest return there can be, for bounds of its mean.")  # fmt: skip
@option.environment
@option.seed
def prove(
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
) -> Result:
    """Prove how every episode of POLICY goes, or refute it with a start.

    PROPERTY is 'arrives [within N steps]', 'stays in CONDITIONS [for N steps|for ever]', 'avoids
    CONDITIONS [for N steps|for ever]', 'succeeds with probability at least P' or 'returns at least
    R [with probability at least P]'; the environment's plant has one of its own. Where no plant is
    known the certificate is statistical: it rests on episodes.

    The exit code is 0 if it is proven, 1 if it is refuted, 3 if it is left undecided.
    """
    from eutree.proof import NeedsEpisodesError, plant_of, save_certificate
    from eutree.proof import prove as prove_policy
    from eutree.proof.sampling import Sampling, asked_of_episodes, certify_sample
    from eutree.report.proof_page import proof_page

    loaded = load_policy(policy)
    for path in (html, out):
        if path is not None:
            check_writable(path)
    spec = _spec(loaded, policy, environment, env_arguments, "--env ID")
    plant, found = None if sampled else plant_of(spec), None
    sampling = Sampling(confidence=confidence, returns=returns)
    if plant is not None:
        try:
            found = prove_policy(loaded, plant, question)
        except NeedsEpisodesError:
            say(f"the plant of {spec} says nothing of that: {counted(episodes, 'episode')} answer")
        else:
            if unused := option.given(("episodes", "confidence", "returns", "seed")):
                say(f"no episode was drawn, so {', '.join(unused)} changed nothing (--sampled)")
    if found is None:
        asked = asked_of_episodes(question, str(spec), sampling)
        check_fits(loaded, policy, spec)
        with said_what_is_played(episodes):
            evaluation = evaluate_policy(loaded, spec, episodes=episodes, seed=seed)
        found = certify_sample(evaluation, asked, environment=str(spec), sampling=sampling)
    if out is not None:
        save_certificate(out, found, loaded)
    if html is not None:
        write_text(html, proof_page(found, title=str(spec), policy=loaded))
    written = [str(path) for path in (html, out) if path is not None]
    figures = found.figures() | ({"path": written[0], "files": written} if written else {})
    return Result(figures, str(found), EXIT_CODES[found.verdict])


def _spec(
    policy: TreePolicy, path: Path, environment: str | None, arguments: dict[str, Any], hint: str
) -> EnvironmentSpec:
    """Return the environment that is named, or else the policy's own; the hint says how to."""
    if environment is not None:
        return EnvironmentSpec(environment, arguments)
    if policy.environment is None:
        raise InvalidArgumentError(f"{path} names no environment; name one: {hint}")
    return policy.environment.override(arguments)
