"""LaTeX pictures with TikZ and nothing else."""

from eutree.export._blocks import ASSUMPTION
from eutree.export.drawing import (
    branches,
    column_lefts,
    fills,
    layout,
    text_width,
    words_of_leaf,
    words_of_test,
)
from eutree.policies import TreePolicy

_SIGNS = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    '"': r"\textquotedbl{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "-": r"{-}",
    "'": r"{'}",
    "`": r"{`}",
}


# What a pixel of `text_width` takes in \footnotesize of Computer Modern, and space around words.
_CENTIMETRES, _PADDING, _GAP = 0.0215, 0.25, 1.1


def to_latex(policy: TreePolicy, *, document: bool = False) -> str:
    r"""Return the tree as a ``tikzpicture``, root at the left, leaves coloured by action.

    The picture needs ``\usepackage[T1]{fontenc}`` and ``\usepackage{tikz}``; names that are not
    Latin need LuaLaTeX or XeLaTeX and a font that has their letters.

    Args:
        policy: The policy.
        document: Whether to return a whole document rather than the picture alone.
    """
    tree, places = policy.tree, layout(policy.tree)
    lines = [
        r"\begin{tikzpicture}[",
        "  test/.style={draw=black!40, rounded corners=2pt, font=\\footnotesize, anchor=west},",
        "  leaf/.style={rounded corners=5pt, font=\\footnotesize, anchor=west},",
        "  answer/.style={font=\\tiny, text=black!60, fill=white, inner sep=1pt},",
        "]",
    ]
    for number, fill in enumerate(fills(policy.schema)):
        lines.insert(number, rf"\definecolor{{eutree{number}}}{{HTML}}{{{fill[1:].upper()}}}")
    is_leaf = tree.feature == tree.NO_FEATURE
    labels = [
        words_of_leaf(policy, node) if is_leaf[node] else words_of_test(policy, node)
        for node in range(tree.n_nodes)
    ]
    widths = [_CENTIMETRES * text_width(label) + _PADDING for label in labels]
    lefts = column_lefts(places, widths, gap=_GAP)
    for node in tree.preorder():
        where = f"({lefts[node]:.2f},{-places.row[node] * 0.75:.4f})"
        words = _escaped(labels[node])
        if is_leaf[node]:
            colour = int(policy.actions[tree.leaf[node]])
            lines.append(rf"  \node[leaf, fill=eutree{colour}] (n{node}) at {where} {{{words}}};")
        else:
            words = words.replace(r"\textless{}=", r"$\leq$")
            lines.append(rf"  \node[test] (n{node}) at {where} {{{words}}};")
    for parent, child, answer in branches(policy):
        edge = rf"(n{parent}.east) -- node[answer] {{{answer}}} (n{child}.west)"
        lines.append(rf"  \draw[black!40] {edge};")
    lines.append(r"\end{tikzpicture}")
    if policy.masked:
        lines.insert(0, f"% {ASSUMPTION}")
    if document:
        opening = [r"\documentclass[border=4pt]{standalone}", r"\usepackage[T1]{fontenc}"]
        lines = [*opening, r"\usepackage{tikz}", r"\begin{document}", *lines, r"\end{document}"]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """Return ``text`` with the signs that TeX gives a meaning to, and ligatures, made harmless."""
    return "".join(_SIGNS.get(sign, sign) for sign in text)
