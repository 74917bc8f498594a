"""What survives a stop or a kill of the server, as clients of real processes see it."""

import os
from pathlib import Path

import grpc
import numpy as np
import pytest
from cases import slow
from patience import PATIENCE
from server_process import run, server_process, shape_options

import dynhull
from dynhull_client import HullClient, LimitExceededError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub


def random_points(n, seed):
    return np.random.default_rng(seed).random((n, 2))


def apply(address, name, points, producer, sequence):
    """One numbered batch, on the wire."""
    request = pb.ApplyRequest(name=name, producer=producer, sequence=sequence)
    request.batch.inserts.packed = np.asarray(points, "<f8").tobytes()
    with grpc.insecure_channel(address) as channel:
        return HullServiceStub(channel).Apply(request).result


def kill(server):
    server.process.kill()
    server.process.wait(PATIENCE)


@pytest.mark.parametrize(
    ("durability", "sudden"),
    [
        ("sync", True),
        ("sync", False),
        ("interval", True),
        *(pytest.param(*each, marks=slow) for each in [("interval", False), ("none", True), ("none", False)]),
    ],
)
def test_acknowledged_batches_are_there_after_a_restart(tmp_path, sudden, durability):
    options = ["--data", str(tmp_path / "data"), "--durability", durability]
    points = random_points(3000, 1)
    with server_process(*options, killed=sudden) as server, HullClient(server.address) as client:
        created = client.create_hull("fleet/north")
        client.create_hull("empty")
        client.create_hull("gone")
        client.apply("gone", insert=points)
        client.delete_hull("gone")
        for part in np.split(points, 30):
            client.apply("fleet/north", insert=part)
        client.apply("fleet/north", delete=points[:100])
        client.apply("fleet/north", delete=[[7, 7], points[100], [8, 8]], missing="count")
        before = client.get_hull("fleet/north")
        if sudden:
            kill(server)
    with server_process(*options) as server, HullClient(server.address) as client:
        assert [hull.name for hull in client.list_hulls()] == ["empty", "fleet/north"]
        after = client.get_hull("fleet/north")
        assert after.info == before.info
        assert after.info.created == created.created
        np.testing.assert_array_equal(after.vertices, before.vertices)
        np.testing.assert_array_equal(after.vertices, dynhull.convex_hull(points[101:]))
        verified = client.verify("fleet/north")
        assert (verified.equal, verified.points) == (True, 2899)
        assert client.apply("fleet/north", insert=[[9, 9]]).revision == before.revision + 1


def test_exactly_once_across_a_kill(tmp_path):
    options = ["--data", str(tmp_path / "data")]
    with server_process(*options, killed=True) as server, HullClient(server.address) as client:
        client.create_hull("fleet")
        apply(server.address, "fleet", [[0, 0]], "truck", 1)
        apply(server.address, "fleet", [[1, 0]], "truck", 2)
        kill(server)
    with server_process(*options) as server:
        again = apply(server.address, "fleet", [[1, 0]], "truck", 2)
        assert (again.duplicate, again.point_count) == (True, 2)
        assert apply(server.address, "fleet", [[0, 1]], "truck", 3).point_count == 3
        with grpc.insecure_channel(server.address) as channel:
            request = pb.GetProducerRequest(name="fleet", producer="truck")
            assert HullServiceStub(channel).GetProducer(request).last_sequence == 3


def test_a_watch_resumes_across_a_kill(tmp_path):
    options = ["--data", str(tmp_path / "data")]
    with server_process(*options, killed=True) as server, HullClient(server.address) as client:
        client.create_hull("fleet")
        client.apply("fleet", insert=random_points(50, 2))
        with grpc.insecure_channel(server.address) as channel:
            told = next(HullServiceStub(channel).Watch(pb.WatchRequest(name="fleet")))
        client.apply("fleet", insert=[[5, 5]])
        kill(server)
    with server_process(*options) as server, HullClient(server.address) as client:
        client.apply("fleet", insert=[[-5, 5]])
        with grpc.insecure_channel(server.address) as channel:
            request = pb.WatchRequest(name="fleet")
            request.resume.uid, request.resume.revision = told.snapshot.uid, told.revision
            event = next(HullServiceStub(channel).Watch(request))
        assert (event.revision, event.WhichOneof("event")) == (3, "change")
        held = np.frombuffer(told.snapshot.vertices.packed).reshape(-1, 2)
        kept = np.roll(np.delete(held, event.change.removed_indices, axis=0), -event.change.rotation, axis=0)
        added = np.frombuffer(event.change.added.packed).reshape(-1, 2)
        vertices = client.get_hull("fleet").vertices
        np.testing.assert_array_equal(np.delete(vertices, event.change.added_indices, axis=0), kept)
        np.testing.assert_array_equal(vertices[event.change.added_indices], added)


def test_a_second_server_on_the_folder_is_refused(tmp_path):
    options = ["--data", str(tmp_path / "data")]
    with server_process(*options):
        second = run("serve", "--port", "0", *shape_options(), *options)
    assert second.returncode == 2
    assert "another server" in second.stderr
    assert "Traceback" not in second.stderr


FULL_DISK = 'mount -t tmpfs -o size=3m none "$0" && exec "$@"'


def test_a_full_disk_refuses_writes_and_recovers(tmp_path):
    """The folder is on a file system of three megabytes, in a mount namespace of the server's own."""
    folder = tmp_path / "small"
    folder.mkdir()
    wrap = ["unshare", "--map-root-user", "--mount", "sh", "-c", FULL_DISK, str(folder)]
    points = random_points(2000, 3)
    with (
        server_process("--data", str(folder / "data"), wrap=wrap, complaints="the disk is full") as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet")
        ballast = Path(f"/proc/{server.process.pid}/root{folder}/ballast")
        apply(server.address, "fleet", points, "p", 1)
        with ballast.open("wb") as file:
            file.write(bytes(os.statvfs(ballast).f_bavail * os.statvfs(ballast).f_frsize))
        with pytest.raises(LimitExceededError, match="the disk is full"):
            fill(client, points)
        held = client.get_hull("fleet")
        assert held.info.points == 2000 * held.revision
        assert client.locate("fleet", [[0.5, 0.5]]).sides.tolist() == [1]
        assert client.verify("fleet").equal
        ballast.unlink()
        more = apply(server.address, "fleet", points + 99, "p", 2)
        assert (more.revision, more.point_count) == (held.revision + 1, 2000 * (held.revision + 1))
        assert client.verify("fleet").equal


def fill(client, points):
    for shift in range(1, 50):
        client.apply("fleet", insert=points + shift)
