"""Pipelines: many reads in few messages."""

import asyncio
import threading
from concurrent import futures

import numpy as np
import pytest
from patience import PATIENCE, wait_until, waits
from proxy import proxy
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import (
    AsyncHullClient,
    HullClient,
    HullEmptyError,
    HullNotFoundError,
    HullUnsuitableError,
    LimitExceededError,
    UnauthenticatedError,
    UnavailableError,
)

RNG = np.random.default_rng(21)
POINTS = RNG.uniform(0.1, 1, (300, 2))
ROWS = RNG.uniform(-1, 2, (40, 2))
READS = [
    ("locate", (ROWS,), {}),
    ("count", (POINTS[:9],), {}),
    ("support", (ROWS,), {}),
    ("tangents", (ROWS,), {}),
    ("distance", (ROWS,), {}),
    ("intersect_lines", (ROWS[:-1], ROWS[1:]), {}),
    ("get_hull", (), {}),
    ("sample_points", (7,), {}),
    ("verify", (), {}),
    ("last_sequence", ("p",), {}),
    ("get_measures", (), {}),
    ("phase_diagram", (ROWS % 1,), {}),
    ("frontier", (ROWS % 1 + 0.1, [0.01]), {}),
    ("locate", (ROWS,), {"min_revision": 1}),
]


@pytest.fixture
def filled(address: str, name: str) -> str:
    with HullClient(address) as client:
        client.create_hull(name)
        client.apply(name, insert=POINTS, producer="p", sequence=1)
        client.create_hull(f"{name}/keys", keyed="str")
        client.put(f"{name}/keys", ["a", "b"], [[0, 0], [1, 1]])
    return name


def test_answers_are_those_of_the_client(connect: type[HullClient], address: str, filled: str) -> None:
    with connect(address) as client:
        expected = [repr(getattr(client, method)(filled, *given, **options)) for method, given, options in READS]
        expected.append(repr(client.positions(f"{filled}/keys", ["b", "c"])))
        expected.append(repr(client.separate(filled, f"{filled}/keys")))
        expected *= 3
        with client.pipeline(batch_reads=5) as pipeline:
            asked = []
            for _ in range(3):
                asked += [getattr(pipeline, method)(filled, *given, **options) for method, given, options in READS]
                asked.append(pipeline.positions(f"{filled}/keys", ["b", "c"]))
                asked.append(pipeline.separate(filled, f"{filled}/keys"))
            pipeline.flush()
            assert all(each.done() for each in asked)
            assert [repr(each.result()) for each in asked] == expected


def test_a_refused_read_does_not_affect_the_others(connect: type[HullClient], address: str, filled: str) -> None:
    with connect(address) as client:
        client.create_hull(f"{filled}/empty")
        with client.pipeline() as pipeline:
            first = pipeline.locate(filled, ROWS)
            refused = {
                HullNotFoundError: pipeline.get_hull(f"{filled}/none"),
                HullEmptyError: pipeline.support(f"{filled}/empty", [[1, 0]]),
                HullUnsuitableError: pipeline.positions(filled, ["a"]),
            }
            last = pipeline.locate(filled, ROWS)
        assert first.result() == last.result() == client.locate(filled, ROWS)
        for kind, each in refused.items():
            assert type(each.exception()) is kind
        assert refused[HullUnsuitableError].exception().field == "keys"


def test_what_is_no_read_is_refused_at_once(connect: type[HullClient], address: str, filled: str) -> None:
    with connect(address) as client, client.pipeline() as pipeline:
        with pytest.raises(ValueError, match="xy row 1"):
            pipeline.locate(filled, [[0, 0], [0, np.nan]])
        with pytest.raises(ValueError, match="min_revision must be at least 0"):
            pipeline.locate(filled, [[0, 0]], min_revision=-1)
        with pytest.raises(TypeError, match="no timeout of its own"):
            pipeline.locate(filled, [[0, 0]], timeout=1)
        assert pipeline.locate(filled, [[0, 0]]).result() == client.locate(filled, [[0, 0]])
    with connect(address) as client, pytest.raises(ValueError, match="in_flight must be at least 1"):
        client.pipeline(in_flight=0)


def test_a_closed_pipeline(connect: type[HullClient], address: str, filled: str) -> None:
    with connect(address) as client:
        with client.pipeline() as pipeline:
            pass
        with pytest.raises(RuntimeError, match="closed"):
            pipeline.get_hull(filled)
        pipeline.close()
        asked = []

        def leave() -> None:
            with client.pipeline() as left:
                asked.append(left.get_hull(filled, min_revision=9))
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            leave()
        assert asked[0].cancelled()
        late = client.pipeline()
    with late:
        assert "the client is closed" in str(late.get_hull(filled).exception())


