"""How long it takes to begin: `python benchmarks/startup.py [--repeat 21] [--folder .]`.

Each work is a process of its own, with cached bytecode as installed packages have it; they take turns. Columns: seconds
until it has ended, or for a server until its first answer to a client that waits for it, and those of processor time.
"""

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from dynhull_client import HullClient

DYNHULL = Path(sys.executable).with_name("dynhull")
Seconds = tuple[float, float]
Work = Callable[[], Seconds]


def processor_time() -> float:
    """Of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def ended(*command: str) -> Seconds:
    """Seconds until a command has ended, and those of its processor time."""
    before, begun = processor_time(), time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - begun, processor_time() - before


def answered(*options: str) -> Seconds:
    """Seconds until a server has answered, and those of its processor time until then."""
    begun = time.perf_counter()
    command = [str(DYNHULL), "serve", "--port", "0", "--log-level", "warning", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            found = re.search(r"\S+:\d+", process.stdout.readline())
            assert found is not None
            with HullClient(found[0]) as client:
                client.list_hulls()
            took = time.perf_counter() - begun
            ticks = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
        finally:
            process.terminate()
    return took, sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description="How long it takes to begin.")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    parser.add_argument("--repeat", type=int, default=21, help="runs of each; medians are printed (default 21)")
    options = parser.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        works: dict[str, Work] = {
            "`python -c pass`": lambda: ended(sys.executable, "-c", "pass"),
            "`import numpy`": lambda: ended(sys.executable, "-c", "import numpy"),
            "`import dynhull`": lambda: ended(sys.executable, "-c", "import dynhull"),
            "`dynhull --help`": lambda: ended(str(DYNHULL), "--help"),
            "`dynhull serve --in-memory`, first answer": lambda: answered("--in-memory"),
            "`dynhull serve --data`, first answer": lambda: answered("--data", folder),
        }
        found: dict[str, list[Seconds]] = {name: [] for name in works}
        for work in works.values():
            work()  # files into memory, bytecode onto the disk
        for _ in range(options.repeat):
            for name, work in works.items():
                found[name].append(work())
    print("| | seconds | least | greatest | processor time | least |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, rows in found.items():
        took, cpu = zip(*rows, strict=True)
        print(
            f"| {name} | {median(took):.2f} | {min(took):.2f} | {max(took):.2f} | {median(cpu):.2f} | {min(cpu):.2f} |"
        )
    print(f"\nload average {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
