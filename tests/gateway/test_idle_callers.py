"""Callers that do not go on: half requests, and readers that do not read, end and are counted; others do not notice."""

import json
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from urllib.parse import urlsplit

import numpy as np
from cases import slow
from gateway_process import Events, Gateway, gateway_process
from metrics import scrape
from patience import PATIENCE, wait_until
from ports import free_port

from dynhull_client import HullClient

CALLERS = 30
LATE, DEAF = "dynhull_gateway_late_requests_total", "dynhull_gateway_deaf_readers_total"
WAITING = "dynhull_gateway_waiting_bytes"


@contextmanager
def strict(address: str, *options: str) -> Iterator[tuple[Gateway, str]]:
    """A gateway, and the address of its metrics."""
    port = str(free_port())
    with gateway_process(address, *options, "--metrics-port", port) as gateway:
        yield gateway, f"127.0.0.1:{port}"


def connect(gateway: Gateway, request: bytes = b"") -> socket.socket:
    """A connection of a caller that sends this at once."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    connection.settimeout(PATIENCE)
    place = urlsplit(gateway.url)
    connection.connect((place.hostname, place.port))
    connection.sendall(request)
    return connection


def rest(connection: socket.socket) -> bytes:
    """What arrives until the connection ends."""
    return b"".join(iter(lambda: connection.recv(65536), b""))


def test_half_requests_end(address: str) -> None:
    begins = b"GET / HTTP/1.1\r\nHost: local"
    whole = b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with strict(address, "--head-timeout", "2s") as (gateway, metrics), ExitStack() as stack:
        half, silent, second = (
            [stack.enter_context(closing(connect(gateway, sent))) for _ in range(CALLERS)]
            for sent in (begins, b"", whole + begins)
        )
        for connection in half:
            head, _, body = rest(connection).partition(b"\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 408 ")
            assert b"connection: close" in head
            assert json.loads(body)["reason"] == "HEAD_TOO_SLOW"
        assert [rest(connection) for connection in silent] == [b""] * CALLERS
        for connection in second:
            assert rest(connection).startswith(b"HTTP/1.1 ")
        assert scrape(metrics)[LATE] == 3 * CALLERS


@slow
def test_readers_that_do_not_read_end(address: str, name: str) -> None:
    """Those of events, and those of plain answers; another reader gets everything."""
    stream = f"/hulls/{name}/events"
    with (
        HullClient(address) as client,
        strict(address, "--reader-timeout", "2s") as (gateway, metrics),
        ExitStack() as stack,
    ):
        client.create_hull(name)
        client.apply(name, insert=[[i, i * i] for i in range(300_000)])  # 6 MB as JSON: more than sockets hold
        deaf = [stream] * 5 + [f"/hulls/{name}"]
        for path in deaf:
            request = f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
            stack.enter_context(closing(connect(gateway, request)))
        other = stack.enter_context(closing(Events(gateway, stream)))
        assert len(other.next()[1]["vertices"]) == 300_000
        wait_until(lambda: scrape(metrics)[DEAF] >= len(deaf))
        client.apply(name, insert=[[0, 1]])
        assert other.next()[1]["revision"] == 2
        figures = scrape(metrics)
        assert (figures[DEAF], figures["dynhull_gateway_streams"]) == (len(deaf), 1)


def test_what_waits_for_a_reader_is_counted(address: str, name: str) -> None:
    with HullClient(address) as client, strict(address, "--reader-timeout", "1h") as (gateway, metrics):
        client.create_hull(name)
        x = np.arange(300_000.0)
        client.apply(name, insert=np.column_stack([x, x * x]))
        request = f"GET /hulls/{name}/events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
        with closing(connect(gateway, request)):
            wait_until(lambda: scrape(metrics)[WAITING] > 0)
        wait_until(lambda: scrape(metrics)[WAITING] == 0)
