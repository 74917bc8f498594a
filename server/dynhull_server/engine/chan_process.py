"""Chan's algorithm in a process of its own, at low priority: points on standard input, the hull on standard output.

A large hull would block the interpreter of the server for seconds.
"""

import json
import os
import sys
import time
from dataclasses import asdict

import numpy as np

from dynhull.static import chan
from dynhull.static.trace import Round, Rounds

LOW_PRIORITY = 10


def main() -> None:
    """Read packed points until the end of input, and write one JSON object."""
    os.nice(LOW_PRIORITY)
    points = np.frombuffer(sys.stdin.buffer.read(), np.float64).reshape(-1, 2)
    trace = Rounds()
    vertices = chan(points, trace=trace)
    rounds = [asdict(event) for event in trace if isinstance(event, Round)]
    json.dump({"vertices": vertices.tolist(), "rounds": rounds, "seconds": time.process_time()}, sys.stdout)


if __name__ == "__main__":
    main()
