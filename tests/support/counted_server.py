"""A server that counts what it holds: `python counted_server.py OPTION...`. It answers each line with the bytes.

They are those that Python's objects and the kernel have asked for, since the first line. What the allocator makes of
them, and what gRPC holds in C++, is not among them: so the count is the same on a busy machine, and on the next one.
"""

import gc
import sys
import threading
import tracemalloc

from dynhull import FenceIndex
from dynhull._base import Live
from dynhull_cli.main import main


def native() -> int:
    """The bytes of the trees and indexes."""
    gc.unfreeze()  # what the server has set aside is not among the collector's objects
    found = gc.get_objects()
    gc.freeze()
    trees = {id(each._tree): each._tree.memory[1] for each in found if isinstance(each, Live)}
    indexes = {id(each._fences): each._fences.memory for each in found if isinstance(each, FenceIndex)}
    return sum(trees.values()) + sum(indexes.values())


def answer() -> None:
    """Answer each line."""
    for _ in sys.stdin:
        if not tracemalloc.is_tracing():
            tracemalloc.start()
        gc.collect()
        sys.stdout.write(f"{native() + tracemalloc.get_traced_memory()[0]}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    threading.Thread(target=answer, daemon=True).start()
    sys.argv = ["dynhull", "serve", *sys.argv[1:]]
    main()
