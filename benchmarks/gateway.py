"""What the gateway costs: `python benchmarks/gateway.py`. Needs h2load (Debian's nghttp2-client).

One-point POSTs on 64 connections, changes and locates, beside an empty handler of the same framework, in turns; a body
of newline-delimited JSON; and 500 streams of events on one hull that changes ten times a second. Server, gateway and
callers share this machine.
"""

import argparse
import asyncio
import http.client
import json
import re
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from statistics import median, quantiles

import numpy as np
import uvicorn
from fastapi import FastAPI, Response

from dynhull_client import AsyncHullClient, HullClient

COMMAND = [sys.executable, "-m", "dynhull_cli"]
CONNECTIONS = 64
RING = 48

empty = FastAPI(openapi_url=None)


@empty.post("/")
async def nothing() -> Response:
    return Response(b"{}", media_type="application/json")


@contextmanager
def running(*command):
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1].removeprefix("http://")
        finally:
            process.terminate()


def h2load(url, requests, posted):
    """Answers a second, all of which must be 2xx."""
    with tempfile.NamedTemporaryFile("w") as body:
        body.write(posted)
        body.flush()
        command = ["h2load", "--h1", "-n", str(requests), "-c", str(CONNECTIONS), "-d", body.name, url]
        done = subprocess.run(
            [*command, "-H", "content-type: application/json"], capture_output=True, text=True, check=True
        ).stdout
    assert f"{requests} 2xx" in done, done
    return float(re.search(r"([\d.]+) req/s", done)[1])


def posts(place, requests, turns):
    works = {"points": "[[1.5, 2.5]]", "locate": '{"points": [[1.5, 2.5]]}'}
    with running(sys.executable, __file__, "--serve-empty") as beside:
        for work, posted in works.items():
            urls = f"http://{place}/hulls/posts/{work}", f"http://{beside}/"
            pairs = [[h2load(url, requests, posted) for url in urls] for _ in range(turns)]
            ours, theirs = (median(each) for each in zip(*pairs, strict=True))
            share = median(a / b for a, b in pairs)
            print(
                f"one-point POSTs, {work}, {CONNECTIONS} connections: {ours:,.0f}/s; "
                f"empty handler {theirs:,.0f}/s; share {share:.2f}"
            )


def upload(place, points, name, kind):
    xy = np.random.default_rng(1).normal(size=(points, 2)).round(6).tolist()
    rows = xy if kind == "[x, y]" else [{"key": f"k{i}", "x": x, "y": y} for i, (x, y) in enumerate(xy)]
    body = b"".join(json.dumps(row).encode() + b"\n" for row in rows)
    connection = http.client.HTTPConnection(place)
    begun = time.perf_counter()
    connection.request("POST", f"/hulls/{name}/rows", body, {"Content-Type": "application/x-ndjson"})
    answer = json.loads(connection.getresponse().read())
    seconds = time.perf_counter() - begun
    assert answer["rows"] == points, answer
    print(f"NDJSON of {kind}: {points / seconds:,.0f} points/s ({len(body) / 1e6:.0f} MB)")


async def follow(place, sent, delays, ready):
    """Read a stream of events, and note how long after the batch each one came."""
    host, port = place.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(f"GET /hulls/ring/events?rate=100 HTTP/1.1\r\nHost: {place}\r\n\r\n".encode())
    seen = False
    while line := await reader.readline():
        if line.startswith(b"id: "):
            revision = int(line.rpartition(b":")[2])
            if revision in sent:
                delays.append(time.perf_counter() - sent[revision])
            if not seen:
                seen = True
                ready.release()


async def events(address, place, streams, seconds):
    delays, sent = [], {}
    ready = asyncio.Semaphore(0)
    async with AsyncHullClient(address) as client:
        await client.create_hull("ring", exist_ok=True)
        angles = np.linspace(0, 2 * np.pi, RING, endpoint=False)
        ring = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        applied = await client.apply("ring", insert=ring)
        readers = [asyncio.create_task(follow(place, sent, delays, ready)) for _ in range(streams)]
        for _ in readers:
            await ready.acquire()
        for turn in range(seconds * 10):
            due = time.perf_counter() + 0.1
            row = turn % RING
            moved = ring[[row]] * (1 + 0.01 * (turn % 7))
            sent[applied.revision + 1] = time.perf_counter()
            applied = await client.apply("ring", move=(ring[[row]], moved))
            ring[row] = moved[0]
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
        await asyncio.sleep(1)
        for each in readers:
            each.cancel()
        await asyncio.gather(*readers, return_exceptions=True)
    cuts = quantiles(delays, n=100)
    share = len(delays) / (streams * seconds * 10)
    print(
        f"events, {streams} streams at 10 Hz: p50 {cuts[49] * 1000:.0f} ms, p99 {cuts[98] * 1000:.0f} ms; "
        f"{share:.1%} of the changes as an event of their own"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=20_000)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--streams", type=int, default=500)
    parser.add_argument("--seconds", type=int, default=10)
    parser.add_argument("--data", help="folder of the server; in memory without")
    parser.add_argument("--serve-empty", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve_empty:
        server = uvicorn.Server(uvicorn.Config(empty, port=0, log_config=None, access_log=False, lifespan="off"))
        listening = server.config.bind_socket()
        print(f"http://127.0.0.1:{listening.getsockname()[1]}", flush=True)
        server.run([listening])
        return
    kept = ["--data", given.data] if given.data else ["--in-memory"]
    serve = [*COMMAND, "serve", "--port", "0", "--log-level", "warning", *kept]
    with running(*serve) as address, running(*COMMAND, "gateway", "--port", "0", "--address", address) as place:
        with HullClient(address) as client:
            for name, keyed in (("posts", None), ("rows", None), ("keys", "str")):
                client.create_hull(name, keyed=keyed)
        if given.requests:
            posts(place, given.requests, given.turns)
        if given.points:
            upload(place, given.points, "rows", "[x, y]")
            upload(place, given.points // 4, "keys", "keys, x and y")
        if given.streams:
            asyncio.run(events(address, place, given.streams, given.seconds))


if __name__ == "__main__":
    main()
