"""Odd input of every call about fences: the error names field and value, and nothing has changed."""

import math
import re
from collections.abc import Callable, Iterator
from typing import Any

import grpc
import numpy as np
import pytest
from command_line import dynhull
from fence_calls import points, polygon, refused_by
from google.protobuf.duration_pb2 import Duration
from patience import PATIENCE
from server_process import server_process

from dynhull_client import Circle, HullClient, InvalidRequestError, Polygon, Prefix
from dynhull_proto.v1 import fence_pb2, points_pb2
from dynhull_proto.v1 import fence_service_pb2 as fs
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub

INVALID, RANGE = grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.OUT_OF_RANGE
NOT_FOUND, FAILED = grpc.StatusCode.NOT_FOUND, grpc.StatusCode.FAILED_PRECONDITION
NAN, INF = math.nan, math.inf
SQUARE = [0.0, 0.0, 6.0, 0.0, 6.0, 6.0, 0.0, 6.0]
CIRCLE = {"circle_area": {"radius": 5}}
RING = np.linspace(0, 2 * np.pi, 100_001)
CORNERS = np.stack([np.cos(RING), np.sin(RING)], axis=1)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A server with a fence, and hulls of every kind."""
    with server_process() as server, HullClient(server.address) as client:
        for name, key in {"odd/fleet": "str", "odd/ids": "int", "odd/points": None, "odd/others": None}.items():
            client.create_hull(name, keyed=key)
        for name, center in {"odd/ships": (180, -17), "odd/nowhere": None, "odd/atlantic": (0, 0)}.items():
            client.create_hull(name, keyed="str", geographic=True, center=center)
        client.create_fence("odd/depot", area=Circle(0, 0, 5), subjects="odd/fleet")
        client.put("odd/fleet", ["a"], [[1, 1]])
        client.ack_fence("odd/depot", "mail", 2)
        yield server.address


@pytest.fixture(scope="module")
def unchanged(address: str) -> Iterator[Callable[[], bytes]]:
    """What there is of fences."""
    with grpc.insecure_channel(address) as channel:
        stub = FenceServiceStub(channel)
        yield lambda: stub.ListFences(fs.ListFencesRequest()).SerializeToString(deterministic=True)


def settings(**given: Any) -> dict[str, Any]:
    """Settings of a fence: those that are given, and a circle around the fleet where they leave that open."""
    area = {} if {"polygon_area", "hull_area", "circle_area"} & given.keys() else CIRCLE
    subjects = {} if {"subject_prefix", "subject_hull", "other_hull"} & given.keys() else {"subject_hull": "odd/fleet"}
    return {**area, **subjects, **given}


def create(name: str = "odd/zone", **given: Any) -> tuple[str, fs.CreateFenceRequest]:
    return "CreateFence", fs.CreateFenceRequest(name=name, config=settings(**given))


def replace(name: str = "odd/depot", **given: Any) -> tuple[str, fs.ReplaceFenceRequest]:
    return "ReplaceFence", fs.ReplaceFenceRequest(name=name, config=settings(**given))


def watch(**given: Any) -> tuple[str, fs.WatchFenceRequest]:
    return "WatchFence", fs.WatchFenceRequest(**{"name": "odd/depot", **given})


def ack(**given: Any) -> tuple[str, fs.AckFenceRequest]:
    return "AckFence", fs.AckFenceRequest(**{"name": "odd/depot", "consumer": "mail", **given})


def ships(*ring: float) -> dict[str, Any]:
    return {"subject_hull": "odd/ships", "polygon_area": polygon(ring)}


def ships_circle(x: float, y: float, radius: float) -> dict[str, Any]:
    return {"subject_hull": "odd/ships", "circle_area": {"center_x": x, "center_y": y, "radius": radius}}


EXTERIOR = "config.polygon_area.polygons[0].exterior"
BOWTIE = [0, 0, 2, 2, 2, 0, 0, 2]
PACKED = fence_pb2.Polygon(exterior=points_pb2.Points(packed=CORNERS.astype("<f8").tobytes()))

REQUESTS: dict[str, tuple[tuple[str, Any], grpc.StatusCode, str, str]] = {
    # Names
    "no name": (create(""), INVALID, "name", ""),
    "a blank in a name": (create("a b"), INVALID, "name", "a b"),
    "a newline in a name": (create("a\n"), INVALID, "name", "a\n"),
    "a zero byte in a name": (create("a\0b"), INVALID, "name", "a\0b"),
    "a pictogram": (create("\U0001f600"), INVALID, "name", "\U0001f600"),
    "a long name": (create("x" * 201), INVALID, "name", "x" * 120 + "... (201 characters)"),
    "a name to get": (("GetFence", fs.GetFenceRequest(name="\n")), INVALID, "name", "\n"),
    "a name to delete": (("DeleteFence", fs.DeleteFenceRequest(name="ä")), INVALID, "name", "ä"),
    "a name to read": (("ReadInside", fs.ReadInsideRequest(name="")), INVALID, "name", ""),
    "a name to watch": (watch(name="a b"), INVALID, "name", "a b"),
    "a name to acknowledge": (ack(name="a b"), INVALID, "name", "a b"),
    "no fence to get": (("GetFence", fs.GetFenceRequest(name="zz")), NOT_FOUND, "", "zz"),
    "no fence to delete": (("DeleteFence", fs.DeleteFenceRequest(name="zz")), NOT_FOUND, "", "zz"),
    "no fence to replace": (replace("zz"), NOT_FOUND, "", "zz"),
    "no fence to watch": (watch(name="zz"), NOT_FOUND, "", "zz"),
    "no fence to read": (("ReadInside", fs.ReadInsideRequest(name="zz")), NOT_FOUND, "", "zz"),
    # Subjects
    "no subjects": (
        ("CreateFence", fs.CreateFenceRequest(name="odd/zone", config=CIRCLE)),
        INVALID,
        "config",
        "no subjects",
    ),
    "subjects without a name": (create(subject_hull=""), INVALID, "config.subject_hull", ""),
    "subjects of two lines": (create(subject_hull="a\nb"), INVALID, "config.subject_hull", "a\nb"),
    "a prefix of nothing": (create(subject_prefix="a b"), INVALID, "config.subject_prefix", "a b"),
    "subjects that are not there": (create(subject_hull="odd/nobody"), NOT_FOUND, "", "odd/nobody"),
    "subjects without keys": (create(subject_hull="odd/points"), FAILED, "config.subject_hull", "odd/points"),
    "an other hull that is the area": (
        create(other_hull="odd/points", hull_area={"name": "odd/points"}),
        INVALID,
        "config.other_hull",
        "odd/points",
    ),
    "an other hull and a circle": (create(other_hull="odd/points"), INVALID, "config.other_hull", "odd/points"),
    "other subjects": (replace(subject_hull="odd/ids"), INVALID, "config.subject_hull", "odd/ids"),
    "a prefix instead": (replace(subject_prefix="fl"), INVALID, "config.subject_prefix", "fl"),
    # Numbers
    "a margin that is none": (create(margin=NAN), INVALID, "config.margin", "nan"),
    "an endless margin": (create(margin=INF), INVALID, "config.margin", "inf"),
    "a negative margin": (create(margin=-1), INVALID, "config.margin", "-1.0"),
    "another margin that is none": (replace(margin=NAN), INVALID, "config.margin", "nan"),
    "a distance that is none": (
        create(other_hull="odd/points", hull_area={"name": "odd/others"}, near_distance=NAN),
        INVALID,
        "config.near_distance",
        "nan",
    ),
    "a negative distance": (create(near_distance=-1), INVALID, "config.near_distance", "-1.0"),
    "a distance of keys": (create(near_distance=1), INVALID, "config.near_distance", "1.0"),
    "too many events": (create(max_events=2**63), INVALID, "config.max_events", str(2**63)),
    "a boundary of the future": (create(boundary=9), INVALID, "config.boundary", "9"),
    "an initial of the future": (create(initial=9), INVALID, "config.initial", "9"),
    "a negative dwell": (create(dwell=Duration(seconds=-1)), INVALID, "config.dwell", "-1 s and 0 ns"),
    "an endless dwell": (
        create(dwell=Duration(seconds=2**62)),
        INVALID,
        "config.dwell",
        f"{2**62} s and 0 ns",
    ),
    "a dwell of nanoseconds": (create(dwell=Duration(nanos=5)), INVALID, "config.dwell", "0 s and 5 ns"),
    "a negative min_dwell": (create(min_dwell=Duration(seconds=-1)), INVALID, "config.min_dwell", "-1 s and 0 ns"),
    "a negative age": (
        create(max_event_age=Duration(nanos=-1000)),
        INVALID,
        "config.max_event_age",
        "0 s and -1000 ns",
    ),
    # Areas
    "no area": (
        ("CreateFence", fs.CreateFenceRequest(name="odd/zone", config={"subject_hull": "odd/fleet"})),
        INVALID,
        "config",
        "no area",
    ),
    "no polygon": (create(polygon_area={}), INVALID, "config.polygon_area.polygons", "0 polygons"),
    "a polygon without corners": (create(polygon_area=polygon([])), INVALID, EXTERIOR, "0 corners"),
    "two corners": (create(polygon_area=polygon([0, 0, 1, 1])), INVALID, EXTERIOR, "2 corners"),
    "two corners, and nobody compared": (
        create(polygon_area=polygon([0, 0, 1, 1]), subject_prefix="odd/later"),
        INVALID,
        EXTERIOR,
        "2 corners",
    ),
    "corners on a line": (create(polygon_area=polygon([0, 0, 1, 1, 2, 2])), INVALID, EXTERIOR, "3 corners"),
    "edges that cross": (create(polygon_area=polygon(BOWTIE)), INVALID, EXTERIOR, "4 corners"),
    "edges that cross, later": (replace(polygon_area=polygon(BOWTIE)), INVALID, EXTERIOR, "4 corners"),
    "a ring that touches itself": (
        create(polygon_area=polygon([0, 0, 4, 0, 4, 4, 2, 0, 0, 4])),
        INVALID,
        EXTERIOR,
        "5 corners",
    ),
    "half a corner": (create(polygon_area=polygon([0, 0, 1])), INVALID, f"{EXTERIOR}.coordinates", "3 coordinates"),
    "a corner that is none": (
        create(polygon_area=polygon([0, 0, 1, NAN, 2, 2])),
        INVALID,
        EXTERIOR,
        "(1.0, nan)",
    ),
    "a hole outside": (
        create(polygon_area=polygon(SQUARE, [10, 10, 11, 10, 11, 11])),
        INVALID,
        "config.polygon_area.polygons[0].holes[0]",
        "3 corners",
    ),
    "holes that overlap": (
        create(polygon_area=polygon(SQUARE, [1, 1, 3, 1, 3, 3, 1, 3], [1.5, 1.5, 2, 1.5, 2, 2])),
        INVALID,
        "config.polygon_area.polygons[0]",
        "3 rings",
    ),
    "too many corners": (
        create(polygon_area=fence_pb2.PolygonArea(polygons=[PACKED])),
        INVALID,
        "config.polygon_area.polygons[0]",
        "100001 corners",
    ),
    "a bad second polygon": (
        create(polygon_area={"polygons": [{"exterior": points(*SQUARE)}, {"exterior": points(0, 0, 1, 1)}]}),
        INVALID,
        "config.polygon_area.polygons[1].exterior",
        "2 corners",
    ),
    "a radius that is none": (create(circle_area={"radius": NAN}), INVALID, "config.circle_area.radius", "nan"),
    "a negative radius": (create(circle_area={"radius": -1}), INVALID, "config.circle_area.radius", "-1.0"),
    "a centre that is none": (create(circle_area={"center_y": NAN}), INVALID, "config.circle_area.center_y", "nan"),
    "an area without a name": (create(hull_area={"name": ""}), INVALID, "config.hull_area.name", ""),
    "an area that is not there": (create(hull_area={"name": "odd/nobody"}), NOT_FOUND, "", "odd/nobody"),
    "without self, of others": (
        create(hull_area={"name": "odd/points", "without_self": True}),
        INVALID,
        "config.hull_area.without_self",
        "true",
    ),
    "without self and margin": (
        create(hull_area={"name": "odd/fleet", "without_self": True}),
        INVALID,
        "config.margin",
        "0.0",
    ),
    # On the globe
    "latitudes first": (create(**ships(-17.5, 179.5, -17.5, -179.5, -16.5, -179.5)), INVALID, EXTERIOR, "3 corners"),
    "corners out of reach": (create(**ships(0, 0, 1, 0, 1, 1)), INVALID, EXTERIOR, "3 corners"),
    "a circle with the latitude first": (
        create(**ships_circle(-17, 180, 1)),
        INVALID,
        "config.circle_area",
        "center (-17.0, 180.0), radius 1.0",
    ),
    "a circle around the other side": (
        create(**ships_circle(0, 17, 1.5e7)),
        INVALID,
        "config.circle_area",
        "center (0.0, 17.0), radius 15000000.0",
    ),
    "a circle around the globe": (
        create(**ships_circle(180, -17, 40_007_863.0)),
        INVALID,
        "config.circle_area",
        "center (180.0, -17.0), radius 40007863.0",
    ),
    "a circle without a radius": (
        create(**ships_circle(180, -17, 0)),
        INVALID,
        "config.circle_area",
        "center (180.0, -17.0), radius 0.0",
    ),
    "a margin of more than 250 km": (
        create(**ships(179.5, -17.5, -179.5, -17.5, -179.5, -16.5), margin=250_001),
        INVALID,
        "config.margin",
        "250001.0",
    ),
    "without self on the globe": (
        create(subject_hull="odd/ships", hull_area={"name": "odd/ships", "without_self": True}, margin=1),
        INVALID,
        "config.hull_area.without_self",
        "true",
    ),
    "no centre": (create(subject_hull="odd/ships", hull_area={"name": "odd/nowhere"}), FAILED, "", "odd/nowhere"),
    "a prefix of both": (create(subject_prefix="odd/"), FAILED, "", "odd/fleet"),
    "a wide margin over a prefix": (
        create(subject_prefix="odd/ship", margin=3e5),
        INVALID,
        "config.margin",
        "300000.0",
    ),
    "another centre": (create(subject_hull="odd/ships", hull_area={"name": "odd/atlantic"}), FAILED, "", "odd/ships"),
    "an area of the plane": (
        create(subject_hull="odd/ships", hull_area={"name": "odd/points"}),
        FAILED,
        "",
        "odd/points",
    ),
    # Watches and consumers
    "after the last event": (watch(after_sequence=99), RANGE, "after_sequence", "99"),
    "after all numbers": (watch(after_sequence=2**64 - 1), INVALID, "after_sequence", str(2**64 - 1)),
    "a consumer with a blank": (watch(consumer="a b"), INVALID, "consumer", "a b"),
    "a consumer without a name": (watch(consumer=""), INVALID, "consumer", ""),
    "a consumer that is conflated": (watch(consumer="mail", conflate=True), INVALID, "conflate", "true"),
    "not only new": (watch(only_new=False), INVALID, "only_new", "false"),
    "a rate that is none": (watch(max_responses_per_second=NAN), INVALID, "max_responses_per_second", "nan"),
    "a negative rate": (watch(max_responses_per_second=-1), INVALID, "max_responses_per_second", "-1.0"),
    "a rate that never sends": (watch(max_responses_per_second=5e-324), INVALID, "max_responses_per_second", "5e-324"),
    "no progress": (watch(progress_interval=Duration()), INVALID, "progress_interval", "0.0 s"),
    "another uid": (watch(after_sequence=0, uid="zz"), RANGE, "uid", "odd/depot"),
    "ahead": (ack(sequence=99), RANGE, "sequence", "99"),
    "far ahead": (ack(sequence=2**64 - 1), RANGE, "sequence", str(2**64 - 1)),
    "nobody acknowledges": (ack(consumer="", sequence=1), INVALID, "consumer", ""),
    "another uid acknowledged": (ack(sequence=1, uid="zz"), RANGE, "uid", "odd/depot"),
    "no such consumer": (
        ("DeleteConsumer", fs.DeleteConsumerRequest(name="odd/depot", consumer="zz")),
        NOT_FOUND,
        "",
        "zz",
    ),
    "no consumer to delete": (
        ("DeleteConsumer", fs.DeleteConsumerRequest(name="odd/depot")),
        INVALID,
        "consumer",
        "",
    ),
    # Lists
    "a negative page": (("ListFences", fs.ListFencesRequest(page_size=-1)), INVALID, "page_size", "-1"),
    "a page of nowhere": (("ListFences", fs.ListFencesRequest(page_token="z z")), INVALID, "page_token", "z z"),
    "a page of another list": (
        ("ListFences", fs.ListFencesRequest(prefix="a", page_token="zz")),
        INVALID,
        "page_token",
        "zz",
    ),
    "a list of nothing": (("ListFences", fs.ListFencesRequest(prefix="%")), INVALID, "prefix", "%"),
}


@pytest.mark.parametrize("case", REQUESTS)
def test_a_request_is_refused(address: str, unchanged: Callable[[], bytes], case: str) -> None:
    (method, request), code, field, value = REQUESTS[case]
    before = unchanged()
    with grpc.insecure_channel(address) as channel:
        call = getattr(FenceServiceStub(channel), method)
        streams = method in ("WatchFence", "ReadInside")
        refused = refused_by((lambda request: next(call(request))) if streams else call, request)
    assert refused.code is code
    assert refused.metadata.get("field", "") == field
    assert value in refused.metadata.values()
    assert unchanged() == before


def comb() -> np.ndarray:
    """As many corners as an area may have, and all long edges side by side."""
    row = np.arange(99_996)
    teeth = np.column_stack([row // 2, np.where((row % 4 == 1) | (row % 4 == 2), 6.0, 1.0)])
    return np.vstack([teeth, [[50_000, -1], [0, -1]]])


def sieve() -> Polygon:
    """A square with 3,600 holes."""
    places = [(x, y) for x in range(60) for y in range(60)]
    holes = tuple(np.array([[x, y], [x + 0.5, y], [x, y + 0.5]]) for x, y in places)
    return Polygon(np.array([[-1.0, -1], [61, -1], [61, 61], [-1, 61]]), holes)


@pytest.mark.parametrize(("area", "inside", "outside"), [(comb(), (1, 2), (1.5, 2)), (sieve(), (7.6, 9.6), (7.1, 9.1))])
def test_areas_with_many_parts_do_not_stop_the_server(
    address: str, area: Any, inside: tuple[float, float], outside: tuple[float, float]
) -> None:
    with HullClient(address, timeout=PATIENCE) as client:
        client.create_fence("odd/large", area=area, subjects="odd/ids", initial="none")
        client.apply("odd/points", insert=[[1, 1]], delete=[[1, 1]])
        client.put("odd/ids", [1], [inside])
        client.put("odd/ids", [1], [outside])
        with client.watch_fence("odd/large", after=0) as watch:
            assert [next(watch).type for _ in range(2)] == ["enter", "exit"]
        client.remove("odd/ids", [1])
        client.delete_fence("odd/large")


def test_odd_input_that_is_allowed(address: str) -> None:
    with HullClient(address) as client:
        huge = client.create_fence("odd/huge", CORNERS[:-1], "odd/fleet", max_events=2**63 - 1, confirmations=2**32 - 1)
        assert (huge.inside, len(huge.area[0].exterior)) == (0, 100_000)
        client.create_fence("later", Circle(0, 0, 1), Prefix("later/"))
        assert client.ack_fence("odd/depot", "mail", 1).acknowledged == 2  # backwards changes nothing
        assert client.ack_fence("odd/depot", "new", 0).acknowledged == 0
        for _ in range(2):  # the same consumer twice at a time
            with (
                client.watch_fence("odd/depot", consumer="twice") as one,
                client.watch_fence("odd/depot", "twice") as two,
            ):
                assert next(one) == next(two)
        client.delete_fence("odd/huge")
        client.delete_fence("later")
        for consumer in ("new", "twice"):
            client.delete_consumer("odd/depot", consumer)


MASKED = np.ma.array([[0, 0], [4, 0], [4, 4.0]], mask=[[0, 0], [0, 1], [0, 0]])

ARGUMENTS: dict[str, tuple[Callable[[HullClient], object], type[Exception], str]] = {
    "masked corners": (lambda c: c.create_fence("odd/zone", MASKED, "odd/fleet"), ValueError, "masked array"),
    "complex corners": (
        lambda c: c.create_fence("odd/zone", [[0, 0], [1j, 0], [1, 1]], "odd/fleet"),
        ValueError,
        "area row 1",
    ),
    "no area": (lambda c: c.create_fence("odd/zone", None, "odd/fleet"), TypeError, "area is None"),
    "a circle that is none": (
        lambda c: c.create_fence("odd/zone", Circle(0, NAN, 1), "odd/fleet"),
        ValueError,
        "y is nan",
    ),
    "a name that is a number": (lambda c: c.create_fence(7, Circle(0, 0, 1), "odd/fleet"), TypeError, "name is 7"),
    "no name": (lambda c: c.get_fence(None), TypeError, "name is None"),
    "subjects that are a number": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), 7),
        TypeError,
        "subjects is 7",
    ),
    "a prefix that is a number": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), Prefix(7)),
        TypeError,
        "subjects is 7",
    ),
    "an other hull that is a number": (
        lambda c: c.create_fence("odd/zone", "odd/points", other_hull=7),
        TypeError,
        "other_hull is 7",
    ),
    "nobody compared": (lambda c: c.create_fence("odd/zone", Circle(0, 0, 1)), ValueError, "subjects or other_hull"),
    "a unit": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", margin="5m"),
        TypeError,
        "margin: .*'5m'",
    ),
    "no margin": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", margin=None),
        TypeError,
        "margin: .*None",
    ),
    "a negative margin": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", margin=-1),
        InvalidRequestError,
        "margin is -1",
    ),
    "half a confirmation": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", confirmations=1.5),
        TypeError,
        "confirmations is 1.5",
    ),
    "too many confirmations": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", confirmations=2**32),
        ValueError,
        "confirmations must be less than 2\\*\\*32",
    ),
    "many events": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", max_events="many"),
        TypeError,
        "max_events is 'many'",
    ),
    "a flag in words": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", crosses="no"),
        TypeError,
        "crosses is 'no'",
    ),
    "a dwell in words": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", dwell="an hour"),
        ValueError,
        "dwell is 'an hour'",
    ),
    "a dwell of nothing": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", dwell=1e-9),
        ValueError,
        "dwell is 1e-09: must be at least a microsecond",
    ),
    "an endless min_dwell": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", min_dwell=INF),
        ValueError,
        "min_dwell is inf",
    ),
    "a negative age": (
        lambda c: c.create_fence("odd/zone", Circle(0, 0, 1), "odd/fleet", max_event_age=-1),
        InvalidRequestError,
        "max_event_age is '-1 s",
    ),
    "latitudes first": (
        lambda c: c.create_fence("odd/zone", [(-17.5, 179.5), (-17.5, -179.5), (-16.5, -179.5)], "odd/ships"),
        InvalidRequestError,
        "the longitude comes first",
    ),
    "a negative sequence": (lambda c: c.ack_fence("odd/depot", "mail", -1), ValueError, "sequence must be at least 0"),
    "half a sequence": (lambda c: c.ack_fence("odd/depot", "mail", 1.5), TypeError, "sequence is 1.5"),
    "no sequence": (lambda c: c.ack_fence("odd/depot", "mail", None), TypeError, "sequence is None"),
    "a sequence beyond all": (lambda c: c.ack_fence("odd/depot", "mail", 2**64), ValueError, "sequence must be less"),
    "a consumer that is a number": (lambda c: c.ack_fence("odd/depot", 7, 1), TypeError, "consumer is 7"),
    "a consumer to delete": (lambda c: c.delete_consumer("odd/depot", None), TypeError, "consumer is None"),
    "after half an event": (lambda c: c.watch_fence("odd/depot", after=0.5), TypeError, "after is 0.5"),
    "a rate that is none": (lambda c: c.watch_fence("odd/depot", max_rate=NAN), ValueError, "max_rate is nan"),
    "a rate in words": (lambda c: c.watch_fence("odd/depot", max_rate="fast"), TypeError, "max_rate: .*'fast'"),
    "a progress that is none": (
        lambda c: c.watch_fence("odd/depot", progress_interval=NAN),
        ValueError,
        "progress_interval is nan",
    ),
    "a list of a number": (lambda c: list(c.list_fences(7)), TypeError, "prefix is 7"),
}


@pytest.mark.parametrize("case", ARGUMENTS)
def test_an_argument_of_the_client_is_refused(address: str, unchanged: Callable[[], bytes], case: str) -> None:
    call, error, complaint = ARGUMENTS[case]
    before = unchanged()
    with HullClient(address) as client, pytest.raises(error, match=complaint):
        call(client)
    assert unchanged() == before


DISK = ("--circle", "0", "0", "1", "--subjects", "odd/fleet")

OPTIONS: dict[str, tuple[list[str], str]] = {
    "a margin that is none": (["create", "odd/zone", *DISK, "--margin", "nan"], "margin is nan"),
    "a margin in metres": (["create", "odd/zone", *DISK, "--margin", "5m"], "unable to parse string as a number"),
    "a negative margin": (["create", "odd/zone", *DISK, "--margin", "-1"], "margin is -1.0"),
    "half a confirmation": (
        ["create", "odd/zone", *DISK, "--confirmations", "1.5"],
        "unable to parse string as an integer",
    ),
    "negative confirmations": (
        ["create", "odd/zone", *DISK, "--confirmations", "-1"],
        "'-1'. Input should be greater than or equal to 0",
    ),
    "negative events": (
        ["create", "odd/zone", *DISK, "--max-events", "-1"],
        "'-1'. Input should be greater than or equal to 0",
    ),
    "a dwell without a unit": (["create", "odd/zone", *DISK, "--dwell", "90 sheep"], "--dwell '90 sheep'"),
    "a negative min_dwell": (["create", "odd/zone", *DISK, "--min-dwell", "-1s"], "--min-dwell '-1s'"),
    "an age in words": (["create", "odd/zone", *DISK, "--max-event-age", "old"], "--max-event-age 'old'"),
    "half a boundary": (["create", "odd/zone", *DISK, "--boundary", "half"], "'half' is not one of"),
    "a name with a blank": (["create", "a b", *DISK], "name is 'a b'"),
    "an empty prefix of odd characters": (
        ["create", "odd/zone", "--circle", "0", "0", "1", "--subject-prefix", "%"],
        "--subject-prefix is %",
    ),
    "a circle that is none": (
        ["create", "odd/zone", "--circle", "0", "nan", "1", "--subjects", "odd/fleet"],
        "the circle's y is nan",
    ),
    "a ring that crosses itself": (
        ["create", "odd/zone", "--polygon", "POLYGON ((0 0, 2 2, 2 0, 0 2, 0 0))", "--subjects", "odd/fleet"],
        "edges 0 and 2 cross",
    ),
    "an empty polygon": (
        ["create", "odd/zone", "--polygon", "POLYGON EMPTY", "--subjects", "odd/fleet"],
        "empty Polygon",
    ),
    "other subjects": (
        ["replace", "odd/depot", "--circle", "0", "0", "5", "--subjects", "odd/ids"],
        "--subjects is odd/ids",
    ),
    "ahead": (["ack", "odd/depot", "mail", "99"], "sequence 99 is after the last event, 2"),
    "backwards in words": (["ack", "odd/depot", "mail", "-1"], "No such option: -1"),
    "a watch from the future": (["watch", "odd/depot", "--after", "99"], "sequence 99 is after the last event, 2"),
    "a rate that is none": (["watch", "odd/depot", "--max-rate", "nan"], "greater than or equal to 0"),
    "no events": (["watch", "odd/depot", "--events", "0"], "greater than or equal to 1"),
    "a list of nothing": (["list", "%"], "prefix is %"),
    "inside of nothing": (["inside", "zz"], "there is no fence 'zz'"),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_an_option_is_refused(address: str, unchanged: Callable[[], bytes], case: str) -> None:
    arguments, complaint = OPTIONS[case]
    before = unchanged()
    done = dynhull("fences", *arguments, "--address", address)
    assert done.exit_code in (1, 2)
    assert complaint in re.sub(r"[\s│]+", " ", done.stderr)
    assert unchanged() == before
