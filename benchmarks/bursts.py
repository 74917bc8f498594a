"""What a burst of one caller costs others: `python benchmarks/bursts.py [--calls 5000]`.

One caller begins many reads at once, in a process of its own, while another reads one at a time; one without a token
begins 100,000 calls and resets each; and a gateway gets 2,500 GETs at once. Two processes that only count, as many as
a burst keeps busy, show what the machine alone makes of the other caller's delays. Whatever is not answered is counted
by its error. The server and the callers share this machine, and have the default settings.
"""

import argparse
import asyncio
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from statistics import quantiles

import grpc

from dynhull_client import AsyncHullClient, DynhullError, HullClient

COMMAND = [sys.executable, "-m", "dynhull_cli"]
GET_HULL = "/dynhull.v1.HullService/GetHull"
NAME = "hull"


@contextmanager
def running(*arguments):
    with subprocess.Popen([*COMMAND, *arguments, "--port", "0"], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1].removeprefix("http://")
        finally:
            process.terminate()


def burst(address, token, calls):
    """The seconds that many reads at once take, and how many ended in which way."""

    async def one(client):
        try:
            await client.get_hull(NAME)
        except DynhullError as error:
            return f"{type(error).__name__} {error.reason}: {error}"
        return "answered"

    async def all_at_once():
        async with AsyncHullClient(address, token=token) as client:
            begun = time.perf_counter()
            ends = Counter(await asyncio.gather(*(one(client) for _ in range(calls))))
            return time.perf_counter() - begun, dict(ends)

    return asyncio.run(all_at_once())


def resets(address, _token, calls):
    """The seconds that it takes to begin and reset this number of calls."""
    begun = time.perf_counter()
    with grpc.insecure_channel(address) as channel:
        method = channel.unary_unary(GET_HULL)
        for _ in range(calls):
            method.future(b"").cancel()
    return time.perf_counter() - begun, {"reset": calls}


def counting(_address, _token, rounds):
    """The seconds that two processes take to count, which ask nobody anything."""
    program = f"for _ in range({rounds}): pass"
    begun = time.perf_counter()
    with subprocess.Popen([sys.executable, "-c", program]):
        exec(program)
    return time.perf_counter() - begun, {"counted": 2 * rounds}


def reads(client, enough):
    """The milliseconds of each of at least a hundred reads, one after the other, and how many failed."""
    times, failed = [], Counter()
    while len(times) < 100 or not enough():
        begun = time.perf_counter()
        try:
            client.get_hull(NAME)
        except DynhullError as error:
            failed[str(error)] += 1
        times.append(1000 * (time.perf_counter() - begun))
    return times, dict(failed)


def beside(pool, what, client, address, token, calls):
    """Another caller's reads, alone and beside `what`."""
    alone, _ = reads(client, lambda: True)
    doing = pool.submit(what, address, token, calls)
    times, failed = reads(client, doing.done)
    seconds, ends = doing.result()
    p99, p99_alone = (quantiles(each, n=100)[98] for each in (times, alone))
    print(f"{what.__name__} {calls}: {seconds:.1f} s, {ends}")
    print(f"  another caller: {len(times)} reads, failed {failed or 0}; p99 {p99:.1f} ms, alone {p99_alone:.1f} ms")


async def gets(place, calls):
    """How many GETs at once ended in which way."""
    host, port = place.rsplit(":", 1)

    async def one():
        try:
            reader, writer = await asyncio.open_connection(host, int(port))
            writer.write(f"GET /hulls/{NAME} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
            answer = await reader.read()
            writer.close()
        except OSError as error:
            return type(error).__name__
        return answer.split(b" ", 2)[1].decode()

    begun = time.perf_counter()
    ends = Counter(await asyncio.gather(*(one() for _ in range(calls))))
    print(f"gateway, {calls} GETs: {time.perf_counter() - begun:.1f} s, {dict(ends)}")


def token(name):
    """A new token, and its entry for the file of tokens."""
    made = subprocess.run(
        [*COMMAND, "token", "--name", name, "--read", "", "--write", ""], capture_output=True, text=True, check=True
    )
    return made.stderr.split()[-1], made.stdout


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=5000)
    parser.add_argument("--resets", type=int, default=100_000)
    parser.add_argument("--counts", type=int, default=60_000_000)
    parser.add_argument("--gets", type=int, default=2500)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(1, get_context("spawn")) as pool:
        (one, first), (other, second) = token("one"), token("other")
        tokens = Path(folder, "tokens.toml")
        tokens.write_text(first + second)
        with (
            running("serve", "--data", f"{folder}/data", "--log-level", "error", "--tokens", str(tokens)) as address,
            HullClient(address, token=other, retries=0) as client,
        ):
            client.create_hull(NAME)
            client.apply(NAME, insert=[[0, 0], [1, 0], [0, 1]])
            beside(pool, counting, client, address, None, options.counts)
            beside(pool, burst, client, address, one, options.calls)
            beside(pool, resets, client, address, None, options.resets)
            with running("gateway", "--address", address, "--token", other) as place:
                asyncio.run(gets(place, options.gets))


if __name__ == "__main__":
    main()
