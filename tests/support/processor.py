"""The processor time of another process and those that it has started, from /proc."""

import os
from pathlib import Path

import pytest
from cluster import descendants
from patience import wait_until

LOOKS = 20  # each as long after the one before as `wait_until` pauses: half a second together

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
    """Wait until the process has used no processor time over several looks, though not for want of a processor."""
    before, quiet = -1.0, 0

    def rests() -> bool:
        nonlocal before, quiet
        now = processor_time(pid)
        quiet = quiet + _sleeps(pid) if now == before else 0
        before = now
        return quiet == LOOKS

    wait_until(rests)


def _sleeps(pid: int) -> bool:
    """Whether all threads wait for something other than a processor or a disk."""
    return not any(
        _state(task) in "RD" for each in (pid, *descendants(pid)) for task in Path(f"/proc/{each}/task").glob("*")
    )


def _state(task: Path) -> str:
    try:
        return (task / "stat").read_text().rpartition(")")[2].split()[0]
    except OSError:  # it has just ended
        return "X"
