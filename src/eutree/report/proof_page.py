"""The page of a certificate: its sentence, its figures, and the starts coloured by their steps."""

from html import escape

import numpy as np

from eutree.arrays import Integers
from eutree.policies import TreePolicy
from eutree.proof import Certificate, Pieces
from eutree.proof.certificate import NEVER
from eutree.report.head import head
from eutree.report.html import asset, page

_WIDTH, _HEIGHT = 640.0, 200.0
_COLUMNS, _CELLS = 320, 64  # of starts along one number, and along each of two
_OPEN = -1  # a cell in which some start is not decided
_EMPTY = -2


def proof_page(certificate: Certificate, *, title: str, policy: TreePolicy) -> str:
    """Return one self-contained HTML page of a certificate.

    Args:
        certificate: The certificate.
        title: What it is about: the environment.
        policy: The policy, whose rules the page shows.
    """
    facts = [f"{certificate.verdict}, {certificate.kind}"]
    facts += [f"{name.replace('_', ' ')}: {value:,.0f}" for name, value in certificate.work.items()]
    top = head(title, [certificate.sentence], facts)
    parts = ["<main>", top, f"<section>{_table(certificate)}</section>"]
    if certificate.pieces is not None and certificate.pieces.low.size:
        parts.append(f"<section>{picture(certificate.pieces)}</section>")
    rules = f"<h2>The policy</h2><pre>{escape(str(policy))}</pre>"
    parts += [f"<section>{rules}</section>", "</main>"]
    style = asset("chart.css") + asset("run.css")
    return page(title=f"Certificate: {title}", body="\n".join(parts), style=style)


def picture(pieces: Pieces) -> str:
    """Return the starts as SVG: light where few steps are taken, dark where many.

    Black is not decided, red never ends. Along one number steps are heights as well; of more than
    two numbers that vary the first two are shown, with the worst of all others.
    """
    low, high = pieces.low.min(axis=0), pieces.high.max(axis=0)
    varying = np.flatnonzero(high > low)[:2]
    if not varying.size:
        return ""
    names = [pieces.names[k] for k in varying]
    ends = " and ".join(
        f"{escape(name)} from {low[k]:.4g} to {high[k]:.4g}"
        for name, k in zip(names, varying, strict=True)
    )
    worst = _worst(pieces, varying)
    decided = worst[(worst >= 0) & (worst != NEVER)]
    most = int(decided.max()) if decided.size else 1
    least = int(decided.min()) if decided.size else 0
    width, height = _WIDTH / worst.shape[0], _HEIGHT / worst.shape[1]
    rectangles = []
    for (i, j), steps in np.ndenumerate(worst):
        if steps == _EMPTY:
            continue
        tall = height
        if worst.shape[1] == 1 and steps not in (_OPEN, NEVER):
            tall = _HEIGHT * steps / most
        top = _HEIGHT - j * height - tall
        rectangles.append(
            f'<rect x="{i * width:.2f}" y="{top:.2f}" width="{width:.2f}" height="{tall:.2f}" '
            f'fill="{_colour(int(steps), least, most)}"/>'
        )
    said = f"Starts: {ends}. Most steps: {most}; fewest: {least}. Black: not decided; red: never."
    return (
        f'<h2>The starts</h2><p>{said}</p><svg class="chart" viewBox="0 0 {_WIDTH:.0f} '
        f'{_HEIGHT:.0f}" role="img" aria-label="{said}">{"".join(rectangles)}</svg>'
    )


def _worst(pieces: Pieces, varying: Integers) -> Integers:
    """Return the most steps of any start in each cell of the numbers that vary, shape [I, J]."""
    low, high = pieces.low.min(axis=0)[varying], pieces.high.max(axis=0)[varying]
    shape = (_COLUMNS, 1) if varying.size == 1 else (_CELLS, _CELLS)
    counts = np.array(shape[: varying.size])
    scale = counts / (high - low)
    begins = np.floor((pieces.low[:, varying] - low) * scale).astype(int)
    finish = np.ceil((pieces.high[:, varying] - low) * scale).astype(int)
    steps = np.where((pieces.last == NEVER) & (pieces.first != NEVER), _OPEN, pieces.last)
    rank = np.where(steps == _OPEN, NEVER - 1, steps)  # worse than any number, better than never
    found = np.full(shape, _EMPTY)
    for k in np.argsort(rank, kind="stable"):  # the worst is painted last
        room = tuple(slice(b, max(e, b + 1)) for b, e in zip(begins[k], finish[k], strict=True))
        found[room] = steps[k]
    return found


def _colour(steps: int, least: int, most: int) -> str:
    if steps == _OPEN:
        return "#000000"
    if steps == NEVER:
        return "#d62728"
    share = (steps - least) / max(most - least, 1)
    return f"hsl(205,70%,{88 - 58 * share:.0f}%)"


def _table(certificate: Certificate) -> str:
    """Return bounds, undecided share, worst start and counterexample as a table."""
    rows = [
        (name.replace("_", " "), f"{low:.8g} to {high:.8g}")
        for name, (low, high) in certificate.bounds.items()
    ]
    if certificate.kind == "proof":
        rows.append(("share of the starts that is not decided", f"{certificate.undecided:.3g}"))
    for name, start in (
        ("worst start", certificate.worst_start),
        ("counterexample", certificate.counterexample),
    ):
        if start is not None:
            words = ", ".join(f"{key} {value!r}" for key, value in start.items())
            rows.append((name, words))
    cells = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows
    )
    return f"<table>{cells}</table>"
