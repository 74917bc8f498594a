"""The command line of a torture, and the small disk of its own that it works on."""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path

from actors import BREATH


def arguments(description: str, *faults: Sequence[str]) -> argparse.ArgumentParser:
    """The command line of a torture that knows these faults."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--faults", type=int, default=50, help="how many (default 50)")
    parser.add_argument("--seed", type=int, default=0, help="what the faults and the batches depend on (default 0)")
    parser.add_argument(
        "--breath", type=float, default=BREATH, help=f"seconds between the calls of a client (default {BREATH})"
    )
    parser.add_argument("--kinds", nargs="+", choices=sorted({*chain(*faults)}), help="which (default: all of them)")
    parser.add_argument("--workers", action="store_true", help="a server of two gateways and two workers")
    parser.add_argument("--record", action="store_true", help="append the run to build/torture/COMMIT.jsonl")
    parser.add_argument("--mounted", action="store_true", help=argparse.SUPPRESS)
    return parser


def on_small_disk(file: str, size: str, work: Callable[[Path], str], *, mounted: bool) -> None:
    """Print what some work on a small disk of its own returns; unless `mounted`, by another run of the file."""
    if not mounted:
        unshare = ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--mount", "--map-root-user"]
        command = [*unshare, sys.executable, file, "--mounted", *sys.argv[1:]]
        sys.exit(subprocess.run(command, check=False).returncode)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", folder], check=True)
        try:
            print("\n" + work(Path(folder)))
        except BaseException:
            print((Path(folder) / "server.log").read_text(), file=sys.stderr)
            raise
        finally:
            subprocess.run(["umount", "--lazy", folder], check=True)
