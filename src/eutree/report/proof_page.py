"""A certificate on a page: its sentence, its figures, its pictures."""

from collections.abc import Iterator
from html import escape
from itertools import groupby

from eutree.policies import TreePolicy
from eutree.proof import Certificate, Picture
from eutree.proof.certificate import EMPTY, FAILS, KNOWN, OPEN
from eutree.report.html import asset, head, page

_WIDTH, _HEIGHT = 640.0, 200.0
_SQUARE = 400.0  # height of a picture of two numbers
_LONGEST = 8  # entries of a list that are shown
_COLOURS = {OPEN: "#000000", FAILS: "#d62728", EMPTY: ""}


def proof_page(certificate: Certificate, *, title: str, policy: TreePolicy) -> str:
    """Return one self-contained HTML page of a certificate."""
    rules = f"<h2>The policy</h2><pre>{escape(str(policy))}</pre>"
    top = head(title, [certificate.sentence], [_facts(certificate)])
    parts = [_table(certificate), *(drawn(one, "h2") for one in certificate.pictures), rules]
    sections = "".join(f"<section>{part}</section>" for part in parts)
    style = asset("chart.css") + asset("run.css")
    return page(title=f"Certificate: {title}", body=f"<main>{top}{sections}</main>", style=style)


def certificate_section(certificate: Certificate) -> str:
    """Return the figures of its certificate, for the page of a policy that says its sentence."""
    said = (
        f'<p>{escape(certificate.sentence)}</p><p class="quiet">{escape(_facts(certificate))}</p>'
    )
    parts = [said, _table(certificate), *(drawn(one, "h3") for one in certificate.pictures)]
    return f'<section id="certificate"><h2>Certificate</h2>{"".join(parts)}</section>'


def _facts(certificate: Certificate) -> str:
    facts = [f"{certificate.verdict}, {certificate.kind}"]
    facts += [f"{name.replace('_', ' ')}: {value:,.0f}" for name, value in certificate.work.items()]
    return "; ".join(facts)


def drawn(picture: Picture, heading: str) -> str:
    """Return a picture as SVG: light where values are low, dark where they are high.

    Along one number values are heights as well. Its title is in the element ``heading``.
    """
    rows = picture.marks.shape[1]
    tall = _HEIGHT if rows == 1 else _SQUARE
    ends = zip(picture.names, picture.low, picture.high, strict=True)
    axes = " and ".join(f"{name} from {low:.4g} to {high:.4g}" for name, low, high in ends)
    across = ", to the right and upwards" if rows > 1 else ""
    said = escape(f"{axes}{across}. {picture.legend}")
    frame = '<rect class="axis" fill="none" width="100%" height="100%"/>' if rows > 1 else ""
    return (
        f"<{heading}>{escape(picture.title)}</{heading}><p>{said}</p>"
        f'<svg class="chart" viewBox="0 0 {_WIDTH:.0f} {tall:.0f}" role="img" aria-label="{said}">'
        f"{''.join(_rectangles(picture, tall))}{frame}</svg>"
    )


def _rectangles(picture: Picture, tall: float) -> Iterator[str]:
    """Yield the cells of a picture; those of one colour above each other are one."""
    known = picture.values[picture.marks == KNOWN]
    least, most = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    width, height = _WIDTH / picture.marks.shape[0], tall / picture.marks.shape[1]
    alone = picture.marks.shape[1] == 1 and most > 0
    scale, blue = max(most - least, 1e-300), "hsl(205,70%,{:.0f}%)".format
    for i, column in enumerate(zip(picture.values.tolist(), picture.marks.tolist(), strict=True)):
        begin = 0
        for (colour, value, is_bar), same in groupby(
            (
                _COLOURS.get(mark, blue(88 - 58 * ((value - least) / scale))),
                value * alone,
                mark == KNOWN,
            )
            for value, mark in zip(*column, strict=True)
        ):
            cells = len(list(same))
            high = tall * value / most if alone and is_bar else cells * height
            if colour:
                yield (
                    f'<rect x="{i * width:.2f}" y="{tall - begin * height - high:.2f}" '
                    f'width="{width:.2f}" height="{high:.2f}" fill="{colour}"/>'
                )
            begin += cells


def _table(certificate: Certificate) -> str:
    """Return bounds, undecided share, worst start and counterexample as a table."""
    rows = [
        (name.replace("_", " "), f"{low:.8g} to {high:.8g}")
        for name, (low, high) in certificate.bounds.items()
    ]
    if certificate.kind == "proof":
        rows.append(("share of the starts that is not decided", f"{certificate.undecided:.3g}"))
    for name in ("worst_start", "counterexample"):
        if (start := getattr(certificate, name)) is not None:
            words = ", ".join(f"{key} {_short(value)}" for key, value in start.items())
            rows.append((name.replace("_", " "), words))
    cells = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows)
    return f"<table>{cells}</table>"


def _short(value: object) -> str:
    """Return a value in words; of a long list how it begins."""
    if isinstance(value, list) and len(value) > _LONGEST:
        return f"{value[:_LONGEST]} and {len(value) - _LONGEST} more"
    return repr(value)
