"""What brokers and receivers refuse, one row of the tables after the other: for now, for good, or in doubt."""

import asyncio
import json
import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import nats
import pytest
from aiokafka import AIOKafkaConsumer
from brokers import broker, nats_server
from ingest_process import ingest_process
from patience import PATIENCE, wait_until
from peers import program
from ports import free_port
from receiver import receiver

from dynhull_bridges.ingest.feed import DoubtfulError, Feed, FeedError
from dynhull_bridges.ingest.jetstream import JetStreamSource
from dynhull_bridges.ingest.kafka import Kafka
from dynhull_bridges.ingest.mqtt import MqttSource
from dynhull_bridges.jetstream import JetStream as JetStreamTarget
from dynhull_bridges.letters import Letter
from dynhull_bridges.mqtt import Mqtt as MqttTarget
from dynhull_bridges.refusals.kafka import KAFKA
from dynhull_bridges.refusals.mqtt import MQTT
from dynhull_bridges.refusals.nats import NATS
from dynhull_bridges.refusals.table import Meaning
from dynhull_bridges.sources import Source
from dynhull_bridges.target import GoneError, NotDeliveredError, RefusedError, Target
from dynhull_bridges.webhook import Webhook

ERRORS: dict[Meaning, type[Exception]] = {
    Meaning.PASSES: FeedError,
    Meaning.DOUBTFUL: DoubtfulError,
    Meaning.FINAL: ValueError,
}
CONNACKS = [0x80, *range(0x81, 0x8B), 0x8C, 0x90, 0x95, 0x97, 0x9A, 0x9B, 0x9C, 0x9D, 0x9F]
SUBACKS = [0x80, 0x83, 0x87, 0x8F, 0x91, 0x97, 0x9E, 0xA1, 0xA2]
PUBACKS = [0x80, 0x83, 0x87, 0x90, 0x91, 0x97, 0x99]
OLD_CONNACKS = {1: ValueError, 2: ValueError, 3: FeedError, 4: ValueError, 5: ValueError}


async def begin(feed: Feed) -> Exception:
    """The error with which a feed begins."""
    try:
        await feed.begin(0)
    except (FeedError, ValueError) as error:
        return error
    finally:
        await feed.close()
    raise AssertionError("it was not refused")


