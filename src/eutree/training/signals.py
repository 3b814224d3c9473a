"""Ctrl-C and SIGTERM as a polite request: finish nothing more, save, and exit.

Who does not answer within half a second, because a long evaluation or expansion is under way, is
interrupted. What that leaves half done is thrown away.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

GRACE = 0.5  # seconds


class StopRequest:
    """Whether a signal asked to stop, and which.

    Attributes:
        signal: Number of the signal; 0 while none came.
    """

    def __init__(self) -> None:
        self.signal = 0

    def __call__(self) -> bool:
        """Return whether a signal came."""
        return self.signal != 0

    def no_more(self) -> None:
        """Interrupt no more: the block is about to end by itself."""
        signal.setitimer(signal.ITIMER_REAL, 0)

    @property
    def exit_code(self) -> int:
        """128 plus the signal's number, as shells expect: 130 for Ctrl-C, 143 for SIGTERM."""
        return 128 + self.signal


@contextmanager
def stop_on_signals() -> Iterator[StopRequest]:
    """Turn the first SIGINT or SIGTERM into a request; the second acts as it always does.

    If the ``with`` block is still running ``GRACE`` later, KeyboardInterrupt is raised in it; one
    that leaves the block becomes an exit with the signal's code.
    Only usable in the main thread, like all handling of signals in Python.
    """
    request = StopRequest()
    asked = (signal.SIGINT, signal.SIGTERM)
    previous = {number: signal.getsignal(number) for number in (*asked, signal.SIGALRM)}

    def note(number: int, frame: FrameType | None) -> None:
        request.signal = number
        signal.signal(number, previous[signal.Signals(number)])
        signal.setitimer(signal.ITIMER_REAL, GRACE)

    def insist(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, insist)
    for number in asked:
        signal.signal(number, note)
    try:
        yield request
    except KeyboardInterrupt:
        if request():
            raise SystemExit(request.exit_code) from None
        raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in previous.items():
            signal.signal(number, handler)
