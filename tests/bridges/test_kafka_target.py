"""Events of fences and alarms are in a topic of a real Kafka, each once and in order, whatever is killed."""

import asyncio
import json
import random
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import trustme
from aiokafka import AIOKafkaConsumer, AIOKafkaProducer, ConsumerRecord, TopicPartition
from aiokafka.helpers import create_ssl_context
from brokers import broker, kafka
from command_line import dynhull
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key
from ingest_process import ingest_process, ingested
from mortal_server import MortalServer
from patience import PATIENCE, wait_until
from ports import free_port
from relay_process import FAST, acknowledged, alarm, fence, grow_and_shrink, pass_through, relay_process
from server_process import run
from topics import made

from dynhull_client import DynhullError, HullClient

pytestmark = [pytest.mark.long, pytest.mark.only_with("KAFKA_CASES")]
TRYING = "not delivered, trying again"
KILLS = 16


@pytest.fixture(scope="module")
def servers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    port = free_port()
    with broker(kafka(tmp_path_factory.mktemp("kafka"), port), port):
        yield f"127.0.0.1:{port}"


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        alarm(client, name)
        yield client


@pytest.fixture
def topic(name: str) -> str:
    return name[-100:].replace("/", ".")


def records(servers: str, topic: str, partitions: int = 1, **settings: Any) -> list[ConsumerRecord]:
    """What who reads only what is committed sees, and after that nothing more."""

    async def read() -> list[ConsumerRecord]:
        consumer = AIOKafkaConsumer(
            bootstrap_servers=servers, isolation_level="read_committed", auto_offset_reset="earliest", **settings
        )
        await consumer.start()
        try:
            places = [TopicPartition(topic, number) for number in range(partitions)]
            consumer.assign(places)
            ends = await consumer.end_offsets(places)
            found: list[ConsumerRecord] = []
            for place, end in ends.items():
                while await consumer.position(place) < end:
                    found += [each for got in (await consumer.getmany(place, timeout_ms=100)).values() for each in got]
            return found
        finally:
            await consumer.stop()

    return asyncio.run(read())


def events(found: list[ConsumerRecord]) -> list[tuple[str, int]]:
    return [(data["type"], data["sequence"]) for data in (json.loads(each.value)["data"] for each in found)]


def test_a_fence_and_an_alarm(client: HullClient, address: str, servers: str, name: str, tmp_path: Path) -> None:
    """The topics come later than the relay; all of a source is in one partition, under its key."""
    fence(client, f"{name}-f")
    topics = {kind: f"of.{kind}.{name[-50:]}" for kind in ("fence", "alarm")}
    to = f"kafka://{servers}/of.{{kind}}.{name[-50:]}"
    with relay_process(address, tmp_path, f"{name}-f", f"alarm:{name}", "--to", to, "--timeout", "2s", *FAST) as relay:
        grow_and_shrink(client, name, 2)
        pass_through(client, f"{name}-f", ["a", "b"])
        wait_until(lambda: any("create it" in line["error"] for line in relay.said(TRYING)))
        for each in topics.values():
            made(servers, each, partitions=3)
        wait_until(lambda: acknowledged(client, name, "alarm") == 4 and acknowledged(client, f"{name}-f") == 4)
    found = records(servers, topics["alarm"], 3)
    assert events(found) == [("raised", 1), ("cleared", 2), ("raised", 3), ("cleared", 4)]
    assert {(each.partition, each.key) for each in found} == {(found[0].partition, f"/alarms/{name}".encode())}
    uid = client.get_alarm(name).uid
    assert dict(found[0].headers) == {"content-type": b"application/cloudevents+json", "id": f"{uid}-1".encode()}
    assert events(records(servers, topics["fence"], 3)) == [("enter", 1), ("exit", 2), ("enter", 3), ("exit", 4)]


