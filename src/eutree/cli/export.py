"""``eutree export``: a policy as C, ONNX, DOT, SVG, JSON, text, Python and more."""

import sys
from pathlib import Path
from typing import Any

import click

from eutree.cli import _options as option
from eutree.cli._output import Output
from eutree.cli._policies import load_policy, with_certificate
from eutree.errors import InvalidArgumentError
from eutree.export import FORMATS, to_c_header, to_c_test
from eutree.export import export as make
from eutree.export.c import function_name
from eutree.files import write_bytes


@click.command(epilog="Example: eutree export small.json --format c --out evasion.c --header")
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
@option.as_json
def export(
    policy: Path,
    format_name: str | None,
    out: Path | None,
    as_json: bool,
    header: bool,
    self_test: bool,
    certificate: Path | None,
    **options: Any,
) -> None:
    """Write a policy in another format that decides exactly like it.

    Without --out, the content goes to standard output.
    """
    output = Output(as_json=as_json)
    name = format_name or _format_of(out)
    given = {key: value for key, value in options.items() if value}
    if "scale" in given:
        given["scale"] = _scale(given["scale"])
    loaded = load_policy(policy)
    if name == "c" and out is not None:
        given.setdefault("name", function_name(out.stem))
    if header or self_test:
        _check_c(name, out)
        given["header"] = True
    content = make(loaded, name, **given)
    if certificate is not None:
        content = with_certificate(content, name, certificate, loaded)
    data = content if isinstance(content, bytes) else content.encode("utf-8")
    if out is None:
        _print(output, name, content)
        return
    files = {out: data}
    given.pop("header", None)
    if header or self_test:
        files[out.parent / f"{given['name']}.h"] = to_c_header(loaded, **given).encode("utf-8")
    if self_test:
        files[out.parent / f"{given['name']}_test.c"] = to_c_test(loaded, **given).encode("utf-8")
    for path, entry in files.items():
        write_bytes(path, entry)
    written = [str(path) for path in files]
    values = {"format": name, "path": str(out), "files": written, "bytes": len(data)}
    output.result(values | {"n_leaves": loaded.n_leaves}, f"written to {', '.join(written)}")


def _format_of(out: Path | None) -> str:
    """Return the format that a file's suffix names."""
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


def _check_c(name: str, out: Path | None) -> None:
    """Raise unless a header and a test program can be written beside the source."""
    if name != "c" or out is None:
        raise InvalidArgumentError(
            "--header and --self-test need --format c and --out, because they are files beside it"
        )


def _scale(texts: tuple[str, ...]) -> float | dict[str, float]:
    """Return one scale for all features, or one for each that is named."""
    if len(texts) == 1 and "=" not in texts[0]:
        return _number(texts[0])
    return {name: _number(value) for name, _, value in (text.rpartition("=") for text in texts)}


def _number(text: str) -> float:
    """Return the number that a text holds, or raise InvalidArgumentError."""
    try:
        return float(text)
    except ValueError:
        raise InvalidArgumentError(f"--scale must be [FEATURE=]NUMBER, got {text!r}") from None


def _print(output: Output, name: str, content: str | bytes) -> None:
    """Write the content itself to standard output, or as an entry of the JSON object."""
    if isinstance(content, bytes):
        if output.as_json:
            raise InvalidArgumentError(f"--json with the binary format {name} needs --out")
        sys.stdout.buffer.write(content)
    elif output.as_json:
        output.result({"format": name, "content": content}, "")
    else:
        click.echo(content, nl=False)
