"""Records of a real Kafka become points, each exactly once, and no topic is taken for the one before."""

import asyncio
import json
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

import pytest
from aiokafka import AIOKafkaProducer, TopicPartition
from aiokafka.admin import RecordsToDelete
from brokers import broker, kafka
from ingest_process import ingest_process, ingested
from patience import PATIENCE, wait_until
from ports import free_port
from proxy import Proxy, proxy
from topics import administer, made

from dynhull_bridges.ingest import kafka as feeds
from dynhull_bridges.ingest.feed import FeedError
from dynhull_client import HullClient

pytestmark = [pytest.mark.long, pytest.mark.only_with("KAFKA_CASES")]
POINT = json.dumps({"x": 1, "y": 1}).encode()


@pytest.fixture(scope="module")
def way(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Proxy]:
    """The way to a broker, which has all clients take it."""
    port = free_port()
    with (
        proxy(f"127.0.0.1:{port}") as way,
        broker(kafka(tmp_path_factory.mktemp("kafka"), port, way.address), port),
    ):
        yield way


@pytest.fixture(scope="module")
def servers(way: Proxy) -> str:
    return way.address


@pytest.fixture
def client(address: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        yield client


@pytest.fixture
def topic(name: str) -> str:
    """A name of a topic, which has no slashes."""
    return name[-100:]


@asynccontextmanager
async def producing(servers: str, **settings: Any) -> AsyncIterator[AIOKafkaProducer]:
    producer = AIOKafkaProducer(bootstrap_servers=servers, **settings)
    await producer.start()
    try:
        yield producer
    finally:
        await producer.stop()


def send(servers: str, topic: str, records: Sequence[bytes | None], key: bytes | None = None) -> None:
    """Send records; the broker has them when this returns."""

    async def run() -> None:
        async with producing(servers) as producer:
            for each in records:
                await producer.send_and_wait(topic, each, key=key)

    asyncio.run(run())


def options(servers: str, topic: str, hull: str) -> tuple[str, ...]:
    return f"kafka://{servers}/{topic}", "--hull", hull, "--x", "$.x", "--y", "$.y"


def refused(address: str, *options: object) -> None:
    with ingest_process(address, *options, "--to-end", code=2) as ingest:
        ingest.process.wait(PATIENCE)
        assert "was created again. Give another --producer" in ingest.lines()[-1]


def test_each_committed_record_is_a_point(
    client: HullClient, address: str, servers: str, topic: str, name: str
) -> None:
    """Of partitions, and of transactions, of which one was aborted."""
    made(servers, topic, partitions=2)

    async def transactions() -> None:
        async with producing(servers, transactional_id=topic) as producer:
            for each in range(4):
                await producer.begin_transaction()
                for partition in (0, 1):
                    await producer.send_and_wait(topic, POINT, partition=partition)
                await (producer.abort_transaction() if each == 1 else producer.commit_transaction())

    asyncio.run(transactions())
    assert ingested(address, *options(servers, topic, name))[-1]["points"] == 6
    send(servers, topic, [POINT] * 20)
    assert ingested(address, *options(servers, topic, name))[-1]["points"] == 20
    assert client.get_hull(name).info.points == 26


@pytest.mark.parametrize("stored", [3, 5, 8], ids=["shorter", "as long", "longer"])
def test_a_topic_that_was_made_again_is_refused(address: str, servers: str, topic: str, name: str, stored: int) -> None:
    made(servers, topic)
    send(servers, topic, [POINT] * 5)
    ingested(address, *options(servers, topic, name))
    made(servers, topic)
    send(servers, topic, [POINT] * stored)
    refused(address, *options(servers, topic, name))
    assert ingested(address, *options(servers, topic, name), "--producer", "again")[-1]["points"] == stored


def test_a_topic_that_was_made_again_under_hulls_by_record(address: str, servers: str, topic: str, name: str) -> None:
    given = options(servers, topic, f"{name}/{{$.x}}")
    made(servers, topic)
    send(servers, topic, [POINT] * 5)
    assert ingested(address, *given)[-1]["points"] == 5
    assert ingested(address, *given)[-1]["points"] == 0
    made(servers, topic)
    send(servers, topic, [POINT.replace(b"1", b"2")] * 8)
    assert ingested(address, *given)[-1]["points"] == 8, "the broker forgot the place with the topic"
    send(servers, topic, [POINT])
    refused(address, *given)


def test_a_topic_that_is_made_again_meanwhile(
    client: HullClient, address: str, servers: str, topic: str, name: str
) -> None:
    made(servers, topic)
    send(servers, topic, [POINT] * 5)
    client.create_hull(name)
    with ingest_process(address, *options(servers, topic, name), code=2) as ingest:
        wait_until(lambda: client.last_sequence(name, f"kafka/{topic}/0") == 5)
        made(servers, topic)
        send(servers, topic, [POINT] * 3)
        ingest.process.wait(PATIENCE)
        assert "was created again. Give another --producer" in ingest.lines()[-1]


def test_a_topic_that_was_made_again_is_noticed_while_it_is_read(
    monkeypatch: pytest.MonkeyPatch, servers: str, topic: str
) -> None:
    """A feed asks for the id after each read."""
    monkeypatch.setattr(feeds, "ASK_EVERY", -1.0)
    made(servers, topic)

    async def run() -> None:
        feed = feeds.Kafka(servers, topic, 0, None, "group")
        await feed.begin(0)
        await feed.read()
        await asyncio.to_thread(made, servers, topic)
        try:
            while True:
                await feed.read()
        finally:
            await feed.close()

    with pytest.raises(FeedError, match=r"another id|UnknownTopic"):
        asyncio.run(run())


def test_a_hull_without_the_identity_of_its_topic_adopts_it(
    client: HullClient, address: str, servers: str, topic: str, name: str
) -> None:
    made(servers, topic)
    send(servers, topic, [POINT] * 3)
    client.create_hull(name)
    client.apply(name, insert=[[1, 1]] * 2, producer=f"kafka/{topic}/0", sequence=2, may_skip=True)
    said = ingested(address, *options(servers, topic, name))
    assert [line["feed"] for line in said if "taken for this log" in line["event"]] == [f"kafka/{topic}/0"]
    assert said[-1]["points"] == 1
    made(servers, topic)
    refused(address, *options(servers, topic, name))


def test_records_without_a_value_delete_their_keys(
    client: HullClient, address: str, servers: str, topic: str, name: str
) -> None:
    made(servers, topic)
    for key in (b"a", b"b"):
        send(servers, topic, [POINT], key)
    send(servers, topic, [None], b"a")
    send(servers, topic, [POINT])
    given = (*options(servers, topic, name), "--key", "{key}", "--tombstones", "delete")
    said = ingested(address, *given)[-1]
    assert (said["points"], said["bad"]) == (3, 1), "one has no key"
    assert client.get_hull(name).info.points == 1
    assert client.positions(name, ["b"]).positions.tolist() == [[1, 1]]


def test_what_the_topic_removed_before_it_was_read(address: str, servers: str, topic: str, name: str) -> None:
    made(servers, topic)
    send(servers, topic, [POINT] * 3)
    ingested(address, *options(servers, topic, name))
    send(servers, topic, [POINT] * 7)
    before = {TopicPartition(topic, 0): RecordsToDelete(before_offset=8)}
    administer(servers, lambda admin: admin.delete_records(before))
    with ingest_process(address, *options(servers, topic, name), "--to-end", code=1) as ingest:
        ingest.process.wait(PATIENCE)
        assert "messages 4 to 8, 5 at most, were removed before they were read: --accept-gaps" in ingest.lines()[-1]
    said = ingested(address, *options(servers, topic, name), "--accept-gaps")[-1]
    assert (said["points"], said["lost"]) == (2, 5)


@pytest.mark.parametrize("records", [0, 1], ids=["quiet", "busy"])
def test_a_network_to_the_broker_that_swallows_bytes(
    client: HullClient, address: str, way: Proxy, servers: str, topic: str, name: str, records: int
) -> None:
    """It is said, also where nothing comes; each record is a point once."""
    made(servers, topic)
    send(servers, topic, [POINT])
    client.create_hull(name)
    with ingest_process(address, *options(servers, topic, name), "--ping-interval", "1s") as ingest:
        wait_until(lambda: client.last_sequence(name, f"kafka/{topic}/0") == 1)
        way.silence()
        send(servers, topic, [POINT] * records)
        ingest.wait_for("no messages from the broker, trying again")
        send(servers, topic, [POINT])
        wait_until(lambda: client.last_sequence(name, f"kafka/{topic}/0") == 2 + records)
    assert client.get_hull(name).info.points == 2 + records
