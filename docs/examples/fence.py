"""Says when Denver comes within the fence around the fleet, and when it is out again."""

import argparse

from dynhull_client import HullClient, HullCopy

DENVER = (-825.5, 29.3)  # its airport: kilometres east and north of 95° W, 40° N

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--address", default="127.0.0.1:50051")
parser.add_argument("--events", type=int, help="end after so many changes")
options = parser.parse_args()

with HullClient(options.address) as client:
    fence = HullCopy()
    was_inside = False
    for count, _ in enumerate(client.watch("fleet", copy=fence), start=1):
        located = client.locate("fleet", [DENVER], min_revision=fence.revision)
        inside = located.sides[0] >= 0
        if inside != was_inside:
            print(f"revision {located.revision}: Denver is {'inside' if inside else 'outside'}", flush=True)
        was_inside = inside
        if count == options.events:
            break
print(f"the fence has {len(fence.vertices)} corners at revision {fence.revision}")