@pytest.mark.timeout(1200)
def test_each_event_is_there_once_over_kills(tmp_path: Path, topic: str) -> None:
    """Server, relay and broker get SIGKILL beside a writer; who reads what is committed sees each event once."""
    rng = random.Random(1)
    port, server = free_port(), MortalServer(tmp_path)
    servers, command = f"127.0.0.1:{port}", kafka(tmp_path / "broker", port, log__flush__interval__messages=1)
    to = ("alarm:a", "yard", "--to", f"kafka://{servers}/{topic}", "--timeout", "10s", *FAST)
    ending, written = threading.Event(), []

    def write() -> None:
        with HullClient(server.address) as client:
            while not ending.is_set():
                for move in (partial(grow_and_shrink, client, "a", 1), partial(pass_through, client, "yard", ["k"])):
                    retried(move)
                written.append(1)

    def retried(move: Callable[[], None]) -> None:
        """A put that repeats one changes nothing."""
        while True:
            server.up.wait()
            with suppress(DynhullError):
                return move()

    with ExitStack() as stack:
        stack.callback(lambda: server.kill())
        with HullClient(server.address) as client:
            alarm(client, "a")
            fence(client, "yard")
        running = ExitStack()
        running.enter_context(broker(command, port))
        made(servers, topic)
        relay = relay_process(server.address, tmp_path, *to, killed=True)
        relayed = relay.__enter__()
        stack.callback(lambda: (relayed.process.kill(), relay.__exit__(None, None, None)))
        writer = threading.Thread(target=write)
        writer.start()
        try:
            for number in range(KILLS):
                before = len(written)
                wait_until(lambda before=before: len(written) > before + 2)
                what = rng.choice(["server", "relay", "relay", "broker"]) if number else "broker"
                if what == "server":
                    server.kill()
                    server.start()
                elif what == "relay":
                    relayed.process.kill()
                    relay.__exit__(None, None, None)
                    relay = relay_process(server.address, tmp_path, *to, killed=True)
                    relayed = relay.__enter__()
                else:
                    running.close()
                    running.enter_context(broker(command, port))
        finally:
            ending.set()
            writer.join()
        with HullClient(server.address) as client:
            lasts = {"a": client.get_alarm("a").last_sequence, "yard": client.get_fence("yard").last_sequence}
            wait_until(lambda: acknowledged(client, "a", "alarm") == lasts["a"])
            wait_until(lambda: acknowledged(client, "yard") == lasts["yard"])
        found = records(servers, topic)
        running.close()
    for name, kinds in (("a", ["raised", "cleared"]), ("yard", ["enter", "exit"])):
        mine = events([each for each in found if each.key.endswith(f"/{name}".encode())])
        assert mine == [(kinds[number % 2], number + 1) for number in range(lasts[name])]


def test_two_relays_of_one_consumer(client: HullClient, address: str, servers: str, name: str, tmp_path: Path) -> None:
    """The second one takes over from the first, which then tries in vain, or the other way round: no event is twice."""
    made(servers, topic := name[-100:].replace("/", "."))
    to = (f"alarm:{name}", "--to", f"kafka://{servers}/{topic}", *FAST)
    with relay_process(address, tmp_path / "1", *to), relay_process(address, tmp_path / "2", *to):
        grow_and_shrink(client, name, 20)
        wait_until(lambda: acknowledged(client, name, "alarm") == 40)
    assert [sequence for _, sequence in events(records(servers, topic))] == list(range(1, 41))


def test_only_what_is_too_large_is_a_dead_letter(
    client: HullClient, address: str, servers: str, topic: str, name: str, tmp_path: Path
) -> None:
    made(servers, topic, max__message__bytes=1800)
    fence(client, f"{name}-f")
    long = "é" * 127
    for key in ("a", long, "b"):
        client.put(f"{name}-f", [key], [[1, 1]])
    to = ("--to", f"kafka://{servers}/{topic}")
    with relay_process(address, tmp_path, f"{name}-f", *to, "--attempts", 2, *FAST):
        wait_until(lambda: acknowledged(client, f"{name}-f") == 3)
    assert events(records(servers, topic)) == [("enter", 1), ("enter", 3)]
    state = ("--state", tmp_path / "relay")
    (dead,) = map(json.loads, run("relay", "dead-letters", "list", *state, "--json").stdout.splitlines())
    assert (dead["event"]["data"]["sequence"], dead["to"]) == (2, f"kafka://{servers}/{topic}")
    made(servers, topic)
    assert run("relay", "dead-letters", "send", *state, *to).stdout == "1 sent\n"
    assert events(records(servers, topic)) == [("enter", 2)]


def test_a_template(client: HullClient, address: str, servers: str, topic: str, name: str, tmp_path: Path) -> None:
    made(servers, topic)
    template = tmp_path / "body"
    template.write_text('["{{ hull }}", {{ value }}]')
    to = ("--to", f"kafka://{servers}/{topic}", "--body-template", template)
    with relay_process(address, tmp_path, f"alarm:{name}", *to, *FAST):
        grow_and_shrink(client, name, 1)
        wait_until(lambda: acknowledged(client, name, "alarm") == 2)
    found = records(servers, topic)
    assert [json.loads(each.value) for each in found] == [[name, 12.0], [name, 2.0]]
    assert dict(found[0].headers)["content-type"] == b"application/json"


