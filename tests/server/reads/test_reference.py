"""The server on the reference in Python, as on a machine without a compiler."""

import struct

import grpc
import numpy as np
import pytest
from cases import slow
from refusal import refusal
from server_process import server_process

from dynhull import convex_hull
from dynhull_client import HullClient
from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.engine.verification import LARGE


@slow
@pytest.mark.long
def test_a_large_hull_is_written_read_and_verified() -> None:
    points = np.random.default_rng(6).normal(size=(LARGE + 100, 2))
    wrap = ["env", "DYNHULL_KERNEL=python"]
    with server_process("--scrub-cpu", "0", wrap=wrap) as server, HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=points)
        client.apply("a", delete=points[:100])
        hull = client.get_hull("a")
        np.testing.assert_array_equal(hull.vertices, convex_hull(points[100:]))
        assert client.locate("a", [[0, 0], [9, 9], hull.vertices[0]]).sides.tolist() == [1, -1, 0]
        found = client.verify("a")
        assert (found.equal, found.points, found.vertices) == (True, LARGE, len(hull.vertices))
        assert found.rounds[-1].closed
        bad = batch_pb2.Batch(inserts=points_pb2.Points(packed=struct.pack("<4d", 0, 0, 1, np.nan)))
        with grpc.insecure_channel(server.address) as channel:
            code, info, _ = refusal(lambda: HullServiceStub(channel).Apply(pb.ApplyRequest(name="a", batch=bad)))
        assert code == grpc.StatusCode.INVALID_ARGUMENT
        assert dict(info.metadata) == {"field": "batch.inserts", "row": "1", "value": "(1.0, nan)"}
        assert client.get_hull("a").revision == 2
