"""The process that an object belongs to: a fork copies the object, but neither its threads nor its connection."""

import os
from threading import Thread
from weakref import WeakSet

ADVICE = "start processes by 'spawn' or 'forkserver', or fork before a writer, pipeline, watch or ingest is open"


class Home:
    """The process in which an object was made.

    Args:
        what: the object, as errors name it.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        self._process = os.getpid()

    def left(self) -> bool:
        """Whether this is another process: one that was forked later."""
        return self._process != os.getpid()

    def require(self) -> None:
        """RuntimeError in a process that was forked later, where whatever waits for the object would wait for ever."""
        if self.left():
            raise RuntimeError(
                f"the {self.what} belongs to process {self._process}, and this one was forked from it without the "
                f"threads that serve it: {ADVICE}"
            )

    def begin(self) -> None:
        """Threads of gRPC serve the object from now on."""
        _served.add(self)

    def served_by(self, thread: Thread) -> Thread:
        """Start a thread that serves the object; RuntimeError where the system has no more, and nothing has begun."""
        self.begin()
        try:
            thread.start()
        except RuntimeError:
            self.end()
            raise
        return thread

    def end(self) -> None:
        """No threads serve it any more."""
        _served.discard(self)


_served: WeakSet[Home] = WeakSet()
_cut_off: list[str] = []


def require_grpc() -> None:
    """RuntimeError in a process that was forked while threads of gRPC were busy: gRPC hangs there, or aborts it."""
    if _cut_off:
        raise RuntimeError(
            f"this process was forked while a {_cut_off[0]} was open, and gRPC does not work in such a fork: {ADVICE}"
        )


def _forked() -> None:
    _cut_off.extend(home.what for home in _served)
    _served.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked)
