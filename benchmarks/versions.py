"""Two versions of the kernel in one process, in turn: what a change of it gains or costs.

    python benchmarks/versions.py --before ca9bc8c                the kernel of 0.1.0
    python benchmarks/versions.py --without-finger --inputs uniform disk circle ordered spiral grid

Both get the same batches of a moving window, half inserts and half deletes, and single inserts; who goes first changes
from batch to batch, and both must change the hull equally often. On one thread. Medians over the batches of the ratios
of processor time, now over before, and between them half of all ratios: a busy machine slows both down.
"""

import argparse
import ctypes
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from core import INPUTS

ROOT = Path(__file__).parents[1]
KERNEL = "dynhull/kernel"
# As CMakeLists.txt builds it; what is inline in both stays apart.
FLAGS = [
    "-std=c++20",
    "-O3",
    "-DNDEBUG",
    "-ffp-contract=off",
    "-fno-fast-math",
    "-fno-trapping-math",
    "-fPIC",
    "-shared",
    "-pthread",
]
APART = ["-fno-gnu-unique", "-fvisibility-inlines-hidden"]
FORGETFUL = """
class Finger : public NoFinger {
 public:
  Finger(const Nodes&, unsigned) {}
};

}  // namespace dynhull
"""
TOGETHER = 4096  # updates that are timed as one, at least: the steps of the clock are coarse


def built(kernel: Path, folder: Path) -> ctypes.CDLL:
    library = folder / "kernel.so"
    source = str(Path(__file__).with_name("versions.cpp"))
    team = ["-DWITH_TEAM"] if "set_limit" in (kernel / "threads.hpp").read_text() else []  # others build on two at most
    command = [os.environ.get("CXX", "c++"), *FLAGS, *APART, *team, f"-I{kernel}", source, "-o", str(library)]
    subprocess.run(command, check=True)
    version = ctypes.CDLL(str(library))
    version.make.restype = ctypes.c_void_p
    version.apply.restype = version.insert.restype = ctypes.c_uint64
    return version


def before(reference: str | None, folder: Path) -> Path:
    """The kernel of a commit, or the present one without its finger."""
    kernel = folder / KERNEL
    if reference is None:
        shutil.copytree(ROOT / KERNEL, kernel)
        finger = kernel / "tree/finger.hpp"
        finger.write_text(finger.read_text().partition("class Finger")[0] + FORGETFUL)
    else:
        archive = subprocess.run(["git", "archive", reference, KERNEL], cwd=ROOT, capture_output=True, check=True)
        subprocess.run(["tar", "-x", "-C", folder], input=archive.stdout, check=True)
    return kernel


def at(array: np.ndarray, row: int = 0) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data + row * array.strides[0])


def clocked(work, *arguments: object) -> tuple[float, int]:
    began = time.thread_time()
    changes = work(*arguments)
    return time.thread_time() - began, changes


class Pair:
    """The same hull in both versions."""

    def __init__(self, versions: list[ctypes.CDLL], rows: np.ndarray) -> None:
        self._versions = versions
        self._hulls = [ctypes.c_void_p(each.make(at(rows), ctypes.c_size_t(len(rows)))) for each in versions]
        self._turns = 0

    def ratio(self, name: str, *batches: tuple[object, ...]) -> float:
        """Processor time of the first version over that of the second one, for the same batches."""
        self._turns += 1
        spent, changes = [0.0, 0.0], [0, 0]
        for which in (0, 1) if self._turns % 2 else (1, 0):
            work = getattr(self._versions[which], name)
            for batch in batches:
                seconds, changes[which] = clocked(work, self._hulls[which], *batch)
                spent[which] += seconds
        if changes[0] != changes[1]:
            sys.exit(f"the hulls changed {changes} times")
        return spent[0] / spent[1]

    def drop(self) -> None:
        for version, hull in zip(self._versions, self._hulls, strict=True):
            version.drop(hull)


def windows(versions: list[ctypes.CDLL], rows: np.ndarray, n: int, size: int, updates: int) -> list[float]:
    """Ratios of batches of a moving window."""
    half, ratios = size // 2, []
    ops = np.repeat(np.array([1, -1], np.int8), half)
    pair, done = Pair(versions, rows[:n]), 0
    for _ in range(max(9, updates // max(size, TOGETHER))):
        batches = []
        for _ in range(max(1, TOGETHER // size)):
            new, old = (np.arange(first, first + half) % len(rows) for first in (n + done, done))
            batches.append(np.concatenate([rows[new], rows[old]]))
            done += half
        count = ctypes.c_size_t(size)
        ratios.append(pair.ratio("apply", *((at(ops), at(batch), count) for batch in batches)))
    pair.drop()
    return ratios


def inserts(versions: list[ctypes.CDLL], rows: np.ndarray, n: int, updates: int) -> list[float]:
    """Ratios of single inserts."""
    pair = Pair(versions, rows[:n])
    new, count = rows[n : n + updates], ctypes.c_size_t(TOGETHER)
    firsts = range(0, len(new) - TOGETHER + 1, TOGETHER)
    ratios = [pair.ratio("insert", (at(new, first), count)) for first in firsts]
    pair.drop()
    return ratios


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--before", metavar="COMMIT", help="the version before")
    which.add_argument("--without-finger", action="store_true", help="before: the present version without finger.hpp")
    parser.add_argument("--size", type=float, default=1e6, help="points (default 1e6)")
    parser.add_argument("--inputs", nargs="+", default=["uniform", "circle"], choices=INPUTS)
    parser.add_argument("--batches", nargs="+", type=int, default=[256, 8_192, 65_536])
    parser.add_argument("--updates", type=float, default=2e6, help="updates of each row (default 2e6)")
    options = parser.parse_args()
    n, updates = int(options.size), int(options.updates)
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
        versions = [built(ROOT / KERNEL, Path(one)), built(before(options.before, Path(two)), Path(two))]
    for kind in options.inputs:
        rows = np.ascontiguousarray(INPUTS[kind](n + max(updates, 9 * options.batches[-1]), np.random.default_rng(1)))
        works = {f"batches of {size:,}": windows(versions, rows, n, size, updates) for size in options.batches}
        works["single inserts"] = inserts(versions, rows, n, updates)
        for name, ratios in works.items():
            low, middle, high = statistics.quantiles(ratios, n=4)
            print(f"{kind:8} {name:20} {middle:.3f}  {low:.3f} ... {high:.3f}", flush=True)


if __name__ == "__main__":
    main()
