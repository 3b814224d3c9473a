"""``eutree evaluate``: how well a policy does over many episodes."""

from pathlib import Path
from typing import Any

import click

from eutree.cli._commands import Helped
from eutree.cli._options import count_option, env_arg_option, json_option, override, seed_option
from eutree.cli._output import Output, figures_of
from eutree.cli._policies import Rival, against_option, check_fits, load_policy
from eutree.cli.parts import cluster, workers_options
from eutree.errors import InvalidArgumentError
from eutree.schema import EnvironmentSpec


@click.command(cls=Helped, epilog="Example: eutree evaluate runs/a/policy.json --episodes 1000")
@click.argument("policy", type=click.Path(path_type=Path))
@click.argument("environment", required=False)
@count_option("--episodes", 100, "How many episodes.")
@against_option
@workers_options("the episodes, where they take more than a few seconds")
@env_arg_option
@seed_option
@json_option
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
    as_json: bool,
) -> None:
    """Evaluate POLICY, a policy file or a run folder, in ENVIRONMENT, or in the one it names.

    Intervals are of 95 %: Wilson's of the success rate, Student's of the mean return. One in
    twenty is the 5 % quantile of the returns.
    """
    from eutree.evaluation import evaluate as evaluate_policy

    output = Output(as_json=as_json)
    loaded = load_policy(policy)
    if environment is not None:
        spec = EnvironmentSpec(environment, env_arguments)
    elif loaded.environment is not None:
        spec = override(loaded.environment, env_arguments)
    else:
        raise InvalidArgumentError(
            f"{policy} names no environment; name one: eutree evaluate {policy} ENVIRONMENT"
        )
    check_fits(loaded, policy, spec)
    rival = None if against is None else Rival(against, spec)
    with cluster(backend, address):
        result = evaluate_policy(loaded, spec, episodes=episodes, seed=seed, n_jobs=n_jobs)
        rivalry = None if rival is None else rival.follows(result, seed=seed, n_jobs=n_jobs)
    output.result(
        {
            **figures_of(result, "episodes success_rate success_interval mean_return"),
            **figures_of(result, "return_interval worst_return return_quantile_05 warning"),
            "n_leaves": loaded.n_leaves,
            "mean_length": result.mean_length,
            "environment": str(spec),
            "against": None if rivalry is None else rivalry.facts(),
        },
        f"{spec}, {result}; {result.extremes}"
        + (f"\n{result.warning}" if result.warning else "")
        + ("" if rivalry is None else f"\n{rivalry.lines()}"),
    )
