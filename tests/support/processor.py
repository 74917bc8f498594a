"""The processor time of another process and those that it has started, from /proc."""

import os
import time
from pathlib import Path

import pytest
from cluster import descendants

needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads processor time from /proc")


def processor_time(pid: int) -> float:
    """Seconds in user and system mode, also of processes that have ended and that it has waited for."""
    return sum(map(_ticks, (pid, *descendants(pid)))) / os.sysconf("SC_CLK_TCK")


def _ticks(pid: int) -> int:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:  # it has just ended
        return 0
    return sum(map(int, stat.rpartition(")")[2].split()[11:15]))


def wait_for_rest(pid: int) -> None:
    """Wait until the process has used no processor time for half a second."""
    before = None
    while (now := processor_time(pid)) != before:
        before = now
        time.sleep(0.5)
