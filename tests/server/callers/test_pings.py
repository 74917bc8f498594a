"""Pings that clients send on idle connections: the server answers them, and ends connections that flood it."""

import socket
import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest
from pacing import pause
from patience import PATIENCE
from server_process import server_process

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
SETTINGS, PING, GOAWAY = 4, 6, 7  # types of frames (RFC 9113)
ACK = 1  # flag
ENHANCE_YOUR_CALM = 11
OURS = b"are-you?"


def frame(kind: int, flags: int, payload: bytes) -> bytes:
    return struct.pack(">I", len(payload))[1:] + bytes([kind, flags]) + bytes(4) + payload


@contextmanager
def connection(address: str) -> Iterator[socket.socket]:
    host, _, port = address.rpartition(":")
    with closing(socket.create_connection((host, int(port)), PATIENCE)) as opened:
        opened.sendall(PREFACE + frame(SETTINGS, 0, b""))
        yield opened


def frames(opened: socket.socket) -> Iterator[tuple[int, int, bytes]]:
    """The frames from the server, until it closes the connection."""
    with opened.makefile("rb") as stream:
        while head := stream.read(9):
            yield head[3], head[4], stream.read(int.from_bytes(head[:3]))


def is_answered(opened: socket.socket, received: Iterator[tuple[int, int, bytes]]) -> bool:
    opened.sendall(frame(PING, 0, OURS))
    for kind, flags, payload in received:
        if kind == PING and flags & ACK:
            return payload == OURS
        if kind == GOAWAY:
            return False
    return False


def test_a_flood_ends_the_connection(address: str) -> None:
    with connection(address) as opened:
        opened.sendall(1000 * frame(PING, 0, OURS))
        codes = [int.from_bytes(payload[4:8]) for kind, _, payload in frames(opened) if kind == GOAWAY]
    assert codes[-1] == ENHANCE_YOUR_CALM


@pytest.mark.parametrize(("permitted", "lives"), [("0.01", True), ("5", False)])
def test_how_often_a_client_may_ping_is_an_option(permitted: str, lives: bool) -> None:
    with server_process("--min-ping-interval", permitted) as server, connection(server.address) as opened:
        received = frames(opened)

        def asked() -> bool:
            pause(0.02)
            return is_answered(opened, received)

        assert all(asked() for _ in range(6)) is lives
