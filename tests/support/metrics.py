"""A server's metrics, as Prometheus would read them."""

import re
import urllib.request
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from server_process import PATIENCE, Server, server_process

PROCESS = re.compile(r',?process="([^"]*)"')


@contextmanager
def measured(*options: str, wrap: Sequence[str] = (), complaints: str = "") -> Iterator[tuple[Server, str]]:
    """A server, and the address of its metrics."""
    with server_process("--metrics-port", "0", *options, wrap=wrap, complaints=complaints) as server:
        line = server.process.stdout.readline()
        yield server, re.fullmatch(r"metrics on http://(.*)/metrics\n", line).group(1)


def samples(address: str) -> dict[str, float]:
    """Every sample by its name and labels."""
    found = (line.rsplit(" ", 1) for line in fetch(f"http://{address}/metrics").splitlines() if line[0] != "#")
    return {name: float(value) for name, value in found}


def scrape(address: str) -> dict[str, float]:
    """Every sample by its name and labels: the sum of several processes, for calls and watches that of gateways."""
    summed: defaultdict[str, float] = defaultdict(float)
    for name, value in samples(address).items():
        process = PROCESS.search(name)
        if process is None or not (
            name.startswith(("dynhull_call", "dynhull_watch")) and process[1].startswith("worker-")
        ):
            summed[PROCESS.sub("", name).replace("{,", "{").replace("{}", "")] += value
    return dict(summed)


def fetch(url: str) -> str:
    with urllib.request.urlopen(url, timeout=PATIENCE) as response:
        return response.read().decode()
