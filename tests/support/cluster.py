"""The processes of a server, seen from outside."""

from collections import defaultdict
from pathlib import Path


def processes(supervisor: int) -> dict[str, int]:
    """The numbers of the workers and gateways that run now, by their names as the operating system shows them."""
    found = {}
    for process in descendants(supervisor):
        try:
            name = Path(f"/proc/{process}/comm").read_text().strip()
        except OSError:  # it has just ended
            continue
        if name.startswith(("worker-", "gateway-")):
            found[name] = process
    return found


def runs(process: int) -> bool:
    """Whether a process has not ended, though nobody may have asked for its exit code."""
    try:
        stat = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return not stat.rpartition(")")[2].startswith(" Z")


def descendants(process: int) -> list[int]:
    """The numbers of the processes that it has started, and those that they have.

    From the parents of all: a file of children leaves some out where another one ends while it is read.
    """
    children = defaultdict[int, list[int]](list)
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = stat.read_text().rpartition(")")[2].split()[1]
        except OSError:  # it has just ended
            continue
        children[int(parent)].append(int(stat.parent.name))
    found = [process]
    for each in found:
        found += children[each]
    return found[1:]
