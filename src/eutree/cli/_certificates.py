"""The file of a certificate: what ``prove --out`` writes and ``export --certificate`` reads."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from eutree.errors import FormatError, InvalidArgumentError
from eutree.files import read_bytes, write_text
from eutree.policies import TreePolicy

_MOST = 2**20  # bytes
_COMMENTS: dict[str, Callable[[str], str]] = {
    "c": lambda text: f"/* {text.replace('*/', '* /')} */",
    "python": lambda text: f"# {text}",
    "st": lambda text: f"(* {text.replace('*)', '* )')} *)",
}


def write_certificate(path: Path, figures: dict[str, Any], policy: TreePolicy) -> None:
    """Write the figures of a certificate, and of which policy they are."""
    write_text(path, json.dumps(figures | {"policy": _mark(policy)}, indent=1) + "\n")


def with_certificate(content: str | bytes, name: str, path: Path, policy: TreePolicy) -> str:
    """Return an export with the sentence of its policy's certificate as a comment on top.

    Raises:
        InvalidArgumentError: The format has no comments here, or the certificate is of another
            policy.
        FormatError: The file is no certificate.
    """
    if name not in _COMMENTS or isinstance(content, bytes):
        raise InvalidArgumentError(
            f"--certificate needs --format {', '.join(_COMMENTS)}, whose comments carry it, "
            f"got {name}"
        )
    try:
        found = json.loads(read_bytes(path, limit=_MOST))
        mark, sentence = found["policy"], found["sentence"]
        verdict = f"{found['verdict']} ({found['kind']})"
    except (ValueError, KeyError, TypeError):
        raise FormatError(path, "certificate", "must be what prove --out writes") from None
    if mark != _mark(policy):
        raise InvalidArgumentError(f"{path} must be a certificate of this policy, got another's")
    text = " ".join(f"Certificate, {verdict}: {sentence}".split())
    return f"{_COMMENTS[name](text)}\n{content}"


def _mark(policy: TreePolicy) -> str:
    """Return what tells a policy from others."""
    return hashlib.sha256(policy.to_bytes()).hexdigest()