def test_encryption_and_passwords(client: HullClient, address: str, name: str, topic: str, tmp_path: Path) -> None:
    """A broker with TLS that asks for a password; a wrong one is repeated, and not shown."""
    port, authority = free_port(), trustme.CA()
    own = authority.issue_cert("127.0.0.1")
    (tmp_path / "ca.pem").write_bytes(authority.cert_pem.bytes())
    key = load_pem_private_key(own.private_key_pem.bytes(), None)
    form = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())  # the only one that Kafka reads
    (tmp_path / "broker.pem").write_bytes(b"".join([form, *(each.bytes() for each in own.cert_chain_pems)]))
    plain = "org.apache.kafka.common.security.plain.PlainLoginModule required"
    settings = {
        "inter__broker__listener__name": "SASL_SSL",
        "listener__security__protocol__map": "SASL_SSL:SASL_SSL,CONTROLLER:PLAINTEXT",
        "sasl__enabled__mechanisms": "PLAIN",
        "sasl__mechanism__inter__broker__protocol": "PLAIN",
        "listener__name__sasl_ssl__plain__sasl__jaas__config": f'{plain} username="r" password="w0rd" user_r="w0rd";',
        "ssl__keystore__type": "PEM",
        "ssl__keystore__location": tmp_path / "broker.pem",
        "ssl__truststore__type": "PEM",
        "ssl__truststore__location": tmp_path / "ca.pem",
        "auto__create__topics__enable": "true",
    }
    context = create_ssl_context(cafile=str(tmp_path / "ca.pem"))
    reached = {
        "security_protocol": "SASL_SSL",
        "ssl_context": context,
        "sasl_mechanism": "PLAIN",
        "sasl_plain_username": "r",
        "sasl_plain_password": "w0rd",
    }
    lines = f"security.protocol=SASL_SSL\nsasl.username=r\nsasl.password=w0rd\nssl.ca.location={tmp_path / 'ca.pem'}\n"
    good, bad = tmp_path / "good", tmp_path / "bad"
    good.write_text(f"# of the relay\n{lines}")
    bad.write_text(lines.replace("w0rd", "s3cret"))
    to = (f"alarm:{name}", "--to", f"kafka://127.0.0.1:{port}/{topic}", "--timeout", "5s", *FAST)

    async def make() -> None:
        async with AIOKafkaProducer(bootstrap_servers=f"127.0.0.1:{port}", **reached) as producer:
            await producer.partitions_for(topic)

    with broker(kafka(tmp_path / "broker", port, protocol="SASL_SSL", **settings), port):
        grow_and_shrink(client, name, 1)
        asyncio.run(make())
        with relay_process(address, tmp_path, *to, "--kafka-config", bad) as relay:
            relay.wait_for(TRYING)
            assert "s3cret" not in "".join(relay.lines())
        with relay_process(address, tmp_path, *to, "--kafka-config", good):
            wait_until(lambda: acknowledged(client, name, "alarm") == 2)
        found = records(f"127.0.0.1:{port}", topic, **reached)
        source = (f"kafka://127.0.0.1:{port}/{topic}", "--plane", "--x", "$.data.sequence", "--y", "$.data.value")
        source += ("--hull", f"{name}/values")
        with ingest_process(address, *source, "--kafka-config", bad) as ingest:
            said = ingest.wait_for("no messages from the broker, trying again")["error"]
        assert said == f"Kafka: no broker answers at 127.0.0.1:{port}, or it refuses the settings of --kafka-config"
        ingested(address, *source, "--kafka-config", good)
    assert events(found) == [("raised", 1), ("cleared", 2)]
    assert client.get_hull(f"{name}/values").vertices.tolist() == [[1, 12], [2, 2]]


def test_a_broker_that_is_silent(
    client: HullClient, address: str, servers: str, topic: str, name: str, tmp_path: Path
) -> None:
    """Deliveries end after their time, and the relay stops within its grace."""
    made(servers, topic)
    assert dynhull("list", "--address", address).exit_code == 0
    with relay_process(address, tmp_path, f"alarm:{name}", "--to", "kafka://127.0.0.1:9/t", *FAST) as relay:
        grow_and_shrink(client, name, 1)
        relay.wait_for(TRYING)
        relay.process.terminate()
        relay.process.wait(PATIENCE)
