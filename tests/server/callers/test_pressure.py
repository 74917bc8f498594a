"""Bursts of calls are answered; clients that do not read cost no memory, and their calls end with a reason."""

import asyncio

import grpc
import numpy as np
from cases import slow
from metrics import measured, scrape
from patience import wait_until
from refusal import refusal
from server_process import server_process

from dynhull_client import AsyncHullClient, HullClient, HullCopy
from dynhull_client._messages import decode_event
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

# Without this a client buffers megabytes that it does not read.
SMALL_WINDOW = [("grpc.http2.bdp_probe", 0)]
VERTICES = 1_000
STALLED = 40
WARM_UP, BATCHES = 150, 600
BURST = 5_000


def ring(i: int) -> np.ndarray:
    """VERTICES vertices, different ones for each i."""
    angles = np.linspace(0, 2 * np.pi, VERTICES, endpoint=False) + i
    return 1e6 * np.stack((np.cos(angles), np.sin(angles)), axis=1)


def turn(client: HullClient, begin: int, end: int) -> None:
    """Replace each ring from `begin` to `end` by the next: every batch changes the whole hull."""
    with client.ingest("a") as stream:
        for i in range(begin, end):
            stream.apply(move=(ring(i), ring(i + 1)))


def resident(address: str) -> float:
    return scrape(address)["process_resident_memory_bytes"]


async def burst(address: str, name: str) -> int:
    """Put BURST keys in as many calls at once; returns how many keys the hull has then."""
    async with AsyncHullClient(address) as client:
        await client.create_hull(name, keyed="int")
        async with asyncio.TaskGroup() as calls:
            for i in range(BURST):
                calls.create_task(client.put(name, [i], [[i, i]]))
        return (await client.get_hull(name)).info.points


@slow
def test_a_burst_of_calls_is_answered(address: str, name: str) -> None:
    assert asyncio.run(burst(address, name)) == BURST


def test_watchers_that_do_not_read_cost_no_memory() -> None:
    with (
        measured("--scrub-cpu", "0", "--resume-bytes", "1000000") as (server, address),
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address, SMALL_WINDOW) as channel,
    ):
        client.create_hull("a")
        client.apply("a", insert=ring(0))
        stub = HullServiceStub(channel)
        watches = [stub.Watch(pb.WatchRequest(name="a")) for _ in range(STALLED)]
        copies = [HullCopy() for _ in watches]
        for watch, copy in zip(watches, copies, strict=True):
            copy.update(decode_event(next(watch)))
        turn(client, 0, WARM_UP)
        before = resident(address)
        turn(client, WARM_UP, WARM_UP + BATCHES)
        assert resident(address) < 1.05 * before
        assert scrape(address)["dynhull_watch_lag_seconds"] > 0
        live = client.get_hull("a")
        for watch in watches[::2]:  # with a message on its way
            watch.cancel()
        for watch, copy in zip(watches[1::2], copies[1::2], strict=True):
            events = 0
            while copy.revision < live.revision:
                copy.update(decode_event(next(watch)))
                events += 1
            assert copy.vertices.tolist() == live.vertices.tolist()
            assert events < BATCHES / 2
            watch.cancel()


@slow
def test_a_stream_whose_acknowledgements_are_not_read_is_not_read_either() -> None:
    """The client would send for ever; the amount that the server accepts is bounded."""
    with (
        measured("--scrub-cpu", "0") as (server, address),
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address, SMALL_WINDOW) as channel,
    ):
        client.create_hull("a")
        taken = 0

        def requests():
            nonlocal taken
            while True:
                taken += 1
                yield pb.StreamRequest(name="a", batch={"inserts": {"packed": bytes(16)}})

        stream = HullServiceStub(channel).Stream(requests())
        applied = -1.0
        while applied < (now := scrape(address)['dynhull_batches_total{outcome="applied"}']):
            applied = now
        assert next(stream).result.revision == 1
        stream.cancel()
        assert taken < 1_000_000


def test_what_a_caller_does_not_read_is_bounded() -> None:
    """A stream ends whose next event would be too much; the others go on."""
    with (
        measured("--max-unread-bytes-per-caller", "100000", "--scrub-cpu", "0") as (server, address),
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address, SMALL_WINDOW) as channel,
    ):
        client.create_hull("a")
        client.apply("a", insert=ring(0))
        stub = HullServiceStub(channel)
        watches = []
        for _ in range(STALLED):
            watches.append(stub.Watch(pb.WatchRequest(name="a")))
            next(watches[-1])
        done = 0
        while not (refused := scrape(address).get('dynhull_calls_total{code="RESOURCE_EXHAUSTED",method="Watch"}', 0)):
            turn(client, done, done + 1)
            done += 1
            assert scrape(address)["dynhull_unread_bytes"] <= 100_000
        assert refused < STALLED
        wait_until(lambda: not all(watch.is_active() for watch in watches))
        ended = next(watch for watch in watches if not watch.is_active())
        code, info, _ = refusal(lambda: list(ended))
        assert (code, info.metadata["limit"]) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "max_unread_bytes_per_caller")
        for watch in watches:
            watch.cancel()
        wait_until(lambda: scrape(address)["dynhull_unread_bytes"] == 0)


def test_a_message_that_is_larger_than_what_may_be_unread_is_sent_alone() -> None:
    with server_process("--max-unread-bytes-per-caller", "1") as server, HullClient(server.address) as client:
        client.create_hull("a")
        with client.watch("a") as watch:
            next(watch)
            for i in range(3):
                client.apply("a", insert=ring(i))
                assert next(watch).revision == i + 1


def test_a_watcher_that_takes_too_long_is_told() -> None:
    # Half a second is more than the first event takes on a busy machine, which would end the watch at once.
    with (
        measured("--max-watch-lag", "0.5", "--scrub-cpu", "0") as (server, address),
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address, SMALL_WINDOW) as channel,
    ):
        client.create_hull("a")
        client.apply("a", insert=ring(0))
        watch = HullServiceStub(channel).Watch(pb.WatchRequest(name="a"))
        done = 0
        while scrape(address)["dynhull_watch_lag_seconds"] < 0.6:
            turn(client, done, done + 20)
            done += 20
        code, info, _ = refusal(lambda: list(watch))
        assert (code, info.reason) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "LIMIT_EXCEEDED")
        assert dict(info.metadata) == {"limit": "max_watch_lag", "value": "0.5"}
