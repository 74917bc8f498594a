"""Bounds the processor time of a plan: one that goes round without an end is a finding, too.

Waits are bounded in turns, which are the same every time. This is for what goes on within one turn.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

# Seconds of processor time, where most plans take less than one.
SECONDS = 120.0
# Seconds until what goes on anyway is interrupted again: errors end no work of a server.
AGAIN = 1.0


class EndlessError(BaseException):
    """A plan has not ended."""


@contextmanager
def bounded(seconds: float = SECONDS) -> Iterator[None]:
    """A block in which EndlessError is raised after so many seconds of processor time.

    Only the main thread of a process can be interrupted; a block in another one has no bound.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGPROF, lambda *_: _end(seconds))
    signal.setitimer(signal.ITIMER_PROF, seconds, AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _end(seconds: float) -> NoReturn:
    raise EndlessError(f"it does not end within {seconds:.1f} s of processor time")
