"""The processor time of another process, from /proc."""

import os
import time
from pathlib import Path

import pytest

needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads processor time from /proc")


def processor_time(pid: int) -> float:
    """Seconds in user and system mode."""
    user, system = Path(f"/proc/{pid}/stat").read_text().split()[13:15]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def wait_for_rest(pid: int) -> None:
    """Wait until the process has used no processor time for half a second."""
    before = None
    while (now := processor_time(pid)) != before:
        before = now
        time.sleep(0.5)
