"""Restarts with many hulls: `python benchmarks/restarts.py [--keyed str] [--hulls 10000] [--repeat 5] [--folder .]`.

Each hull has 100 points, or keys with their positions, in one batch of the journal. A server with all of them and one
without any start in turn, with cached bytecode, as installed packages have it. Columns: seconds from the start of the
process to its line "serving", those of processor time until then, and the resident memory.
"""

import argparse
import asyncio
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
from durability import OPTIONS, serving

from dynhull_client import AsyncHullClient

POINTS = 100
AT_ONCE = 100  # hulls that are filled side by side


async def fill(address: str, hulls: int, keyed: str | None) -> None:
    """Create the hulls."""
    random = np.random.default_rng(3)
    async with AsyncHullClient(address) as client:

        async def make(number: int) -> None:
            name, points = f"hull-{number}", random.random((POINTS, 2))
            await client.create_hull(name, keyed=keyed)
            if keyed is None:
                await client.apply(name, insert=points)
            else:
                keys = range(number * POINTS, (number + 1) * POINTS)
                await client.put(name, [f"vehicle-{key}" for key in keys] if keyed == "str" else keys, points)

        for first in range(0, hulls, AT_ONCE):
            await asyncio.gather(*(make(each) for each in range(first, min(first + AT_ONCE, hulls))))


def start(*options: str) -> tuple[float, float, float]:
    """Seconds until a server serves, those of its processor time, and kilobytes of its memory."""
    begun = time.perf_counter()
    with subprocess.Popen([sys.executable, *OPTIONS, *options], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert "serving" in process.stdout.readline()
            took = time.perf_counter() - begun
            about = Path(f"/proc/{process.pid}")
            ticks = about.joinpath("stat").read_text().rpartition(")")[2].split()[11:13]
            pages = int(about.joinpath("statm").read_text().split()[1])
        finally:
            process.terminate()
    return took, sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGE_SIZE") / 1000


def main() -> None:
    parser = argparse.ArgumentParser(description="Restarts with many small hulls, beside those of an empty server.")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    parser.add_argument("--repeat", type=int, default=5, help="restarts of each; medians are printed (default 5)")
    parser.add_argument("--hulls", type=int, default=10_000, help="number of hulls (default 10,000)")
    parser.add_argument(
        "--keyed", choices=("str", "int"), help="keyed hulls, with keys of this kind (default: without)"
    )
    options = parser.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        kept, none = (("--data", f"{folder}/{name}") for name in ("kept", "none"))
        with serving(*kept, "--durability", "none") as address:
            asyncio.run(fill(address, options.hulls, options.keyed))
        works = {f"{options.hulls:,} hulls": kept, "no hulls": none}
        for each in works.values():
            start(*each)  # files into memory, bytecode onto the disk
        found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in works}
        for _ in range(options.repeat):
            for name, each in works.items():
                found[name].append(start(*each))
    print("| a server with | ready after, s | least | greatest | processor time, s | memory, MB |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, rows in found.items():
        took, cpu, memory = zip(*rows, strict=True)
        figures = f"{median(took):.2f} | {min(took):.2f} | {max(took):.2f} | {median(cpu):.2f}"
        print(f"| {name} | {figures} | {median(memory) / 1000:.1f} |")
    full, empty = (median(row[2] for row in rows) for rows in found.values())
    print(f"\n{(full - empty) / options.hulls:.1f} kB a hull")


if __name__ == "__main__":
    main()
