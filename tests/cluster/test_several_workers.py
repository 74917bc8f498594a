"""Names on two workers: what is composed, what is refused, and what goes through a gateway unchanged."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import grpc
import numpy as np
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc
from metrics import measured, samples
from refusal import refusal

from dynhull.margin import max_margin
from dynhull_client import (
    Batch,
    ConsumerNotFoundError,
    FeedBatch,
    HullClient,
    HullNotFoundError,
    HullUnsuitableError,
    InvalidRequestError,
    PermissionDeniedError,
    Prefix,
    RevisionForgottenError,
    UnauthenticatedError,
)
from dynhull_cluster.placement import worker_of
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

# Names of both workers, and two of one worker.
ZERO, ONE, WITH_ONE = "north/a", "fleet/a", "fleet/b"
SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]
BEARER = (("authorization", "Bearer all"),)
SERVING = health_pb2.HealthCheckResponse.SERVING


@dataclass(frozen=True)
class Place:
    """A server of two workers, with a hull of one and two of the other.

    Attributes:
        address: its address.
        metrics: that of its metrics.
        tokens: its file of tokens: "all" may do everything, "north" what concerns names with this prefix.
    """

    address: str
    metrics: str
    tokens: Path


def entry(token: str, prefix: str) -> str:
    digest = sha256(token.encode()).hexdigest()
    return f'[[token]]\nsha256 = "{digest}"\nread = ["{prefix}"]\nwrite = ["{prefix}"]\npast = ["{prefix}"]\n'


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder = tmp_path_factory.mktemp("workers")
    tokens = folder / "tokens.toml"
    tokens.write_text(entry("all", "") + entry("north", "north/"))
    options = ("--workers", "2", "--gateways", "2", "--tokens", str(tokens), "--log-level", "error")
    options += ("--metrics-prefix", "fleet/", "--data", str(folder / "data"))
    with measured(*options) as (server, metrics), HullClient(server.address, token="all") as client:
        for name, shift in ((ZERO, 0.0), (ONE, 10.0), (WITH_ONE, 20.0)):
            client.create_hull(name)
            client.apply(name, insert=np.add(SQUARE, [shift, 0.0]))
        yield Place(server.address, metrics, tokens)


@pytest.fixture(scope="module")
def client(place: Place) -> Iterator[HullClient]:
    with HullClient(place.address, token="all") as client:
        yield client


def test_names_stay_where_they_are() -> None:
    """The numbers are part of the format of data folders."""
    assert [worker_of(name, 2) for name in (ZERO, ONE, WITH_ONE)] == [0, 1, 1]
    assert [worker_of(name, 7) for name in ("fleet", "fleet/", "fleet/trucks/1", "a", "b")] == [2, 2, 2, 5, 2]


def test_hulls_are_listed_in_pages_of_all_workers(place: Place, client: HullClient) -> None:
    assert [each.name for each in client.list_hulls()] == [ONE, WITH_ONE, ZERO]
    assert [each.name for each in client.list_hulls("fleet/")] == [ONE, WITH_ONE]
    with grpc.insecure_channel(place.address) as channel:
        stub = HullServiceStub(channel)
        names, token = [], ""
        while True:
            page = stub.ListHulls(pb.ListHullsRequest(page_size=1, page_token=token), metadata=BEARER)
            names += [each.name for each in page.hulls]
            token = page.next_page_token
            if not token:
                break
        assert names == [ONE, WITH_ONE, ZERO]
        code, info, _ = refusal(lambda: stub.ListHulls(pb.ListHullsRequest(page_size=-1), metadata=BEARER))
        assert (code, info.metadata["field"]) == (grpc.StatusCode.INVALID_ARGUMENT, "page_size")


@pytest.mark.parametrize(("first", "other"), [(ZERO, ONE), (ONE, ZERO), (ONE, WITH_ONE)])
def test_hulls_of_any_workers_are_separated(client: HullClient, first: str, other: str) -> None:
    found = client.separate(first, other)
    hull, second = client.get_hull(first), client.get_hull(other)
    expected = max_margin(hull.vertices, second.vertices)
    assert (found.distance, found.revision, found.other_revision) == (expected.margin, hull.revision, second.revision)
    assert np.array_equal(found.normal, expected.normal)
    assert np.array_equal(found.closest, expected.points)


def test_hulls_that_cannot_be_separated(client: HullClient) -> None:
    client.create_hull("north/globe", geographic=True)
    client.create_hull("north/empty")
    with pytest.raises(HullUnsuitableError, match="'north/globe' is geographic, and 'fleet/a' is a plane"):
        client.separate(ONE, "north/globe")
    with pytest.raises(HullNotFoundError, match="'north/none'"):
        client.separate(ONE, "north/none")
    with pytest.raises(ValueError, match="'north/empty' has no points"):
        client.separate(ONE, "north/empty")
    for name in ("north/globe", "north/empty"):
        client.delete_hull(name)


def test_what_needs_one_worker_says_so(client: HullClient) -> None:
    apart = re.escape("another worker has 'north/a'; give both names the same part before the first \"/\"")
    with pytest.raises(HullUnsuitableError, match=apart) as refused:
        client.transfer({ZERO: Batch(insert=[[1, 1]]), ONE: Batch(delete=[[10, 0]])})
    assert (refused.value.reason, refused.value.field) == ("HULLS_APART", "batches[1].name")
    assert client.get_hull(ZERO).info.points == 4
    with pytest.raises(HullUnsuitableError, match=apart):
        client.locate(ZERO, keys=["a"], keys_of=ONE)
    with pytest.raises(HullUnsuitableError, match=r"^subjects is 'fleet/a'"):
        client.create_fence("north/fence", SQUARE, ONE)
    with pytest.raises(InvalidRequestError, match='with several workers, a prefix has a "/"'):
        client.create_fence("north/fence", SQUARE, Prefix("north"))
    with pytest.raises(HullUnsuitableError, match=apart):
        next(client.fence_events_between(ONE, other_hull=ZERO))
    for name in (ZERO, ONE):  # asked of the worker that has it
        with pytest.raises(HullUnsuitableError, match="has points without keys"):
            next(client.fence_events_between(SQUARE, name))
    before = {name: client.get_hull(name).revision for name in (ONE, WITH_ONE)}
    applied = client.transfer({ONE: Batch(insert=[[11, 1]]), WITH_ONE: Batch(insert=[[21, 1]])})
    assert {name: each.revision - 1 for name, each in applied.items()} == before
    client.transfer({ONE: Batch(delete=[[11, 1]]), WITH_ONE: Batch(delete=[[21, 1]])})


def test_fences_of_all_workers(client: HullClient) -> None:
    for group in ("fleet", "north"):
        client.create_hull(f"{group}/keyed", keyed="str")
        client.create_fence(f"{group}/fence", SQUARE, Prefix(f"{group}/"))
        client.put(f"{group}/keyed", ["k"], [[1, 1]])
    assert [each.name for each in client.list_fences()] == ["fleet/fence", "north/fence"]
    assert [each.inside for each in client.list_fences()] == [1, 1]
    for group in ("fleet", "north"):
        client.delete_fence(f"{group}/fence")
        client.delete_hull(f"{group}/keyed")


def test_reads_of_all_workers_are_answered_in_order(client: HullClient) -> None:
    with client.pipeline() as pipeline:
        counts = [pipeline.get_hull(name) for name in (ZERO, ONE, WITH_ONE) * 50]
        gap = pipeline.separate(ZERO, ONE)
        missing = pipeline.get_hull("north/none")
        last = pipeline.locate(ZERO, [[1, 1]])
    assert [each.result().info.name for each in counts] == [ZERO, ONE, WITH_ONE] * 50
    assert gap.result().distance == 6.0
    assert isinstance(missing.exception(), HullNotFoundError)
    assert last.result().sides.tolist() == [1]


def test_a_consumer_of_a_prefix_has_its_place_at_all_workers(client: HullClient) -> None:
    names = [f"{part}/consumed" for part in ("north", "fleet")]
    for name in names:
        client.create_hull(name, keyed="str")
        client.ack_feed(name, consumer="index", after=0)
        for number in range(2):
            client.put(name, ["k"], [(number, 0)])

    def next_of_each() -> set[tuple[str, int]]:
        found: list[FeedBatch] = []
        with client.feed(prefix="", consumer="index") as feed:
            while len(found) < len(names) or found[-1].after is None:
                found += [each for each in [next(feed)] if each.hull in names]
        client.ack_feed(prefix="", consumer="index", after=found[-1].after)
        return {(each.hull, each.revision) for each in found}

    seen = next_of_each()
    while len(seen) < 2 * len(names):
        seen |= next_of_each()
    for name in names:
        client.put(name, ["k"], [(5, 0)])
    assert next_of_each() == {(name, 3) for name in names}
    listed = [(each.hull, each.prefix, each.name) for each in client.list_feed_consumers()]
    assert listed == [(None, "", "index"), *((name, None, "index") for name in sorted(names))]
    with pytest.raises(RevisionForgottenError):
        client.ack_feed(prefix="", consumer="index", after=b"0" * 20)
    client.delete_feed_consumer(prefix="", consumer="index")
    with pytest.raises(ConsumerNotFoundError):
        client.delete_feed_consumer(prefix="", consumer="index")
    for name in names:
        client.delete_feed_consumer(name, consumer="index")
        client.delete_hull(name)
    assert list(client.list_feed_consumers()) == []


def test_the_feed_of_a_prefix_is_merged_from_all_workers(client: HullClient) -> None:
    """Each batch once, those of a worker in order, and positions lead on from all of them."""
    names = [f"{part}/fed-{number}" for part in ("north", "fleet") for number in range(2)]
    for name in names:
        client.create_hull(name, keyed="str")

    def write(number: int) -> None:
        for name in names:
            client.put(name, [f"k{number}"], [(number, 0)])

    for number in range(3):
        write(number)
    seen: list[FeedBatch] = []
    with client.feed(prefix="", after=0) as feed:
        while len(seen) < 3 * len(names) or seen[-1].after is None:
            seen += [each for each in [next(feed)] if each.hull in names]
        write(3)
        live: list[FeedBatch] = []
        while len(live) < len(names):
            live += [each for each in [next(feed)] if each.hull in names]
    with client.feed(prefix="", after=seen[-1].after) as again:
        assert set(names) <= set((next(again).hulls or {}).keys())
        later = [next(again) for _ in names]
    for batches in (seen + live, seen + later):
        for name in names:
            mine = [each for each in batches if each.hull == name]
            assert [(each.revision, each.keys) for each in mine] == [(n + 1, (f"k{n}",)) for n in range(4)]
        for worker in range(2):
            commits = [each.commit or 0 for each in batches if worker_of(each.hull, 2) == worker]
            assert commits == sorted(commits)
    for name in names:
        client.delete_hull(name)


def test_a_refusal_is_told_while_requests_are_sent(place: Place) -> None:
    """The worker ends the call while the gateway writes to it."""
    bad = pb.IngestRequest(name=ZERO, batch={"deletes": {"coordinates": [77, 77]}})
    more = pb.IngestRequest(batch={"inserts": {"packed": np.ones((4096, 2)).tobytes()}})
    with grpc.insecure_channel(place.address) as channel:
        stub = HullServiceStub(channel)
        for _ in range(30):
            code, info, _ = refusal(lambda: stub.Ingest(iter([bad, *[more] * 32]), metadata=BEARER))
            assert (code, info.metadata["batch"]) == (grpc.StatusCode.FAILED_PRECONDITION, "0")


def test_all_acknowledgements_come_before_a_refusal(place: Place, client: HullClient) -> None:
    """The gateway has not read all of them when the call ends while it writes to it."""
    rows = np.random.default_rng(1).normal(size=(3000, 2))
    good = pb.StreamRequest(batch={"inserts": {"packed": rows.tobytes()}})
    bad = pb.StreamRequest(batch={"deletes": {"coordinates": [77, 77]}})
    with grpc.insecure_channel(place.address) as channel:
        stub = HullServiceStub(channel)
        for _ in range(30):
            client.create_hull("north/acknowledged")
            requests = [pb.StreamRequest(name="north/acknowledged"), *[good] * 10, bad, *[good] * 40]
            acknowledged: list[int] = []

            def take(requests: list[pb.StreamRequest] = requests, acknowledged: list[int] = acknowledged) -> None:
                for response in stub.Stream(iter(requests), metadata=BEARER):
                    acknowledged.append(response.result.revision)  # noqa: PERF401  # up to the error

            code, info, _ = refusal(take)
            assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "POINT_MISSING")
            assert acknowledged == list(range(1, 11))
            client.delete_hull("north/acknowledged")


def test_health_of_each_worker_and_metrics_of_all(place: Place) -> None:
    with grpc.insecure_channel(place.address) as channel:
        health = health_pb2_grpc.HealthStub(channel)
        for service in ("", "dynhull.v1.worker/0", "dynhull.v1.worker/1", "dynhull.v1.scrub"):
            assert health.Check(health_pb2.HealthCheckRequest(service=service)).status == SERVING
    found = samples(place.metrics)
    names = ("worker-0", "worker-1", "gateway-0", "gateway-1")
    assert [found[f'dynhull_process_serving{{process="{name}"}}'] for name in names] == [1, 1, 1, 1]
    hulls = [found[f'dynhull_hulls{{process="worker-{i}"}}'] for i in range(2)]
    assert hulls == [
        sum(1 for name in found if "dynhull_hull_points" in name and f"worker-{i}" in name) for i in (0, 1)
    ]
    assert sum(count for name, count in found.items() if name.startswith("dynhull_calls_total{") and "gateway" in name)
    areas = {name: area for name, area in found.items() if name.startswith("dynhull_hull_area{")}
    assert areas == {f'dynhull_hull_area{{hull="{name}",process="worker-1"}}': 16 for name in (ONE, WITH_ONE)}


def test_tokens_hold_for_calls_through_a_gateway(place: Place, client: HullClient) -> None:
    with HullClient(place.address, token="north") as some, HullClient(place.address, token="other") as stranger:
        assert {each.name.partition("/")[0] for each in some.list_hulls()} == {"north"}
        with pytest.raises(PermissionDeniedError):
            some.create_hull(ONE)
        with pytest.raises(PermissionDeniedError):
            some.separate(ZERO, ONE)
        with pytest.raises(PermissionDeniedError, match=f"may not write '{ONE}'"):  # not where it is
            some.transfer({ZERO: Batch(insert=[[1, 1]]), ONE: Batch(delete=[[10, 0]])})
        with pytest.raises(PermissionDeniedError, match=f"may not read '{ONE}'"):
            some.locate(ZERO, keys=["a"], keys_of=ONE)
        with pytest.raises(PermissionDeniedError, match=f"may not read '{ONE}'"):
            some.create_fence("north/fence", SQUARE, ONE)
        with some.pipeline() as pipeline, pytest.raises(PermissionDeniedError, match=f"may not read '{ONE}'"):
            pipeline.locate(ZERO, keys=["a"], keys_of=ONE).result()
        with pytest.raises(UnauthenticatedError):
            stranger.get_hull(ZERO)
        with pytest.raises(PermissionDeniedError):
            some.series(ONE)
        assert some.series(ZERO).areas[-1] == 16
        with some.watch(ZERO) as watch:
            next(watch)
            place.tokens.write_text(entry("all", ""))
            with pytest.raises(UnauthenticatedError):
                next(watch)
        assert client.get_hull(ZERO).info.points == 4
