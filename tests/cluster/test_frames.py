"""Calls that reach a worker in one message are answered together where they are alike, and each as if it were alone."""

import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.rpc import code_pb2
from google.rpc.status_pb2 import Status
from metrics import measured, samples
from patience import PATIENCE

from dynhull_client import HullClient
from dynhull_cluster.frames import HEADER, Kind, pack_request
from dynhull_proto.v1 import hull_service_pb2 as pb

LOCATE = b"/dynhull.v1.HullService/Locate"
SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]


def frame(number: int, kind: Kind, *parts: bytes) -> bytes:
    return HEADER.pack(sum(map(len, parts)), number, kind) + b"".join(parts)


def asked(number: int, **request: Any) -> bytes:
    message = pb.LocateRequest(**request).SerializeToString()
    return frame(number, Kind.REQUEST, *pack_request(LOCATE, b"127.0.0.1 ", message))


def places(*xy: float) -> dict[str, bytes]:
    return {"packed": np.array(xy).tobytes()}


def answers(path: Path, sent: bytes, number: int) -> dict[int, tuple[Kind, bytes]]:
    """The answers to frames, sent in one piece over a connection of their own."""
    found: dict[int, tuple[Kind, bytes]] = {}
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(PATIENCE)
        connection.connect(str(path))
        connection.sendall(sent)
        with connection.makefile("rb") as reader:
            while len(found) < number:
                length, call, kind = HEADER.unpack(reader.read(HEADER.size))
                assert call not in found
                found[call] = Kind(kind), reader.read(length)
    return found


def test_calls_that_arrive_together_are_answered_each(tmp_path_factory: pytest.TempPathFactory) -> None:
    data = tmp_path_factory.mktemp("data")
    options = ("--workers", "1", "--gateways", "1", "--data", str(data), "--scrub-cpu", "0")
    with measured(*options) as (server, metrics), HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=SQUARE)
        good = {i: asked(i, name="a", points=places(i / 10, 1.0)) for i in range(1, 101)}
        bad = {
            30: (asked(30, name="a", points=places(np.nan, 1.0)), code_pb2.INVALID_ARGUMENT),
            31: (asked(31, name="b", points=places(1.0, 1.0)), code_pb2.NOT_FOUND),
            60: (asked(60, name="a"), None),  # no points: no rows
            61: (asked(61, name="a", points=places(1.0, 1.0, 9.0, 9.0)), None),  # more rows than its neighbours have
        }
        sent = {**good, **{number: message for number, (message, _) in bad.items()}}
        waiting = asked(200, name="a", points=places(1.0, 1.0), min_revision=99)
        cancelled = waiting + frame(200, Kind.CANCEL)
        found = answers(data / "sockets" / "0.frames", cancelled + b"".join(sent.values()), len(sent))
        assert found.keys() == sent.keys()
        for number, (kind, answer) in found.items():
            code = bad[number][1] if number in bad else None
            if code is not None:
                assert (kind, Status.FromString(answer).code) == (Kind.REFUSAL, code)
                continue
            response = pb.LocateResponse.FromString(answer)
            side = 1 if number < 40 else 0 if number == 40 else -1
            expected = {60: b"", 61: b"\x01\xff"}.get(number, np.int8(side).tobytes())
            assert (kind, response.revision, response.sides) == (Kind.ANSWER, 1, expected)
        counted = {
            name.split('code="')[1].split('"')[0]: value
            for name, value in samples(metrics).items()
            if name.startswith("dynhull_calls_total") and 'method="Locate"' in name and "worker-0" in name and value
        }
        assert counted == {"OK": len(sent) - 2, "INVALID_ARGUMENT": 1, "NOT_FOUND": 1}
