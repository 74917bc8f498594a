"""Memory of a server for each thing that it holds: `python benchmarks/memory.py [--repeat 3] [KIND ...]`.

A server in memory holds many of a kind, then as many more: what its own pages (those it shares with no other process)
have grown by meanwhile, divided by their number.
"""

import argparse
import asyncio
import sys
from contextlib import AsyncExitStack
from pathlib import Path
from statistics import median

from workers import serving

from dynhull_client import AsyncHullClient

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from holdings import KINDS, OPTIONS, Hold


def own_bytes(pid: int) -> int:
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Private_")) * 1024


async def measure(hold: Hold, count: int) -> float:
    """Bytes for each of `count` more, after as many, which fill up what a server has freed since it started."""
    with serving(["-m", "dynhull_server", *OPTIONS]) as (address, pid):
        async with AsyncHullClient(address) as client, AsyncExitStack() as stack:
            await hold(client, stack, 0, count)
            before = own_bytes(pid)
            await hold(client, stack, count, 2 * count)
            return (own_bytes(pid) - before) / count


def main() -> None:
    parser = argparse.ArgumentParser(description="Memory of a server for each thing that it holds.")
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"what to measure: {'; '.join(KINDS)}")
    parser.add_argument("--repeat", type=int, default=3, help="servers for each kind; medians are printed (default 3)")
    options = parser.parse_args()
    print("| | bytes |\n| --- | ---: |")
    for name in options.kinds or KINDS:
        count, hold = KINDS[name]
        rounds = [asyncio.run(measure(hold, count)) for _ in range(options.repeat)]
        print(f"| {name} | {round(median(rounds)):,} |", flush=True)


if __name__ == "__main__":
    main()
