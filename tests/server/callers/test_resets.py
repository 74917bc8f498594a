"""Calls that one connection begins and resets, as fast as it can, cost others nothing."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from server_process import server_process

from dynhull_client import HullClient

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
HEADERS, RST_STREAM, SETTINGS = 1, 3, 4
ACK, END_STREAM, END_HEADERS = 1, 1, 4
MAX_CONCURRENT_STREAMS, CANCEL = 3, 8
# More than twice as many calls as may wait on a server to be begun.
RESETS = 120_000


def frame(kind: int, flags: int, stream: int, payload: bytes = b"") -> bytes:
    """A frame of HTTP/2."""
    return len(payload).to_bytes(3) + bytes([kind, flags]) + stream.to_bytes(4) + payload


def text(value: bytes) -> bytes:
    """A string of HPACK."""
    return bytes([len(value)]) + value


# POST over http, by their numbers in HPACK's table, as those of the other names.
CALL = b"".join(
    (
        b"\x83\x86",
        b"\x04" + text(b"/dynhull.v1.HullService/GetHull"),
        b"\x01" + text(b"localhost"),
        b"\x00" + text(b"te") + text(b"trailers"),
        b"\x0f\x10" + text(b"application/grpc"),
    )
)


@contextmanager
def http2(address: str) -> Iterator[tuple[socket.socket, dict[int, int]]]:
    """A connection, and what the server has set on it."""
    host, _, port = address.rpartition(":")
    with socket.create_connection((host, int(port))) as connection, connection.makefile("rb") as received:
        connection.sendall(PREFACE + frame(SETTINGS, 0, 0))
        length = int.from_bytes(received.read(9)[:3])
        payload = received.read(length)
        connection.sendall(frame(SETTINGS, ACK, 0))
        entries = (payload[i : i + 6] for i in range(0, length, 6))
        yield connection, {int.from_bytes(each[:2]): int.from_bytes(each[2:]) for each in entries}


def test_a_connection_has_room_for_all_streams_and_some_calls() -> None:
    with server_process("--max-streams", "7") as server, http2(server.address) as (_, settings):
        assert settings[MAX_CONCURRENT_STREAMS] == 7 + 2_500


def test_calls_that_one_connection_resets_let_others_pass() -> None:
    """As many of one connection wait here as it may have; beyond that gRPC refuses those of that connection alone."""
    begun_and_reset = b"".join(
        frame(HEADERS, END_HEADERS | END_STREAM, stream, CALL) + frame(RST_STREAM, 0, stream, CANCEL.to_bytes(4))
        for stream in range(1, 2 * RESETS, 2)
    )
    with (
        server_process("--max-streams", "100") as server,
        HullClient(server.address, retries=0) as client,
        http2(server.address) as (connection, _),
    ):
        client.create_hull("a")
        connection.sendall(begun_and_reset)
        for _ in range(100):
            client.get_hull("a")
