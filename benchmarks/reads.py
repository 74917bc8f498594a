"""Reads: many in a message, one a call, and none at all: `python benchmarks/reads.py`.

One process of server and one of clients, on the same cores; medians of rounds. The hull has 10,000 points, a read is a
Locate of one point. `h2load` (Debian's nghttp2-client) makes unary calls where it is installed, over 8 connections: to
this server and, in turn, to one whose handlers do nothing. The shares are the medians of those of the rounds, of the
rate and of the processor time of a call, which other work on the machine changes less.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import grpc
import numpy as np

from dynhull import DynamicHull
from dynhull_client import HullClient, HullCopy
from dynhull_proto.v1 import hull_service_pb2 as pb
from server import DYNHULL, EMPTY, SERVICE, serving

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from processor import processor_time

READS_A_MESSAGE = 64
RANDOM = np.random.default_rng(19)
POINTS = RANDOM.normal(size=(10_000, 2))
OURS, EMPTIES = "h2load: Locate", "h2load: an empty handler"
ONE = RANDOM.normal(size=(1, 2))


def query(address, read, messages):
    """Reads a second in one Query call; the messages are made beforehand, and the answers counted by their bytes."""
    message = pb.QueryRequest(reads=[read] * READS_A_MESSAGE).SerializeToString()
    with grpc.insecure_channel(address) as channel:
        call = channel.stream_stream(SERVICE + "Query")
        begun = time.perf_counter()
        received = sum(len(response) for response in call(iter([message] * messages)))
        seconds = time.perf_counter() - begun
        (answer,) = call(iter([message]))
    assert received == messages * len(answer)
    return messages * READS_A_MESSAGE / seconds


def pipeline(client, reads):
    """Reads a second by the SDK, with a future each."""
    with client.pipeline(batch_reads=READS_A_MESSAGE) as pipe:
        begun = time.perf_counter()
        futures = [pipe.locate("a", ONE) for _ in range(reads)]
        pipe.flush()
        seconds = time.perf_counter() - begun
        assert all(future.result().revision == 1 for future in futures)
    return reads / seconds


def unary(client, reads):
    begun = time.perf_counter()
    for _ in range(reads):
        client.locate("a", ONE)
    return reads / (time.perf_counter() - begun)


def h2load(address, requests, connections=8):
    """Unary calls a second, 128 at a time: over 8 connections with 16 streams each, or over more with fewer."""
    message = pb.LocateRequest(name="a", points={"packed": ONE.tobytes()}).SerializeToString()
    with tempfile.NamedTemporaryFile() as body:
        body.write(b"\0" + len(message).to_bytes(4, "big") + message)
        body.flush()
        command = ["h2load", "-n", str(requests), "-c", str(connections), "-m", str(128 // connections)]
        command += ["-t", "1", "-d", body.name]
        headers = ["-H", "content-type: application/grpc", "-H", "te: trailers"]
        url = f"http://{address}{SERVICE}Locate"
        done = subprocess.run([*command, *headers, url], capture_output=True, text=True, check=True)
    assert f"{requests} succeeded" in done.stdout, done.stdout
    return float(re.search(r"([\d.]+) req/s", done.stdout)[1])


def spending(times, pid, work, number):
    """The result of some work that makes `number` calls; the processor time of one is added to `times`."""
    before = processor_time(pid)
    result = work()
    times.append((processor_time(pid) - before) / number)
    return result


def shares(values, of):
    return [a / b for a, b in zip(values, of, strict=True)]


def nanoseconds(function, argument, times):
    begun = time.perf_counter()
    for _ in range(times):
        function(argument)
    return (time.perf_counter() - begun) / times * 1e9


def copies(client):
    """Nanoseconds a point of a copy and of the library: one point a question, as a list, and 200,000."""
    copy, library = HullCopy(max_staleness=600), DynamicHull(client.get_hull("a").vertices)
    with client.watch("a", copy=copy, outline=True) as watch:
        next(watch)
    many, one = RANDOM.normal(size=(200_000, 2)), ONE.tolist()
    assert (copy.locate(many) == library.locate(many)).all()
    for name, hull in (("copy", copy), ("library", library)):
        yield f"HullCopy: {name}, one point", [nanoseconds(hull.locate, one, 20_000) for _ in range(5)]
        yield f"HullCopy: {name}, 200,000 points, each", [nanoseconds(hull.locate, many, 3) / 2e5 for _ in range(5)]


def rounds(repeat, scale):
    points = {"packed": ONE.tobytes()}
    kinds = {
        "Locate": pb.Read(locate=pb.LocateRequest(name="a", points=points)),
        "Support": pb.Read(support=pb.SupportRequest(name="a", directions=points)),
        "GetHull, counts alone": pb.Read(get_hull=pb.GetHullRequest(name="a", view=pb.HULL_VIEW_BASIC)),
    }
    with (
        serving(DYNHULL) as (address, pid),
        serving(EMPTY) as (empty, empty_pid),
        HullClient(address) as client,
    ):
        client.create_hull("a")
        client.apply("a", insert=POINTS)
        works = {
            f"Query, {READS_A_MESSAGE} a message: {kind}": lambda read=read: query(address, read, scale // 64)
            for kind, read in kinds.items()
        }
        works["SDK: pipeline"] = lambda: pipeline(client, scale)
        works["SDK: one call a read"] = lambda: unary(client, scale // 20)
        spent = {OURS: [], EMPTIES: []}
        if shutil.which("h2load"):
            works[OURS] = lambda: spending(spent[OURS], pid, lambda: h2load(address, scale // 5), scale // 5)
            works[EMPTIES] = lambda: spending(spent[EMPTIES], empty_pid, lambda: h2load(empty, scale // 5), scale // 5)
        for work in works.values():
            work()
        found = {name: [] for name in works}
        for _ in range(repeat):
            for name, work in works.items():
                found[name].append(work())
        yield from ((name, values, "/s") for name, values in found.items())
        if OURS in found:
            yield "share of the rate of an empty handler", shares(found[OURS], found[EMPTIES]), ""
            yield "an empty handler's processor time, of ours", shares(spent[EMPTIES], spent[OURS])[1:], ""
        yield from ((name, values, "ns") for name, values in copies(client))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--reads", type=int, default=50_000, help="of each kind in a round")
    arguments = parser.parse_args()
    for name, values, unit in rounds(arguments.repeat, arguments.reads):
        digits = 1 if unit else 3
        print(
            f"{name:45}{median(values):12,.{digits}f} {unit}   ({min(values):,.{digits}f} to {max(values):,.{digits}f})"
        )


if __name__ == "__main__":
    main()
