"""A policy as others have it: ``eutree show`` and ``eutree export``.

A tree in the terminal, or as a page to watch it decide; C, ONNX, DOT, SVG, JSON and more.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from eutree.cli import _options as option
from eutree.cli._output import Result, progress, say
from eutree.cli._policies import load_demonstrations, load_policy
from eutree.display import counted
from eutree.errors import InvalidArgumentError
from eutree.export import FORMATS, to_c_header, to_c_test
from eutree.export import export as make
from eutree.export.c import function_name
from eutree.files import check_writable, write_bytes, write_text
from eutree.policies import TreePolicy
from eutree.trees.text import Digits, asked, definitions, printable

if TYPE_CHECKING:
    from rich.text import Text


# Names of terminal colours, so that each terminal's own theme keeps them readable.
_COLOURS = ("yellow", "cyan", "green", "magenta", "blue", "red")
_SCALE = ("blue", "cyan", "green", "yellow", "red")
_COMMENTS: dict[str, Callable[[str], str]] = {
    "c": lambda text: f"/* {text.replace('*/', '* /')} */",
    "python": lambda text: f"# {text}",
    "st": lambda text: f"(* {text.replace('*)', '* )')} *)",
}


@option.command("eutree show small.json --html small.html --demos demos/")
@click.argument("policy", type=click.Path(path_type=Path))
@option.output("--html", text="Write a page on which the policy can be watched and questioned.")
@option.output("--run-html", text="Write a page about the run in the folder POLICY: curve, "
               "teacher, world model, races.")  # fmt: skip
@option.count("--episodes", 10, "How many episodes the page plays.", least=0)
@option.path("--demos", text="Demonstrations whose steps the page shows in their leaves.")
@option.path("--certificate", text="What prove --out wrote of POLICY; the page shows it.")
@option.environment
@option.seed
def show(
    policy: Path,
    html: Path | None,
    run_html: Path | None,
    episodes: int,
    demos: Path | None,
    certificate: Path | None,
    env_arguments: dict[str, Any],
    seed: int,
) -> Result:
    """Show a policy's tree in the terminal, or with --html as a page.

    The page plays episodes of the policy with pictures where its environment can draw them.
    """
    of_page = ("demos", "certificate", "env_arguments")
    if run_html is not None:
        option.refuse(of_page, "--run-html shows what a run has stored")
        from eutree.report import report_of_run, run_page

        if html is not None:
            raise InvalidArgumentError(
                "--html and --run-html are two pages, got both: ask for one after the other"
            )
        check_writable(run_html)
        report = report_of_run(policy)
        write_text(run_html, run_page(report))
        trust = None if report.trust is None else report.trust.figures()
        return Result({"path": str(run_html), "model_trust": trust}, f"written to {run_html}")
    loaded = load_policy(policy)
    values = {
        "n_leaves": loaded.n_leaves,
        "depth": loaded.tree.depth,
        "features": list(loaded.schema.feature_names),
        "actions": list(loaded.schema.actions),
        "rules": str(loaded),
    }
    if html is None:
        option.refuse(of_page, "only a page has a use for it, --html")
        return Result(values, drawn(loaded))
    from eutree.interaction.making import make
    from eutree.proof import load_certificate
    from eutree.report import WatchedEpisode, policy_page
    from eutree.report.watching import watch_if_possible

    check_writable(html)
    proven = None if certificate is None else load_certificate(certificate, loaded)
    spec = loaded.environment and loaded.environment.override(env_arguments)
    watched: list[WatchedEpisode] = []
    problem = ""
    if spec is not None and env_arguments:
        make(spec).close()  # a mistake in what was given is no reason for a page without episodes
    if episodes:
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures are drawn without a display
        with progress("playing", episodes) as line:
            watched, problem = watch_if_possible(
                loaded, spec, episodes=episodes, seed=seed, on_episode=line.update
            )
    if problem:
        say(problem)
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
    return Result(values, f"written to {html}")


def drawn(policy: TreePolicy) -> "Text":
    """Return the tree as branches of a terminal: tests in words, leaves coloured by action."""
    from rich.text import Text

    tree = policy.tree
    name = str(policy.environment or "")
    made_for = f" for {name if name.isprintable() else printable(name)}" if name else ""
    leaves = counted(policy.n_leaves, "leaf")
    lines = [Text(f"{leaves}, depth {tree.depth}{made_for}", style="bold")]
    guides, digits = {0: ""}, Digits(policy.schema, tree)
    for node in tree.preorder():
        line, parent = Text(), int(tree.parent[node])
        if parent != tree.NO_NODE:
            is_left = tree.left[parent] == node
            answer = asked(policy.schema, tree, parent).answer(is_left=is_left)
            branch = f"{'├─' if is_left else '└─'} {answer:<5}"
            line.append(guides[parent] + branch, style="dim")
            guides[node] = guides[parent] + ("│  " if is_left else "   ")
        lines.append(line + _words(policy, node, digits))
    lines += map(Text, definitions(tree, policy.schema))
    return Text("\n").join(lines)


def _words(policy: TreePolicy, node: int, digits: Digits) -> "Text":
    """Return the test of an inner node, or the action of a leaf with its share of the visits."""
    from rich.text import Text

    tree = policy.tree
    if tree.leaf[node] == tree.NO_LEAF:
        return Text(f"{asked(policy.schema, tree, node).question(digits)} ?")
    leaf = int(tree.leaf[node])
    action = int(policy.actions[leaf])
    colour = _COLOURS[action % len(_COLOURS)]
    if len(policy.schema.controls) == 1:  # an order of levels, and of colours
        levels = policy.schema.controls[0].levels
        rank = sorted(levels).index(levels[action]) / max(len(levels) - 1, 1)
        colour = _SCALE[round(rank * (len(_SCALE) - 1))]
    text = Text(printable(policy.schema.actions[action]), style=f"bold {colour}")
    if policy.leaves is not None and policy.leaves.visits.any():
        visits = policy.leaves.visits.sum(axis=1)
        text.append(f"  {100 * visits[leaf] / visits.sum():.1f} % of visits", style="not bold dim")
    return text


@option.command("eutree export small.json --format c --out evasion.c --header", helped=False)
@click.argument("policy", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "format_name",
    metavar="FORMAT",
    help=f"One of {', '.join(FORMATS)}. If left out, the suffix of --out decides.",
)
@option.output("--out", text="File to write.")
@click.option("--name", help="Name of the function (c, python, st). For c, --out names it too.")
@click.option("--number", help="Type of the numbers in C: double, float or int32.")
@click.option(
    "--scale",
    multiple=True,
    metavar="[FEATURE=]N",
    help="For int32: integers per unit, for all features or for one. May be repeated.",
)
@click.option("--header", is_flag=True, help="For c: write NAME.h too, and include it.")
@click.option("--self-test", is_flag=True, help="For c: write NAME_test.c too, a test program.")
@option.path("--certificate", text="What prove --out wrote of POLICY: its sentence becomes a "
             "comment (c, python, st).")  # fmt: skip
def export(
    policy: Path,
    format_name: str | None,
    out: Path | None,
    header: bool,
    self_test: bool,
    certificate: Path | None,
    **options: Any,
) -> Result | None:
    """Write a policy in another format that decides exactly like it.

    Without --out, the content goes to standard output.
    """
    name = format_name or _format_of(out)
    given = {key: value for key, value in options.items() if value}
    if "scale" in given:
        given["scale"] = _scale(given["scale"])
    loaded = load_policy(policy)
    if name == "c" and out is not None:
        given.setdefault("name", function_name(out.stem))
    if header or self_test:
        if name != "c" or out is None:
            raise InvalidArgumentError(
                "--header and --self-test need --format c and --out, because they are files beside "
                "it"
            )
        given["header"] = True
    content = make(loaded, name, **given)
    if certificate is not None:
        content = _with_certificate(content, name, certificate, loaded, given.get("number"))
    data = content if isinstance(content, bytes) else content.encode("utf-8")
    if out is None:
        return _printed(name, content)
    files = [(out, data)]
    given.pop("header", None)
    for beside, made, wanted in (
        (".h", to_c_header, header or self_test), ("_test.c", to_c_test, self_test)
    ):  # fmt: skip
        if wanted:
            path = out.parent / f"{given['name']}{beside}"
            files.append((path, made(loaded, **given).encode("utf-8")))
    if out in (path for path, _ in files[1:]):
        raise InvalidArgumentError(
            f"--out must be another file than the one that is written beside it, got {out}"
        )
    for path, _ in files:
        check_writable(path)
    for path, entry in files:
        write_bytes(path, entry)
    written = [str(path) for path, _ in files]
    values = {"format": name, "path": str(out), "files": written, "bytes": len(data)}
    return Result(values | {"n_leaves": loaded.n_leaves}, f"written to {', '.join(written)}")


def _with_certificate(
    content: str | bytes, name: str, path: Path, policy: TreePolicy, number: str | None
) -> str:
    """Return an export with the sentence of its policy's certificate as a comment on top."""
    from eutree.proof import load_certificate

    if name not in _COMMENTS or isinstance(content, bytes):
        raise InvalidArgumentError(
            f"--certificate needs --format {', '.join(_COMMENTS)}, whose comments carry it, "
            f"got {name}"
        )
    if number == "int32":  # its inputs are rounded: no start of the proof need arrive
        raise InvalidArgumentError(
            f"--number must be double or float with --certificate, whose words are about "
            f"observations that nothing rounds, got {number}"
        )
    of = " of the tree in double precision" if number == "float" else ""
    text = " ".join(f"Certificate{of}, {load_certificate(path, policy)}".split())
    return f"{_COMMENTS[name](text)}\n{content}"


