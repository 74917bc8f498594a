"""The part `server` of entities.py: moves of entities in a durable keyed hull, beside the same moves in Redis.

Both servers sync each batch to the disk before they acknowledge it, and neither compacts its log meanwhile: no
snapshots, no rewrites. Both get bytes made beforehand over one connection, with at most so many batches or commands
not acknowledged. Redis gets raw RESP over a Unix socket, which costs less than any client library; commands that come
together share its sync. dynhull gets those batches in one message that there is room for, as from the SDK's writers; in
the row "one a message", each in a message of its own, as from clients that do not know messages with several. Members
of Redis are the keys in decimal. Coordinates have seven decimals, finer than the 52 bits of a geohash.
"""

import asyncio
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import durability
import numpy as np

import server
from dynhull_proto.v1 import batch_pb2, hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

NAME = "entities"
IN_FLIGHT = 8  # batches sent and not acknowledged
DECIMALS = 7
LOADED = 8192  # entities of a batch that fills the servers
MOVES = 2**19  # of a run, if these limits on its batches allow
FEWEST, MOST = 16, 4096
NO_SNAPSHOTS = 10**12  # more points than a server gets
BUFFER = 2**16

Make = Callable[[int, np.random.Generator], np.ndarray]


@dataclass(frozen=True)
class Side:
    """Starts a server on a data folder, writes the message of a batch, and sends messages: how many a second."""

    serving: Callable[[Path], AbstractContextManager[str]]
    message: Callable[[np.ndarray, np.ndarray], bytes]
    send: Callable[[str, list[bytes]], float]


@contextmanager
def redis(folder: Path, *, log: bool = True) -> Iterator[str]:
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as short:  # the system limits the path of a socket to about 100 bytes
        address = str(Path(short) / "redis.sock")
        options = ["--port", "0", "--unixsocket", address, "--dir", str(folder), "--save", ""]
        if log:
            options += ["--appendonly", "yes", "--appendfsync", "always", "--auto-aof-rewrite-percentage", "0"]
        with subprocess.Popen(["redis-server", *options], stdout=subprocess.PIPE, text=True) as process:
            try:
                printed = []
                while "ready to accept connections" not in (line := process.stdout.readline()):
                    if not line:
                        sys.exit(f"redis-server did not start:\n{''.join(printed)}")
                    printed.append(line)
                yield address
            finally:
                process.terminate()


@contextmanager
def dynhull(folder: Path) -> Iterator[str]:
    options = ["--data", str(folder), "--durability", "sync", "--snapshot-points", str(NO_SNAPSHOTS)]
    with durability.serving(*options) as address:
        with durability.service(address) as stub:
            if not stub.ListHulls(pb.ListHullsRequest()).hulls:
                config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_INTEGER_KEYS)
                stub.CreateHull(pb.CreateHullRequest(name=NAME, config=config))
        yield address


def geoadd(keys: np.ndarray, places: np.ndarray) -> bytes:
    words = [b"GEOADD", NAME.encode()]
    for key, (x, y) in zip(keys.tolist(), places.tolist(), strict=True):
        words += [b"%.*f" % (DECIMALS, x), b"%.*f" % (DECIMALS, y), b"%d" % key]
    return b"*%d\r\n" % len(words) + b"".join(b"$%d\r\n%b\r\n" % (len(word), word) for word in words)


def puts(keys: np.ndarray, places: np.ndarray) -> bytes:
    packed = {"packed_integers": keys.astype("<u8").tobytes()}
    batch = batch_pb2.Batch(puts=batch_pb2.Puts(keys=packed, points=server.packed(places)))
    return pb.StreamRequest(batches=[pb.NumberedBatch(batch=batch)]).SerializeToString()


def single(keys: np.ndarray, places: np.ndarray) -> bytes:
    numbered = pb.StreamRequest.FromString(puts(keys, places)).batches[0]
    return pb.StreamRequest(name=NAME, batch=numbered.batch).SerializeToString()


