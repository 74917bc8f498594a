"""The processor time of another process, by /proc."""

import os
import time
from pathlib import Path

import pytest

needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="tells processor time by /proc")


def processor_time(pid: int) -> float:
    """Seconds, of the system's work for the process too."""
    user, system = Path(f"/proc/{pid}/stat").read_text().split()[13:15]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def wait_for_rest(pid: int) -> None:
    """Until the process has used no processor time for half a second."""
    before = None
    while (now := processor_time(pid)) != before:
        before = now
        time.sleep(0.5)
