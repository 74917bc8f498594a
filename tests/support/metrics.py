"""A server's metrics, as Prometheus would read them."""

import re
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from server_process import PATIENCE, Server, server_process


@contextmanager
def measured(*options: str, wrap: Sequence[str] = ()) -> Iterator[tuple[Server, str]]:
    """A server, and the address of its metrics."""
    with server_process("--metrics-port", "0", *options, wrap=wrap) as server:
        line = server.process.stdout.readline()
        yield server, re.fullmatch(r"metrics on http://(.*)/metrics\n", line).group(1)


def scrape(address: str) -> dict[str, float]:
    """Every sample by its name and labels."""
    samples = (line.rsplit(" ", 1) for line in fetch(f"http://{address}/metrics").splitlines() if line[0] != "#")
    return {name: float(value) for name, value in samples}


def fetch(url: str) -> str:
    with urllib.request.urlopen(url, timeout=PATIENCE) as response:
        return response.read().decode()