def pipeline(address: str, commands: list[bytes], in_flight: int = IN_FLIGHT) -> float:
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        begun = time.perf_counter()
        sent = answered = 0
        while answered < len(commands):
            end = min(answered + in_flight, len(commands))
            if sent < end:
                connection.sendall(b"".join(commands[sent:end]))
                sent = end
            replies = connection.recv(BUFFER)
            if not replies or b"-" in replies:
                sys.exit(f"Redis failed: {replies!r}")
            answered += replies.count(b"\n")
        return len(commands) / (time.perf_counter() - begun)


def together(address: str, batches: list[bytes]) -> float:
    return asyncio.run(server.together(address, NAME, batches, IN_FLIGHT))


def one_by_one(address: str, requests: list[bytes]) -> float:
    return asyncio.run(server.stream(address, requests, len(requests), IN_FLIGHT))


SIDES = {
    "Redis": Side(redis, geoadd, pipeline),
    "dynhull": Side(dynhull, puts, together),
    "dynhull, one a message": Side(dynhull, single, one_by_one),
}


def require_redis() -> None:
    if shutil.which("redis-server") is None:
        sys.exit(
            "The part `server` needs redis-server 7: on Debian and Ubuntu `apt-get install redis-server`. "
            "To leave the part out, name the others: --works moves names memory reference"
        )


def load(folder: Path, n: int, make: Make, random: np.random.Generator) -> None:
    keys, places = np.arange(n), np.round(make(n, random), DECIMALS)
    for who, side in SIDES.items():
        progress(f"{who} gets {n:,} entities")
        with side.serving(folder / who) as address:
            firsts = range(0, n, LOADED)
            side.send(address, [side.message(keys[i : i + LOADED], places[i : i + LOADED]) for i in firsts])


def run(folder: Path, kind: str, n: int, size: int, make: Make, random: np.random.Generator, repeat: int) -> None:
    """Print a row of each server; runs in turn."""
    count = min(max(MOVES // size, FEWEST), MOST)
    before = {who: durability.used(folder / who) for who in SIDES}
    rates: dict[str, list[float]] = {who: [] for who in SIDES}
    with ExitStack() as stack:
        addresses = {who: stack.enter_context(side.serving(folder / who)) for who, side in SIDES.items()}
        for repetition in range(repeat):
            keys = [random.choice(n, size, replace=False) for _ in range(count)]
            batches = [(each, np.round(make(size, random), DECIMALS)) for each in keys]
            for who, side in SIDES.items():
                progress(f"{who}, run {repetition + 1} of {repeat}: {count:,} batches of {size:,} moves")
                messages = [side.message(*batch) for batch in batches]
                rates[who].append(side.send(addresses[who], messages) * size)
    for who, values in rates.items():
        figures = " | ".join(f"{f(values):,.0f}" for f in (statistics.median, min, max))
        ratio = statistics.median(a / b for a, b in zip(values, rates["Redis"], strict=True))
        growth = (durability.used(folder / who) - before[who]) / (repeat * count * size)
        print(f"| {kind} | {n:,} | {size:,} | {who} | {figures} | {ratio:.2f} | {growth:.1f} |", flush=True)


def progress(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def warn_if_busy() -> None:
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    if load > cores / 2:
        progress(
            f"Warning: the load average is {load:.1f} on {cores} cores. Redis works in one thread and dynhull in "
            "several, so a busy machine slows Redis down more. Compare the two on an idle machine."
        )


def measure(folder: Path, inputs: dict[str, Make], sizes: list[int], batches: list[int], repeat: int) -> None:
    warn_if_busy()
    version = subprocess.run(["redis-server", "--version"], check=True, capture_output=True, text=True).stdout
    print(
        f"\nserver: {version.split(' sha')[0]}; {repeat} runs of each in turn, load average {os.getloadavg()[0]:.1f}\n"
    )
    print("| input | n | batch | who | moves a second, median | least | greatest | of Redis | bytes on disk a move |")
    print("| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: |")
    for kind, make in inputs.items():
        for n in sizes:
            with tempfile.TemporaryDirectory(dir=folder) as data:
                random = np.random.default_rng(0)
                load(Path(data), n, make, random)
                for size in batches:
                    run(Path(data), kind, n, size, make, random, repeat)
    print(f"\nload average at the end: {os.getloadavg()[0]:.1f}")
