"""The processes of a server, seen from outside."""

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


def descendants(process: int) -> list[int]:
    """The numbers of the processes that it has started, and those that they have."""
    found = []
    for thread in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            children = [int(each) for each in thread.read_text().split()]
        except OSError:
            continue
        for child in children:
            found += [child, *descendants(child)]
    return found
