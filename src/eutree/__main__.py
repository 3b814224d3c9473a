"""``python -m eutree`` and the ``eutree`` command."""

import atexit
import os
import re
import signal
import sys
import warnings
from collections import namedtuple

from eutree.errors import interrupt

_OF_GYMNASIUM = re.compile(r"^\x1b\[\d+mWARN: |\x1b\[\d+m")
_said: set[str] = set()


def main() -> None:
    """Run the command line; SIGTERM ends it as Ctrl-C does, from first import to last write.

    Their exit codes are 143 and 130. Commands that can save their work take over both signals until
    it is saved. Ctrl-C while the process ends, once all is saved, ends it at once.
    """
    signal.signal(signal.SIGTERM, interrupt)
    listens = signal.getsignal(signal.SIGINT) is not signal.SIG_IGN  # as not behind a shell
    warnings.formatwarning = _in_one_line
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # Python's own end would be hit
    try:
        from eutree.cli.main import run

        if listens:
            signal.signal(signal.SIGINT, interrupt)
        code = run(sys.argv[1:])
    except KeyboardInterrupt as asked:  # while the command line itself was being imported
        code = 128 + (asked.args[0] if asked.args else signal.SIGINT)
    finally:
        if listens:
            signal.signal(signal.SIGINT, lambda *_: os._exit(128 + signal.SIGINT))
    # CPython takes an interrupt of a text that was under way in ``exec`` for unhandled, whoever has
    # handled it, and ends by the signal, unless another text has run since: this evaluates one.
    namedtuple("Ended", ())
    sys.exit(code)


def _in_one_line(message: Warning | str, *_: object, **__: object) -> str:
    """Return a warning as a user reads it: no place in our source, no red of Gymnasium's, once."""
    said = " ".join(_OF_GYMNASIUM.sub("", str(message)).split())
    if said in _said:
        return ""
    _said.add(said)
    return f"warning: {said}\n"


if __name__ == "__main__":
    main()
