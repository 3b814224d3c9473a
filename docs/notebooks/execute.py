"""Run the notebooks of this folder, and write what their cells show into them.

    python docs/notebooks/execute.py [NAME.ipynb ...]

Cells run in this process, in one namespace, without a Jupyter kernel: no server, no sockets, no
time stamps, and so the same bytes each time. A cell shows what it prints, its last expression and
the matplotlib figures it leaves open, as it would in Jupyter.
"""

import ast
import contextlib
import io
import json
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
_RICH = (("_repr_html_", "text/html"), ("_repr_svg_", "image/svg+xml"))


def read(path: Path) -> dict[str, Any]:
    """Return a notebook as the JSON object that it is."""
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return notebook


def execute(path: Path) -> dict[str, Any]:
    """Return the notebook with the outputs of a fresh run; raises what a cell raises."""
    notebook, namespace, number = read(path), {"__name__": "__main__"}, 0
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            number += 1
            cell["execution_count"] = number
            where = f"{path.name}, cell {number}"
            cell["outputs"] = _run("".join(cell["source"]), namespace, where, number)
    return notebook


def write(path: Path, notebook: dict[str, Any]) -> None:
    """Write a notebook, as Jupyter does."""
    text = json.dumps(notebook, indent=1, ensure_ascii=False, sort_keys=True)
    path.write_text(text + "\n", encoding="utf-8")


def _run(source: str, namespace: dict[str, Any], where: str, number: int) -> list[dict[str, Any]]:
    body = ast.parse(source, where).body
    last = body.pop() if body and isinstance(body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(ast.Module(body, []), where, "exec"), namespace)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), where, "eval"), namespace)
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        text = printed.getvalue().splitlines(keepends=True)
        outputs.append({"name": "stdout", "output_type": "stream", "text": text})
    if value is not None and not source.rstrip().endswith(";"):
        found = {"text/plain": repr(value)}
        found |= {kind: getattr(value, name)() for name, kind in _RICH if hasattr(value, name)}
        data = {kind: text.splitlines(keepends=True) for kind, text in found.items()}
        shown = {"data": data, "metadata": {}, "execution_count": number}
        outputs.append({**shown, "output_type": "execute_result"})
    for figure in _figures():
        data = {"image/svg+xml": figure.splitlines(keepends=True), "text/plain": ["<Figure>"]}
        outputs.append({"data": data, "metadata": {}, "output_type": "display_data"})
    return outputs


def _figures() -> list[str]:
    """Return the open figures as SVG, and close them."""
    if "matplotlib.pyplot" not in sys.modules:
        return []
    from matplotlib import pyplot as plt

    drawn = []
    for number in plt.get_fignums():
        target = io.StringIO()
        with plt.rc_context({"svg.hashsalt": "eutree", "svg.fonttype": "none"}):
            plt.figure(number).savefig(
                target, format="svg", metadata={"Date": None, "Creator": None}, transparent=True
            )
        text = target.getvalue()
        drawn.append(re.sub(r"[ \t]+$", "", text[text.index("<svg") :], flags=re.MULTILINE))
    plt.close("all")
    return drawn


def main() -> None:
    """Write the outputs of the notebooks that are named, or of all."""
    names = [Path(name) for name in sys.argv[1:]] or sorted(HERE.glob("*.ipynb"))
    for path in names:
        write(path, execute(path))
        print(path)


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("agg")
    main()