def test_a_pipeline_waits_while_too_many_reads_are_not_answered(address: str, filled: str) -> None:
    with HullClient(address) as client, client.pipeline(in_flight=4, batch_reads=2) as pipeline:
        waiting = pipeline.get_hull(filled, min_revision=2)
        asked = [pipeline.get_hull(filled) for _ in range(7)]
        added = threading.Event()

        def add() -> None:
            asked.append(pipeline.get_hull(filled))
            added.set()

        thread = threading.Thread(target=add)
        thread.start()
        wait_until(lambda: waits(thread))
        assert not added.is_set()
        client.apply(filled, insert=[[5, 5]])
        assert waiting.result(PATIENCE).revision == 2
        thread.join()
        assert {each.result(PATIENCE).revision for each in asked} == {2}


def test_threads_share_a_pipeline(address: str, filled: str) -> None:
    with HullClient(address) as client, client.pipeline(batch_reads=8, in_flight=32) as pipeline:
        hull = DynamicHull(POINTS)

        def ask(seed: int) -> bool:
            rows = np.random.default_rng(seed).uniform(-1, 2, (300, 1, 2))
            asked = [pipeline.locate(filled, row) for row in rows]
            return all(each.result(PATIENCE).sides == hull.locate(row) for each, row in zip(asked, rows, strict=True))

        with futures.ThreadPoolExecutor(8) as threads:
            assert all(threads.map(ask, range(8)))


def test_cancelled_futures_are_left_out(address: str, filled: str) -> None:
    async def ask() -> list[int]:
        async with AsyncHullClient(address) as client, client.pipeline() as pipeline:
            asked = [pipeline.get_hull(filled) for _ in range(9)]
            for each in asked[::2]:
                each.cancel()
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(pipeline.get_hull(filled, min_revision=2), 0.05)
            before = [(await each).revision for each in asked[1::2]]
            with HullClient(address) as writer:
                writer.apply(filled, insert=[[7, 7]])
            return [*before, (await pipeline.get_hull(filled)).revision]

    assert asyncio.run(ask()) == [1, 1, 1, 1, 2]


def test_reads_are_sent_again_after_a_lost_connection(connect: type[HullClient]) -> None:
    with server_process() as server, HullClient(server.address) as direct, proxy(server.address) as between:
        direct.create_hull("a")
        direct.apply("a", insert=POINTS)
        with connect(between.address) as client, client.pipeline(batch_reads=3, in_flight=9) as pipeline:
            assert pipeline.get_hull("a").result().revision == 1
            asked = [pipeline.get_hull("a") for _ in range(5)]
            waiting = pipeline.get_hull("a", min_revision=2)
            asked += [pipeline.get_hull("a") for _ in range(5)]
            between.cut()
            assert asked[0].result().revision == 1
            direct.apply("a", insert=[[7, 7]])
            assert waiting.result().revision == 2
            assert {each.result().revision for each in asked} <= {1, 2}
            assert asked[-1].result().revision == 2


def test_a_server_that_stays_away(connect: type[HullClient]) -> None:
    with server_process() as server, HullClient(server.address) as direct:
        direct.create_hull("a")
        client = connect(server.address, retries=1)
        pipeline = client.pipeline()
        assert pipeline.get_hull("a").result().revision == 0
    for _ in range(2):  # each read tries anew
        assert type(pipeline.get_hull("a").exception()) is UnavailableError
    pipeline.close()
    client.close()


def test_a_message_that_is_too_large_concerns_its_reads_only(connect: type[HullClient]) -> None:
    rows = np.zeros((100, 2))
    with server_process("--max-message-bytes", "4096") as server, connect(server.address) as client:
        client.create_hull("a")
        with client.pipeline() as pipeline:
            before = [pipeline.locate("a", rows) for _ in range(20)]
            large = pipeline.locate("a", np.zeros((300, 2)))
            after = [pipeline.locate("a", rows) for _ in range(20)]
        assert type(large.exception()) is LimitExceededError
        assert {each.result().revision for each in before + after} == {0}


def test_a_token_that_is_missing_is_the_error_of_every_read(connect: type[HullClient], tmp_path) -> None:
    (tmp_path / "tokens.toml").write_text("")
    with (
        server_process("--tokens", str(tmp_path / "tokens.toml"), complaints="UNAUTHENTICATED") as server,
        connect(server.address) as client,
        client.pipeline() as pipeline,
    ):
        asked = [pipeline.get_hull("a") for _ in range(3)]
        pipeline.flush()
        assert {type(each.exception()) for each in asked} == {UnauthenticatedError}
