"""Keys that expire together in a durable server: `python benchmarks/expiries.py [--keys 1e3 1e4 1e5 1e6]`.

All keys of a hull have one deadline, without a fence and with one that a fifth of them are inside of, while another
process writes to a hull of its own, one write after the other, from before that moment. Columns: keys, seconds from the
deadline until the hull is empty, processor time of the server from then until it rests again, and the writes of the
other from the deadline on: their latency, median and longest. The last row of each pair has the ratios.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import durability
import grpc
import numpy as np
from served_fences import LOADED, NAME, OTHER, at_rest, children, polygon, started
from served_fences import __file__ as served_fences

import server
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import fence_service_pb2 as fences
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub

MARGIN = 5  # seconds from the last put to the deadline
WARM_UP = 1  # seconds of the other's writes before it


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keys", type=float, nargs="+", default=[1e3, 1e4, 1e5, 1e6])
    parser.add_argument("--rate", type=float, default=5e4, help="puts a second that the machine takes for sure")
    parser.add_argument("--folder", type=Path, default=Path(), help="where the servers put their data (default: here)")
    arguments = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}\n")
    print("| keys | fence | seconds | CPU | other writes: median | longest |")
    print("| ---: | --- | ---: | ---: | ---: | ---: |")
    for keys in map(int, arguments.keys):
        pair = []
        for fenced in (False, True):
            with tempfile.TemporaryDirectory(dir=arguments.folder) as data:
                pair.append(expired(Path(data), keys, arguments.rate, fenced=fenced))
            seconds, cpu, median, longest = pair[-1]
            shown = f"{seconds:.2f} | {cpu:.2f} | {median * 1e3:.1f} ms | {longest * 1e3:.1f} ms"
            print(f"| {keys:,} | {'yes' if fenced else 'no'} | {shown} |", flush=True)
        ratios = " | ".join(f"{fenced / bare:.2f}" for bare, fenced in zip(*pair, strict=True))
        print(f"| {keys:,} | ratio | {ratios} |", flush=True)
    print(f"\nload average at the end {os.getloadavg()[0]:.1f}")


def expired(folder: Path, n: int, rate: float, *, fenced: bool) -> tuple[float, float, float, float]:
    places = np.random.default_rng(3).random((n, 2))
    with ExitStack() as stack:
        address = started(stack, folder)
        (pid, _), *_ = children()
        stub, channel = stack.enter_context(durability.service(address)), grpc.insecure_channel(address)
        fence_stub = FenceServiceStub(stack.enter_context(channel))
        config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_INTEGER_KEYS)
        stub.CreateHull(pb.CreateHullRequest(name=OTHER, config=config))
        if fenced:
            area = polygon(np.array([[0, 0], [0.2, 0], [0.2, 1], [0, 1]]))
            fence_stub.CreateFence(fences.CreateFenceRequest(name="around", config=area))
        deadline = time.time() + MARGIN + n / rate
        for first in range(0, n, LOADED):
            stub.Apply(pb.ApplyRequest(name=NAME, batch=leaving(first, places[first : first + LOADED], deadline)))
        if time.time() > deadline - MARGIN / 2:
            raise TimeoutError("the puts have taken too long: give a lower --rate")
        time.sleep(deadline - WARM_UP - time.time())
        command = [sys.executable, served_fences, "--write-to", address]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
            assert other.stdout is not None
            other.stdout.readline()
            time.sleep(max(deadline - time.time(), 0))
            cpu = server_seconds(pid)
            while stub.GetHull(pb.GetHullRequest(name=NAME)).hull.point_count:
                time.sleep(0.01)
            took = time.time() - deadline
            times = sorted(map(float, other.communicate("")[0].split()))
        while not at_rest():
            pass
        return took, server_seconds(pid) - cpu, statistics.median(times), times[-1]


def leaving(first: int, places: np.ndarray, deadline: float) -> batch_pb2.Batch:
    """Puts of keys from `first` on, which expire at the deadline."""
    packed = {"packed_integers": np.arange(first, first + len(places)).astype("<u8").tobytes()}
    ends = np.full(len(places), int(deadline * 1e6), "<i8").tobytes()
    times = points_pb2.Times(packed=ends)
    return batch_pb2.Batch(puts=batch_pb2.Puts(keys=packed, points=server.packed(places), expire_times=times))


def server_seconds(pid: int) -> float:
    """The processor time of the server so far."""
    fields = dict(children())[pid]
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
