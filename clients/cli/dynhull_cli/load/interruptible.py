"""Input that a signal interrupts, whenever it comes."""

import io
import os
import select
import signal
import threading
from typing import Any


def can_be_interrupted(raw: Any) -> bool:
    """Whether `InterruptibleInput` can read this, here."""
    is_file = isinstance(raw, io.FileIO)
    return is_file and hasattr(select, "poll") and threading.current_thread() is threading.main_thread()


class InterruptibleInput(io.RawIOBase):
    """Input whose reads end when a signal comes, so that its handler runs. For the main thread.

    Python looks for signals before it reads. One that comes between that look and the read, or that goes to another
    thread, would only be seen when there is more input. So a read waits for signals, too.
    """

    def __init__(self, raw: io.FileIO) -> None:
        self._raw = raw
        self._woken, self._wakes = os.pipe()
        for each in (self._woken, self._wakes):
            os.set_blocking(each, False)
        self._before = signal.set_wakeup_fd(self._wakes, warn_on_full_buffer=False)

    def readable(self) -> bool:
        """True."""
        return True

    def readinto(self, buffer: Any) -> int | None:
        """Read once there is something to read."""
        waiting = select.poll()
        for each in (self._raw.fileno(), self._woken):
            waiting.register(each, select.POLLIN)
        while True:
            ready = dict(waiting.poll())
            if self._woken in ready:
                os.read(self._woken, io.DEFAULT_BUFFER_SIZE)
            elif self._raw.fileno() in ready:
                return self._raw.readinto(buffer)

    def close(self) -> None:
        """Stop to wait for signals; the input stays open."""
        if not self.closed:
            signal.set_wakeup_fd(self._before)
            os.close(self._woken)
            os.close(self._wakes)
        super().close()