class Answers(socketserver.ThreadingTCPServer):
    """A broker that says `greeting`, and answers the packets of each connection in their order."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, greeting: bytes, answers: list[bytes]) -> None:
        super().__init__(("127.0.0.1", 0), Connection)
        self.greeting, self.answers = greeting, answers
        self.port = self.server_address[1]


class Connection(socketserver.BaseRequestHandler):
    server: Answers

    def handle(self) -> None:
        self.request.sendall(self.server.greeting)
        for each in self.server.answers:
            if not self.request.recv(65536):
                return
            self.request.sendall(each)
        self.request.recv(65536)


@contextmanager
def answering(greeting: bytes, *answers: bytes) -> Iterator[int]:
    with Answers(greeting, list(answers)) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server.port
        finally:
            server.shutdown()
            thread.join()


def mqtt(version: str, *answers: bytes) -> Exception:
    with answering(b"", *answers) as port:
        return asyncio.run(begin(MqttSource(f"mqtt://127.0.0.1:{port}/t?version={version}", "h")))


def test_the_rows_of_mqtt_are_answers_that_there_are() -> None:
    assert {code for codes in MQTT.rows.values() for code in codes} == {*CONNACKS, *SUBACKS, *PUBACKS}


@pytest.mark.parametrize("code", CONNACKS, ids=hex)
def test_connections_of_mqtt(code: int) -> None:
    error = mqtt("5", bytes([0x20, 3, 0, code, 0]))
    assert type(error) is ERRORS[MQTT.meaning(code)]
    assert str(error).startswith("the broker refuses the connection: ")


@pytest.mark.parametrize("code", OLD_CONNACKS)
def test_connections_of_mqtt_3(code: int) -> None:
    assert type(mqtt("3.1.1", bytes([0x20, 2, 0, code]))) is OLD_CONNACKS[code]


@pytest.mark.parametrize("code", SUBACKS, ids=hex)
def test_subscriptions_of_mqtt(code: int) -> None:
    error = mqtt("5", bytes([0x20, 3, 0, 0, 0]), bytes([0x90, 4, 0, 1, 0, code]))
    assert type(error) is ERRORS[MQTT.meaning(code)]
    assert str(error).startswith("the broker refuses the filter 't': ")


def test_subscriptions_of_mqtt_3() -> None:
    assert type(mqtt("3.1.1", bytes([0x20, 2, 0, 0]), bytes([0x90, 3, 0, 1, 0x80]))) is DoubtfulError


async def deliver(target: Target) -> Exception:
    """The error with which a letter is not delivered."""
    try:
        await target.deliver([Letter("id", Source("fence", "fence"), "enter", "uid", 1, "{}")])
    except (NotDeliveredError, GoneError) as error:
        return error
    finally:
        await target.close()
    raise AssertionError("it was not refused")


def kind_of(meaning: Meaning) -> type[Exception]:
    """The error of a delivery."""
    return RefusedError if meaning is Meaning.FINAL else NotDeliveredError


@pytest.mark.parametrize("code", PUBACKS, ids=hex)
def test_publications_to_mqtt(code: int) -> None:
    async def run(port: int) -> Exception:
        return await deliver(MqttTarget(f"mqtt://127.0.0.1:{port}/t", PATIENCE))

    with answering(b"", bytes([0x20, 3, 0, 0, 0]), bytes([0x40, 4, 0, 1, code, 0])) as port:
        error = asyncio.run(run(port))
    assert type(error) is kind_of(MQTT.meaning(code))


def test_a_connection_that_is_lost_before_the_answer() -> None:
    with answering(b"", b"") as port:
        feed = MqttSource(f"mqtt://127.0.0.1:{port}/t", "h")
        feed._client.on_socket_open = lambda _client, _data, socket: socket.shutdown(2)
        assert type(asyncio.run(begin(feed))) is FeedError


@pytest.fixture(scope="module")
def without_jetstream() -> Iterator[int]:
    """A NATS server in which the test answers what JetStream would."""
    port = free_port()
    with broker([program("nats-server"), "-a", "127.0.0.1", "-p", port], port):
        yield port


@pytest.mark.parametrize("code", [code for codes in NATS.rows.values() for code in codes if isinstance(code, int)])
def test_answers_of_jetstream(without_jetstream: int, code: int) -> None:
    async def run() -> Exception:
        url = f"nats://127.0.0.1:{without_jetstream}"
        async with await nats.connect(url) as connection:
            answer = {
                "type": "error",
                "error": {"code": 400, "err_code": code, "description": "said by JetStreamSource"},
            }

            async def refuse(message: Any) -> None:
                await message.respond(json.dumps(answer).encode())

            await connection.subscribe("$JS.API.STREAM.INFO.S", cb=refuse)
            await connection.flush()
            return await begin(JetStreamSource(f"{url}/S", None, "mapping"))

    error = asyncio.run(run())
    assert type(error) is ERRORS[NATS.meaning(code)]
    assert "said by JetStreamSource" in str(error) or str(error) == "NATS has no stream 'S'"


@pytest.mark.parametrize("code", [10054, 10060, 10077, 10109, 10047, 10008, 99999])
def test_publications_to_jetstream(without_jetstream: int, code: int) -> None:
    async def run() -> Exception:
        url = f"nats://127.0.0.1:{without_jetstream}"
        async with await nats.connect(url) as connection:
            answer = {"error": {"code": 400, "err_code": code, "description": "said by JetStreamSource"}, "stream": "S"}

            async def refuse(message: Any) -> None:
                await message.respond(json.dumps(answer).encode())

            await connection.subscribe("events", cb=refuse)
            await connection.flush()
            return await deliver(JetStreamTarget(f"{url}/events", PATIENCE))

    assert type(asyncio.run(run())) is kind_of(NATS.meaning(code))


def test_no_jetstream(without_jetstream: int) -> None:
    """As long as nobody answers, it may be starting."""
    feed = JetStreamSource(f"nats://127.0.0.1:{without_jetstream}/S", None, "mapping")
    assert type(asyncio.run(begin(feed))) is FeedError


@pytest.mark.parametrize("words", [code for codes in NATS.rows.values() for code in codes if isinstance(code, str)])
def test_connections_of_nats(words: str) -> None:
    with answering(b'INFO {"max_payload":1048576}\r\n', f"-ERR '{words.title()}'\r\n".encode()) as port:
        error = asyncio.run(begin(JetStreamSource(f"nats://127.0.0.1:{port}/S", None, "mapping")))
    assert type(error) is ERRORS[NATS.meaning(words)]
    assert words in str(error).lower()


@pytest.mark.parametrize("kind", [code for codes in KAFKA.rows.values() for code in codes])
def test_errors_of_kafka(monkeypatch: pytest.MonkeyPatch, kind: type[Exception]) -> None:
    async def refuse(_: AIOKafkaConsumer) -> None:
        raise kind

    monkeypatch.setattr(AIOKafkaConsumer, "start", refuse)
    assert type(asyncio.run(begin(Kafka("127.0.0.1:1", "t", 0, None, "g")))) is ERRORS[KAFKA.meaning(kind)]


@pytest.mark.parametrize(
    ("status", "error"),
    [(each, RefusedError) for each in (301, 400, 401, 403, 404, 413, 422)]
    + [(each, NotDeliveredError) for each in (408, 425, 429, 500, 502, 503, 504, 507, 529, 599)]
    + [(410, GoneError)],
)
def test_answers_to_webhooks(status: int, error: type[Exception]) -> None:
    async def run(url: str) -> Exception:
        return await deliver(Webhook(url, [], batch=1, timeout=PATIENCE, allow_private=True))

    with receiver() as endpoint:
        endpoint.answer = lambda _: (status, {})
        assert type(asyncio.run(run(endpoint.url))) is error


async def make(port: int, stream: str) -> None:
    async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
        context = connection.jetstream()
        await context.add_stream(name=stream, subjects=[stream])
        await context.publish(stream, b"[1, 2]")


def test_a_stream_that_is_not_there(address: str, name: str, tmp_path: Any) -> None:
    """One that comes within seconds is read; one that was read is awaited; one that never was ends the ingest."""
    port = free_port()
    options = ("--hull", name, "--x", "$[0]", "--y", "$[1]", "--plane")
    url = f"nats://127.0.0.1:{port}"
    (tmp_path / "empty").mkdir()

    def denied(ingest: Any) -> list[dict[str, Any]]:
        return [line for line in ingest.log() if line.get("error") == f"NATS has no stream {name!r}"]

    with ingest_process(address, f"{url}/{name}", *options) as ingest:
        ingest.wait_for("no messages from the broker, trying again")
        with broker(nats_server(tmp_path, port), port):
            wait_until(lambda: denied(ingest))
            asyncio.run(make(port, name))
            ingest.wait_for("reading")
        with (
            broker(nats_server(tmp_path / "empty", port), port),
            ingest_process(address, f"{url}/other", *options, code=2) as mistyped,
        ):
            mistyped.process.wait(PATIENCE)
            assert mistyped.lines()[-1] == "error: NATS has no stream 'other'\n"
            wait_until(lambda: len(denied(ingest)) > 1)
        with broker(nats_server(tmp_path, port), port):
            wait_until(lambda: len(ingest.said("reading")) == 2)
