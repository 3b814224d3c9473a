"""The sentence of a certificate on top of what is exported."""

from collections.abc import Callable
from pathlib import Path

from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy

_COMMENTS: dict[str, Callable[[str], str]] = {
    "c": lambda text: f"/* {text.replace('*/', '* /')} */",
    "python": lambda text: f"# {text}",
    "st": lambda text: f"(* {text.replace('*)', '* )')} *)",
}


def with_certificate(content: str | bytes, name: str, path: Path, policy: TreePolicy) -> str:
    """Return an export with the sentence of its policy's certificate as a comment on top.

    Raises:
        InvalidArgumentError: The format has no comments here, or the certificate is of another
            policy.
        FormatError: The file is no certificate.
    """
    from eutree.proof import load_certificate

    if name not in _COMMENTS or isinstance(content, bytes):
        raise InvalidArgumentError(
            f"--certificate needs --format {', '.join(_COMMENTS)}, whose comments carry it, "
            f"got {name}"
        )
    found = load_certificate(path, policy)
    text = " ".join(f"Certificate, {found}".split())
    return f"{_COMMENTS[name](text)}\n{content}"