def _format_of(out: Path | None) -> str:
    for entry in FORMATS.values():
        if out is not None and out.suffix == entry.suffix:
            return entry.name
    if out is not None:
        suffixes = ", ".join(dict.fromkeys(entry.suffix for entry in FORMATS.values()))
        raise InvalidArgumentError(
            f"--out must end in one of {suffixes}, or --format must be one of "
            f"{', '.join(FORMATS)}; got {out}"
        )
    raise InvalidArgumentError(f"--format must be one of {', '.join(FORMATS)}, got none")


def _scale(texts: tuple[str, ...]) -> float | dict[str, float]:
    """Return one scale for all features, or one for each that is named."""
    wanted = "--scale must be [FEATURE=]NUMBER"
    if len(texts) == 1 and "=" not in texts[0]:
        return option.number(texts[0], wanted)
    pairs = (text.rpartition("=") for text in texts)
    return {name: option.number(value, wanted) for name, _, value in pairs}


def _printed(name: str, content: str | bytes) -> Result | None:
    """Write the content itself to standard output, or return it as an entry of the JSON object."""
    if isinstance(content, bytes):
        if option.wants_json():
            raise InvalidArgumentError(f"--json with the binary format {name} needs --out")
        sys.stdout.buffer.write(content)
    elif option.wants_json():
        return Result({"format": name, "content": content}, "")
    else:
        click.echo(content, nl=False)
    return None
