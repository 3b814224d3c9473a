"""``eutree show``: a policy's tree in the terminal, or as a page to watch it decide."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli._options import (
    count_option,
    env_arg_option,
    json_option,
    output_option,
    override,
    path_option,
    seed_option,
)
from eutree.cli._output import Output
from eutree.cli._policies import load_demonstrations, load_policy

if TYPE_CHECKING:
    from eutree.policies import TreePolicy
    from eutree.report import WatchedEpisode
    from eutree.schema import EnvironmentSpec


@click.command(epilog="Example: eutree show small.json --html small.html --demos demos/")
@click.argument("policy", type=click.Path(path_type=Path))
@output_option("--html", text="Write a page on which the policy can be watched and questioned.")
@output_option(
    "--run-html",
    text="Write a page about the run in the folder POLICY: curve, teacher, world model, races.",
)
@count_option("--episodes", 10, "How many episodes the page plays.", least=0)
@path_option("--demos", text="Demonstrations whose steps the page shows in their leaves.")
@path_option("--certificate", text="What prove --out wrote of POLICY; the page shows it.")
@env_arg_option
@seed_option
@json_option
def show(
    policy: Path,
    html: Path | None,
    run_html: Path | None,
    episodes: int,
    demos: Path | None,
    certificate: Path | None,
    env_arguments: dict[str, Any],
    seed: int,
    as_json: bool,
) -> None:
    """Show a policy's tree in the terminal, or with --html as a page.

    The page plays episodes of the policy with pictures where its environment can draw them.
    """
    from eutree.cli._tree import drawn
    from eutree.files import check_writable, write_text
    from eutree.proof import load_certificate
    from eutree.report import policy_page

    output = Output(as_json=as_json)
    if run_html is not None:
        _write_run_page(output, policy, run_html)
        return
    loaded = load_policy(policy)
    values = {
        "n_leaves": loaded.n_leaves,
        "depth": loaded.tree.depth,
        "features": list(loaded.schema.feature_names),
        "actions": list(loaded.schema.actions),
        "rules": str(loaded),
    }
    if html is None:
        output.result(values, drawn(loaded))
        return
    check_writable(html)
    proven = None if certificate is None else load_certificate(certificate, loaded)
    spec = loaded.environment and override(loaded.environment, env_arguments)
    watched = _watched(output, loaded, spec, episodes=episodes, seed=seed)
    demonstrations = None if demos is None else load_demonstrations(demos, loaded)
    content = policy_page(
        loaded,
        episodes=watched,
        demonstrations=demonstrations,
        certificate=proven,
        file=policy.name,
    )
    write_text(html, content)
    values |= {"path": str(html), "episodes": len(watched), "bytes": len(content.encode())}
    output.result(values, f"written to {html}")


def _write_run_page(output: Output, folder: Path, file: Path) -> None:
    """Write the page of a run."""
    from eutree.files import check_writable, write_text
    from eutree.report import report_of_run, run_page

    check_writable(file)
    report = report_of_run(folder)
    write_text(file, run_page(report))
    trust = None if report.trust is None else report.trust.figures()
    output.result({"path": str(file), "model_trust": trust}, f"written to {file}")


def _watched(
    output: Output,
    policy: "TreePolicy",
    spec: "EnvironmentSpec | None",
    *,
    episodes: int,
    seed: int,
) -> "list[WatchedEpisode]":
    """Return the episodes that the page plays."""
    from eutree.report.watching import watch_if_possible

    if not episodes:
        return []
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
    watched, problem = watch_if_possible(policy, spec, episodes=episodes, seed=seed)
    if problem:
        output.say(problem)
    return watched
