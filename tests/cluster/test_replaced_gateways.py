"""A gateway that is replaced answers clients that hear of it late: it has not begun their calls, which they repeat."""

import signal
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

from forked import COMMAND
from logged_process import logged_process
from pacing import pause
from patience import PATIENCE, wait_until

SERVE = (COMMAND, "serve", "--port", "0", "--log-format", "json", "--scrub-cpu", "0", "--workers", "1")
LATE = 1.5  # seconds
# Frames of HTTP/2, and what they say.
DATA, HEADERS, SETTINGS, PING = 0, 1, 4, 6
END_STREAM, END_HEADERS, ACKNOWLEDGED = 1, 4, 1
GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
CALL = {
    ":method": "POST",
    ":scheme": "http",
    ":path": "/dynhull.v1.HullService/ListHulls",
    ":authority": "test",
    "te": "trailers",
    "content-type": "application/grpc",
}


def frame(kind: int, flags: int = 0, stream: int = 0, payload: bytes = b"") -> bytes:
    return struct.pack(">I", len(payload))[1:] + struct.pack(">BBI", kind, flags, stream) + payload


def call(stream: int) -> bytes:
    """A call with an empty message; its headers are not compressed."""
    texts = (bytes([len(each)]) + each.encode() for pair in CALL.items() for each in pair)
    headers = b"".join(b"\0" + name + next(texts) for name in texts)
    return frame(HEADERS, END_HEADERS, stream, headers) + frame(DATA, END_STREAM, stream, bytes(5))


def answered(connection: socket.socket) -> Iterator[int]:
    """The numbers of the calls that the server answers, as it does so, until the connection ends."""
    file = connection.makefile("rb")
    while head := file.read(9):
        kind, flags, stream = struct.unpack(">BBI", head[3:])
        payload = file.read(int.from_bytes(head[:3], "big"))
        if kind in {SETTINGS, PING} and not flags & ACKNOWLEDGED:
            connection.sendall(frame(kind, ACKNOWLEDGED, 0, payload if kind == PING else b""))
        if kind == HEADERS and flags & END_STREAM:
            yield stream


def test_a_call_after_the_goodbye_of_a_gateway_is_answered(tmp_path: Path) -> None:
    with logged_process([*SERVE, "--data", str(tmp_path)]) as logged:
        assert logged.process.stdout is not None
        host, port = logged.process.stdout.readline().split()[-1].split(":")
        with socket.create_connection((host, int(port)), PATIENCE) as connection:
            connection.sendall(GREETING + frame(SETTINGS) + call(1))
            answers = answered(connection)
            assert next(answers) == 1
            logged.process.send_signal(signal.SIGHUP)
            wait_until(lambda: [each for each in logged.said("draining") if each["process"] == "gateway-0"])
            pause(LATE)  # it does not read
            connection.sendall(call(3))
            assert [*answers] == [3]
