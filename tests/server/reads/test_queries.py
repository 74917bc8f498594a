"""Questions about a hull, answered as the library answers them."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import grpc
import numpy as np
import pytest
from cases import slow
from patience import wait_until
from processor import needs_proc, processor_time, wait_for_rest
from refusal import refusal
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import HullClient, HullEmptyError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

POINTS = np.round(np.random.default_rng(6).normal(scale=9, size=(400, 2)))
QUESTIONS = np.round(np.random.default_rng(7).normal(scale=30, size=(300, 2)), 1)


@pytest.fixture
def filled(address: str, hull: str) -> str:
    """A hull of the points."""
    with HullClient(address) as client:
        client.apply(hull, insert=POINTS)
    return hull


@pytest.fixture
def client(address: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        yield client


def test_support(client: HullClient, filled: str) -> None:
    answer = client.support(filled, QUESTIONS)
    assert answer.revision == 1
    assert answer.vertices.tolist() == DynamicHull(POINTS).support(QUESTIONS).tolist()


def test_tangents(client: HullClient, filled: str) -> None:
    answer = client.tangents(filled, QUESTIONS)
    expected = DynamicHull(POINTS).tangents(QUESTIONS)
    assert answer.revision == 1
    assert np.isnan(expected).any()
    assert np.array_equal(answer.tangents, expected, equal_nan=True)


def test_distance(client: HullClient, filled: str) -> None:
    answer = client.distance(filled, QUESTIONS)
    assert answer.revision == 1
    assert answer.distances.tolist() == DynamicHull(POINTS).distance(QUESTIONS).tolist()


def test_intersect_lines(client: HullClient, filled: str) -> None:
    answer = client.intersect_lines(filled, QUESTIONS[:-1], QUESTIONS[1:])
    expected = DynamicHull(POINTS).intersect_lines(QUESTIONS[:-1], QUESTIONS[1:])
    assert answer.revision == 1
    assert np.isnan(expected).any()
    assert np.array_equal(answer.crossings, expected, equal_nan=True)


def test_a_line_needs_two_points(stub: HullServiceStub, filled: str) -> None:
    one, two = (points_pb2.Points(coordinates=each) for each in ([1, 2], [3, 4, 1, 2]))
    same = pb.IntersectLinesRequest(name=filled, origins=two, targets=points_pb2.Points(coordinates=[0, 0, 1, 2]))
    _, info, _ = refusal(lambda: stub.IntersectLines(same))
    assert dict(info.metadata) == {"field": "targets", "row": "1", "value": "(1.0, 2.0)"}
    fewer = pb.IntersectLinesRequest(name=filled, origins=two, targets=one)
    _, info, _ = refusal(lambda: stub.IntersectLines(fewer))
    assert dict(info.metadata) == {"field": "targets", "value": "1 points"}


def test_count(client: HullClient, filled: str) -> None:
    reference = DynamicHull(POINTS)
    asked = np.concatenate((POINTS[:50], QUESTIONS))
    answer = client.count(filled, asked)
    assert answer.counts.tolist() == [reference.count(x, y) for x, y in asked]


def test_a_sample_of_few_points_is_all_of_them(client: HullClient, filled: str) -> None:
    answer = client.sample_points(filled)
    assert (answer.revision, answer.points.tolist()) == (1, DynamicHull(POINTS).points().tolist())


def test_a_sample_of_many_points_stays_as_it_is_where_they_do(client: HullClient, hull: str) -> None:
    client.apply(hull, insert=[[x, y] for x in range(100) for y in range(100)])
    before = client.sample_points(hull, 1000).points.tolist()
    assert before == sorted(before)
    assert len({tuple(point) for point in before}) == 1000
    quarters = np.histogram2d(*np.array(before).T, bins=2)[0]
    assert 180 < quarters.min() <= quarters.max() < 320, "not spread over the points"
    client.apply(hull, insert=[[0.5, 0.5]], delete=[before[7]])
    after = client.sample_points(hull, 1000)
    assert after.revision == 2
    assert len({*map(tuple, before)} - {*map(tuple, after.points.tolist())}) in (1, 2)


def test_a_sample_has_a_size(client: HullClient, stub: HullServiceStub, hull: str) -> None:
    client.apply(hull, insert=[[x, 0] for x in range(2_000)])
    assert len(stub.SamplePoints(pb.SamplePointsRequest(name=hull)).points.packed) == 1000 * 16
    _, info, _ = refusal(lambda: stub.SamplePoints(pb.SamplePointsRequest(name=hull, sample_size=-1)))
    assert dict(info.metadata) == {"field": "sample_size", "value": "-1"}


def test_coordinates_instead_of_bytes(client: HullClient, stub: HullServiceStub, filled: str) -> None:
    coordinates = points_pb2.POINT_ENCODING_COORDINATES
    one = points_pb2.Points(coordinates=[100, 0])
    support = stub.Support(pb.SupportRequest(name=filled, directions=one, encoding=coordinates))
    assert list(support.vertices.coordinates) == client.support(filled, [[100, 0]]).vertices.ravel().tolist()
    tangents = stub.Tangents(pb.TangentsRequest(name=filled, points=one, encoding=coordinates))
    both = [*tangents.left.coordinates, *tangents.right.coordinates]
    assert both == client.tangents(filled, [[100, 0]]).tangents.ravel().tolist()


def test_counts_alone(stub: HullServiceStub, filled: str) -> None:
    response = stub.GetHull(pb.GetHullRequest(name=filled, view=pb.HULL_VIEW_BASIC))
    assert response.hull.point_count == len(POINTS)
    assert response.hull.distinct_point_count == DynamicHull(POINTS).distinct
    assert not response.HasField("vertices")
    assert not response.HasField("measures")


@pytest.mark.parametrize("ask", ["locate", "support", "tangents", "distance", "count"])
def test_questions_wait_for_their_revision(client: HullClient, filled: str, ask: str) -> None:
    with pytest.raises(TimeoutError):
        getattr(client, ask)(filled, [[1, 2]], min_revision=2, timeout=0.05)
    client.apply(filled, insert=[[1, 2]])
    assert getattr(client, ask)(filled, [[1, 2]], min_revision=2).revision == 2


def test_an_empty_hull(client: HullClient, stub: HullServiceStub, hull: str) -> None:
    with pytest.raises(HullEmptyError):
        client.support(hull, [[1, 0]])
    assert np.isnan(client.tangents(hull, [[1, 0]]).tangents).all()
    assert client.count(hull, [[1, 0]]).counts.tolist() == [0]
    directions = points_pb2.Points(coordinates=[1, 0])
    code, info, details = refusal(lambda: stub.Support(pb.SupportRequest(name=hull, directions=directions)))
    assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "HULL_EMPTY")
    assert details[0].violations[0].subject == hull


def test_a_direction_that_is_none(stub: HullServiceStub, filled: str) -> None:
    directions = points_pb2.Points(coordinates=[1, 0, 0, -0.0])
    _, info, _ = refusal(lambda: stub.Support(pb.SupportRequest(name=filled, directions=directions)))
    assert dict(info.metadata) == {"field": "directions", "row": "1", "value": "(0.0, 0.0)"}
    _, info, _ = refusal(lambda: list(stub.Watch(pb.WatchRequest(name=filled, directions=directions))))
    assert info.metadata["field"] == "directions"


@slow
def test_writes_go_on_beside_a_large_read(address: str, name: str) -> None:
    """The read sees one revision, and a writer gets in between again and again: in one of several reads, at least."""
    rng = np.random.default_rng(11)
    angles = rng.uniform(0, 7, 3000)
    rows = rng.uniform(-2, 2, (1_000_000, 2))
    with HullClient(address) as reader, HullClient(address) as writer:
        writer.create_hull(name)
        writer.apply(name, insert=np.column_stack((np.cos(angles), np.sin(angles))))
        expected = DynamicHull(np.column_stack((np.cos(angles), np.sin(angles)))).distance(rows)

        def written() -> int:
            """The number of batches during a read."""
            last = before = writer.get_hull(name).revision
            reading = threads.submit(reader.distance, name, rows)
            while not reading.done():
                last = writer.apply(name, insert=[[0.5, 0.5]]).revision
            assert before <= reading.result().revision <= last
            np.testing.assert_array_equal(reading.result().distances, expected)
            return last - before

        with ThreadPoolExecutor() as threads:
            wait_until(lambda: written() >= 5)


@slow
@pytest.mark.long
@needs_proc
def test_a_large_answer_is_given_up_when_its_caller_goes() -> None:
    """The call ends with its caller: the server then uses less time than for an answer about a tenth of the entries."""
    entries = np.random.default_rng(12).uniform(0, 1, (300_000, 2))

    def diagram(count: int) -> grpc.Future:
        packed = entries[:count].tobytes()
        return stub.PhaseDiagram.future(pb.PhaseDiagramRequest(name="a", entries=points_pb2.Points(packed=packed)))

    with server_process() as server, grpc.insecure_channel(server.address) as channel:
        stub, pid = HullServiceStub(channel), server.process.pid
        stub.CreateHull(pb.CreateHullRequest(name="a"))
        stub.Apply(pb.ApplyRequest(name="a", batch={"inserts": {"coordinates": [0, 0, 0.5, -1, 1, 0]}}))
        begun = processor_time(pid)
        diagram(len(entries) // 10).result()
        tenth = processor_time(pid) - begun
        begun = processor_time(pid)
        call = diagram(len(entries))
        wait_until(lambda: processor_time(pid) > begun + tenth)
        assert call.cancel()
        gone = processor_time(pid)
        wait_for_rest(pid)
        assert processor_time(pid) - gone < tenth
