"""LaTeX pictures with TikZ and nothing else."""

from eutree.export._graph import branches, words_of_leaf, words_of_test
from eutree.export._layout import layout
from eutree.export._palette import FILLS
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
    for number, fill in enumerate(FILLS):
        lines.insert(number, rf"\definecolor{{eutree{number}}}{{HTML}}{{{fill[1:].upper()}}}")
    for node in tree.preorder():
        where = f"({places.column[node] * 4.2:.1f},{-places.row[node] * 0.75:.4f})"
        if tree.feature[node] == tree.NO_FEATURE:
            colour = int(policy.actions[tree.leaf[node]]) % len(FILLS)
            words = _escaped(words_of_leaf(policy, node))
            lines.append(rf"  \node[leaf, fill=eutree{colour}] (n{node}) at {where} {{{words}}};")
        else:
            words = _escaped(words_of_test(policy, node)).replace(r"\textless{}=", r"$\leq$")
            lines.append(rf"  \node[test] (n{node}) at {where} {{{words}}};")
    for parent, child, answer in branches(policy):
        edge = rf"(n{parent}.east) -- node[answer] {{{answer}}} (n{child}.west)"
        lines.append(rf"  \draw[black!40] {edge};")
    lines.append(r"\end{tikzpicture}")
    if document:
        opening = [r"\documentclass[border=4pt]{standalone}", r"\usepackage[T1]{fontenc}"]
        lines = [*opening, r"\usepackage{tikz}", r"\begin{document}", *lines, r"\end{document}"]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """Return ``text`` with the signs that TeX gives a meaning to, and ligatures, made harmless."""
    return "".join(_SIGNS.get(sign, sign) for sign in text)
