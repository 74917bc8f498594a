"""Callers that never read: the memory that each takes from the server and from a gateway. `deaf.py --callers 200`.

Prints a table, and ends with exit code 1 if a caller takes more than it may.
"""

import argparse
import os
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import grpc
import numpy as np

sys.path += [str(Path(__file__).parents[2] / "support")]

from gateway_process import Events, Gateway, gateway_process
from server_process import Server, server_process

from dynhull_client import HullClient
from dynhull_proto.v1 import fence_service_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

PAGE = os.sysconf("SC_PAGE_SIZE")
# Without this a client takes in megabytes that nobody reads.
SMALL_WINDOW = [("grpc.http2.bdp_probe", 0)]
VERTICES, SUBJECTS, POINTS, STEPS = 4_096, 1_000, 200_000, 30
# What a caller may take.
MOST_BYTES = 2**19


@dataclass(frozen=True)
class Place:
    """A server, a gateway before it, and a hull and a fence of it that are called "a"."""

    server: Server
    gateway: Gateway
    client: HullClient

    def resident(self) -> tuple[int, int]:
        """The bytes of the server and of the gateway."""
        pids = self.server.process.pid, self.gateway.process.pid
        return tuple(int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE for pid in pids)


def turn_hull(place: Place) -> None:
    """Change all vertices, again and again."""
    for step in range(STEPS):
        angles = np.linspace(0, 2 * np.pi, VERTICES, endpoint=False) + step
        place.client.put("a", range(VERTICES), 1e6 * np.column_stack([np.cos(angles), np.sin(angles)]))


def pass_through(place: Place) -> None:
    """All subjects enter and leave, again and again."""
    for step in range(STEPS):
        place.client.put("subjects", range(SUBJECTS), [[9 * (step % 2), 1]] * SUBJECTS)


def nothing(_: Place) -> None:
    """Write nothing."""


Call = Callable[[Any, Any], Iterator[Any]]


@contextmanager
def calling(call: Call, place: Place) -> Iterator[None]:
    """A call of gRPC that has begun."""
    with grpc.insecure_channel(place.server.address, [*SMALL_WINDOW, ("grpc.use_local_subchannel_pool", 1)]) as channel:
        next(call(HullServiceStub(channel), FenceServiceStub(channel)))
        yield


@contextmanager
def getting(path: str, place: Place) -> Iterator[None]:
    """A request over HTTP."""
    with closing(socket.socket()) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        host, _, port = place.gateway.place.rpartition(":")
        connection.connect((host, int(port)))
        connection.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        yield


def reads(count: int) -> Iterator[pb.QueryRequest]:
    """Many reads of one stream."""
    read = pb.Read(get_hull=pb.GetHullRequest(name="a"))
    return iter([pb.QueryRequest(reads=[read] * 16)] * count)


def batches() -> Iterator[pb.StreamRequest]:
    """Many batches, whose acknowledgements nobody reads."""
    yield pb.StreamRequest(name="written")
    for row in range(20_000):
        yield pb.StreamRequest(batch={"inserts": points_pb2.Points(coordinates=[row % 7, row % 5])})


# Each kind of caller that does not read, and what happens meanwhile.
KINDS: dict[str, tuple[Callable[[Place], Any], Callable[[Place], None]]] = {
    "Watch": (partial(calling, lambda hulls, _: hulls.Watch(pb.WatchRequest(name="a"))), turn_hull),
    "WatchFence": (
        partial(calling, lambda _, fences: fences.WatchFence(fence_service_pb2.WatchFenceRequest(name="a"))),
        pass_through,
    ),
    "ReadPoints": (
        partial(calling, lambda hulls, _: hulls.ReadPoints(pb.ReadPointsRequest(name="points"))),
        nothing,
    ),
    "ReadEntities": (
        partial(calling, lambda hulls, _: hulls.ReadEntities(pb.ReadEntitiesRequest(name="a"))),
        nothing,
    ),
    "Query": (partial(calling, lambda hulls, _: hulls.Query(reads(100))), nothing),
    "Stream": (partial(calling, lambda hulls, _: hulls.Stream(batches())), nothing),
    "events of a hull": (partial(getting, "/hulls/a/events"), turn_hull),
    "events of a fence": (partial(getting, "/fences/a/events"), pass_through),
    "GET of a hull": (partial(getting, "/hulls/a"), nothing),
}


@contextmanager
def running() -> Iterator[Place]:
    """A server and a gateway that end no caller for want of reading."""
    with (
        server_process("--max-watch-lag", "3600", "--max-streams", "10000") as server,
        gateway_process(server.address, "--reader-timeout", "1h") as gateway,
        HullClient(server.address) as client,
    ):
        client.create_hull("a", keyed="int")
        client.create_hull("subjects", keyed="int")
        client.create_hull("written")
        client.create_hull("points")
        client.apply("points", insert=np.random.default_rng(1).normal(size=(POINTS, 2)))
        client.create_fence("a", area=[[0, 0], [4, 0], [4, 4], [0, 4]], subjects="subjects")
        yield Place(server, gateway, client)


def settle(place: Place) -> None:
    """Return when all that was written has gone through the gateway, to readers that do read."""
    marks = {"/hulls/a/events": ("a", [[9e9, 0]]), "/fences/a/events": ("subjects", [[1, 1]])}
    for path, (hull, at) in marks.items():
        with closing(Events(place.gateway, path)) as events:
            next(iter(events))
            place.client.put(hull, [10**9], at)
            next(iter(events))
            place.client.remove(hull, keys=[10**9])


def measured(kind: str, callers: int) -> tuple[int, int]:
    """The bytes that a caller of a kind takes from the server and from the gateway."""
    begin, happens = KINDS[kind]
    grown = []
    with running() as place:
        for number in (3, 0, callers):  # what the first of them take stays for the next ones; what is written, too
            before = place.resident()
            with ExitStack() as stack:
                for _ in range(number):
                    stack.enter_context(begin(place))
                happens(place)
                settle(place)
                grown.append(np.subtract(place.resident(), before))
    server, gateway = (grown[-1] - grown[1]) // callers
    return int(server), int(gateway)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--callers", type=int, default=200)
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    arguments = parser.parse_args()
    print("| callers that do not read | server, KiB each | gateway, KiB each |\n| --- | ---: | ---: |")
    much = []
    for kind in arguments.kinds:
        taken = measured(kind, arguments.callers)
        print(f"| {kind} | {taken[0] / 2**10:.0f} | {taken[1] / 2**10:.0f} |", flush=True)
        much += [kind] if max(taken) > MOST_BYTES else []
    if much:
        sys.exit(f"more than {MOST_BYTES / 2**10:.0f} KiB each: {', '.join(much)}")


if __name__ == "__main__":
    main()
